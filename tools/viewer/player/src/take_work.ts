// The part of a worker that fetches and decodes the surfaces of a take, in any order.
import { Decoder, type Frame } from '../../../../codec/v3d_decoder.mjs';
import { HttpSource, NoSuchFile, repeated, Unavailable } from './byte_source';
import { type FrameEntry, FrameStore, readEntries } from './mesh_file';
import { MotionWork } from './motion_work';
import { shownFrame, TakeSequence } from './sequence';
import type { FromWorker, Post, TrailPoint } from './worker_messages';

/** Pause before a request is repeated. */
const AGAIN_MS = 1000;

/** Sends a decoded frame. */
export function postFrame(post: Post, take: number, frame: Frame, of: Parameters<typeof shownFrame>[1]): void {
  const shown = shownFrame(frame, of);
  const arrays = [shown.positions, shown.normals, shown.indices, ...(shown.colours ? [shown.colours] : [])];
  if (shown.views && shown.views !== 'unread') arrays.push(shown.views.texels);
  post({ kind: 'frame', take, frame: shown }, arrays.map((array) => array.buffer));
}

export const errorMessage = (take: number, error: unknown): FromWorker =>
  ({ kind: 'trouble', take, text: error instanceof Error ? error.message : String(error) });

function noneWithoutFile(error: unknown): FrameEntry[] {
  if (error instanceof NoSuchFile) return [];
  throw error;
}

/**
 * Shows the requested frames of a take, or of a single file. A new request replaces an older one that has not started. Fetches and
 * decodes in the thread of its caller, a worker. Without a deadline, requests of the server that may succeed later (Unavailable) are
 * repeated every second.
 */
export class TakeWork {
  private wanted = -1;
  private shown = -1;
  private busy = false;
  private readonly requests = new AbortController();
  private sequence: TakeSequence | null = null;
  private pulses: number[] = [];
  private readonly motion: MotionWork;

  /** `url`: its mesh.v3d, beside which motion.v3d may lie. Of a single motion file, its own URL. */
  constructor(
    private readonly wasm: () => Promise<WebAssembly.Module>,
    private readonly post: Post,
    private readonly take: number,
    private readonly url: string,
    private readonly deadlineMs = Infinity,
  ) {
    this.motion = new MotionWork(wasm, take, post, () => this.showAgain(), deadlineMs);
  }

  /** Opens a take: its meshes, or without meshes its tracked surfaces. */
  async open(): Promise<void> {
    if (this.deadlineMs !== Infinity) return this.openOnce();
    await repeated(() => this.openOnce(), () => this.ended, (error) => this.post(errorMessage(this.take, error)));
  }

  private isTemporary(error: unknown): boolean {
    return error instanceof Unavailable && this.deadlineMs === Infinity;
  }

  private async openOnce(): Promise<void> {
    const source = new HttpSource(this.url, this.deadlineMs, this.requests.signal);
    this.isAlone = false;
    const entries = await readEntries(source, (part) => this.scans(part)).catch(noneWithoutFile);
    if (this.ended) return;
    if (entries.length > 0) {
      this.pulses = entries.map(({ pulse }) => pulse);
      this.sequence = new TakeSequence(new Decoder(await this.wasm()), new FrameStore(source, entries));
    } else {
      await this.openTracked();
    }
    this.begin();
  }

  /** Opens a single motion file. */
  async openMotion(): Promise<void> {
    this.pulses = await this.motion.openAlone(this.url);
    this.begin();
  }

  /** Reports a scan after its first request. Returns false to end it. */
  private scans(part: number): boolean {
    if (part > 0 && !this.ended) this.post({ kind: 'scan', take: this.take, part });
    return !this.ended;
  }

  private begin(): void {
    this.opened = true;
    const tracked = this.sequence === null;
    this.post({ kind: 'opened', take: this.take, pulses: this.pulses, tracked, segments: tracked ? this.motion.segments : [] });
    if (this.wanted >= 0) this.want(this.wanted);
  }
  private opened = false;

  /** Opens motion.v3d beside the missing meshes. */
  private async openTracked(): Promise<void> {
    const url = new URL('motion.v3d', this.url).href;
    this.isAlone = true;
    this.pulses = await this.motion.openAlone(url).catch((error) => {
      throw error instanceof NoSuchFile ? new Error('This take has no meshes yet.') : error;
    });
    if (this.pulses.length === 0) throw new Error('This take has no meshes, and motion.v3d has no surface.');
  }

  want(frame: number): void {
    this.wanted = frame;
    this.failed = null;
    this.start();
  }

  private start(): void {
    if (!this.busy && this.opened) void this.work();
  }

  /** Shows tracked surfaces from this file; null: meshes. */
  setMotion(url: string | null): void {
    if (!this.isAlone) void this.motion.open(url); // else the same file, of which a second opening would end the first
  }
  /** Without meshes, the tracked surfaces are the take. */
  private isAlone = false;

  setPoints(points: TrailPoint[]): void {
    this.motion.points = points;
    this.showAgain();
  }

  /** Whether the views of cameras are decoded from the next frame on; a shown frame whose views were not is shown again. */
  wantViews(wanted: boolean): void {
    this.viewsWanted = wanted;
    if (wanted && this.unread) this.showAgain();
  }
  private viewsWanted = false;
  /** The last frame has views that were not decoded. */
  private unread = false;

  private get ended(): boolean {
    return this.requests.signal.aborted;
  }

  /** Ends its requests, too: a browser has few connections to a server, for all its pages together. */
  end(): void {
    this.requests.abort();
    clearTimeout(this.again);
    this.motion.end();
  }

  /** Shows the wanted frame again, after it is decoded or at once. */
  private showAgain(): void {
    this.stale = true;
    if (this.wanted >= 0) this.start();
  }
  private stale = false;

  private async work(): Promise<void> {
    this.busy = true;
    while ((this.shown !== this.wanted || this.stale) && !this.ended) {
      const { wanted } = this;
      this.stale = false;
      try {
        await this.show(wanted);
        this.failed = null;
      } catch (error) {
        this.fail(wanted, error);
      }
      this.shown = wanted; // a request that came meanwhile is the next
    }
    this.busy = false;
  }

  private async show(wanted: number): Promise<void> {
    const { sequence } = this;
    const isTracked = await this.motion.show(wanted, this.pulses[wanted], () => this.ended || this.stale || this.wanted !== wanted);
    if (isTracked) return;
    if (!sequence) return this.post({ kind: 'no-surface', take: this.take, number: wanted });
    const began = performance.now();
    // In playback, the next frame is requested while this one is decoded. This one is shown, too.
    const far = () => this.ended || Math.abs(this.wanted - wanted) > 50;
    sequence.wantViews(this.viewsWanted);
    const decoded = await sequence.show(wanted, far);
    this.unread = decoded?.views === 'unread';
    if (!decoded || this.ended) return;
    const decodeMs = performance.now() - began;
    postFrame(this.post, this.take, decoded.frame, { number: wanted, bytes: decoded.bytes, decodeMs, live: null, views: decoded.views });
  }

  /** Reports that a frame cannot be shown, once while it is tried again. */
  private fail(frame: number, error: unknown): void {
    if (this.ended) return;
    if (this.failed !== frame) this.post(errorMessage(this.take, error));
    this.failed = frame;
    clearTimeout(this.again);
    if (!this.isTemporary(error)) return;
    this.again = setTimeout(() => this.failed === frame && this.wanted === frame && this.showAgain(), AGAIN_MS);
  }
  /** The frame that could not be shown, until another one is requested or shown. */
  private failed: number | null = null;
  private again: ReturnType<typeof setTimeout> | undefined;
}
