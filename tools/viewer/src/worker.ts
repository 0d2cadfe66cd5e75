// Worker that fetches and decodes surfaces: those of a take in any order, or live meshes as they arrive.
import moduleUrl from 'v3d_decoder.wasm?url';
import { Decoder, type Frame } from '../../../codec/v3d_decoder.mjs';
import { HttpSource, NoSuchFile } from './byte_source';
import { type FrameEntry, FrameStore, readEntries } from './mesh_file';
import { MotionWork } from './motion_work';
import { type MeshHead, type Pong, ServerClock, splitMessage } from './message';
import { LiveQueue, shownFrame, TakeSequence } from './sequence';
import type { FromWorker, ToWorker, TrailPoint } from './worker_messages';

const RECONNECT_MS = 1000;
const PING_MS = 2000;

const wasm = WebAssembly.compileStreaming(fetch(moduleUrl));
const now = () => performance.timeOrigin + performance.now();
const post = (message: FromWorker, moved: Transferable[] = []) => self.postMessage(message, { transfer: moved });

function show(take: number, frame: Frame, of: Parameters<typeof shownFrame>[1]) {
  const shown = shownFrame(frame, of);
  const arrays = [shown.positions, shown.normals, shown.indices, ...(shown.colours ? [shown.colours] : [])];
  if (shown.views && shown.views !== 'unread') arrays.push(shown.views.texels);
  post({ kind: 'frame', take, frame: shown }, arrays.map((array) => array.buffer));
}

function noneWithoutFile(error: unknown): FrameEntry[] {
  if (error instanceof NoSuchFile) return [];
  throw error;
}

/** Shows the requested frames of a take. A new request replaces an older one that has not started. */
class TakeWork {
  private wanted = -1;
  private shown = -1;
  private busy = false;
  private ended = false;
  private sequence: TakeSequence | null = null;
  private pulses: number[] = [];
  private readonly motion: MotionWork;

  constructor(
    private readonly take: number,
    private readonly url: string,
  ) {
    this.motion = new MotionWork(wasm, take, post, () => this.showAgain());
  }

  async open(): Promise<void> {
    const source = new HttpSource(this.url);
    const entries = await readEntries(source).catch(noneWithoutFile);
    if (entries.length > 0) {
      this.pulses = entries.map(({ pulse }) => pulse);
      this.sequence = new TakeSequence(new Decoder(await wasm), new FrameStore(source, entries));
    } else {
      await this.openTracked();
    }
    this.opened = true;
    post({ kind: 'opened', take: this.take, pulses: this.pulses, tracked: this.sequence === null });
    if (this.wanted >= 0) this.want(this.wanted);
  }
  private opened = false;

  /** Opens motion.v3d beside the missing meshes. */
  private async openTracked(): Promise<void> {
    const url = new URL('motion.v3d', this.url).href;
    const { status } = await fetch(url, { method: 'HEAD', cache: 'no-cache' });
    if (status === 404) throw new Error('This take has no meshes yet.');
    this.pulses = await this.motion.openAlone(url);
    if (this.pulses.length === 0) throw new Error('This take has no meshes, and motion.v3d has no surface.');
  }

  want(frame: number): void {
    this.wanted = frame;
    if (!this.busy && this.opened) this.work().catch((error) => trouble(this.take, error));
  }

  /** Shows tracked surfaces from this file; null: meshes. */
  setMotion(url: string | null): void {
    void this.motion.open(url);
  }

  setPoints(points: TrailPoint[]): void {
    this.motion.points = points;
    this.showAgain();
  }

  end(): void {
    this.ended = true;
    this.motion.end();
  }

  viewsChanged(): void {
    if (viewsWanted && this.unread) this.showAgain();
  }
  /** The last frame has views that were not decoded. */
  private unread = false;

  /** Shows the wanted frame again, after it is decoded or at once. */
  private showAgain(): void {
    this.stale = true;
    if (this.wanted >= 0) this.want(this.wanted);
  }
  private stale = false;

  private async work(): Promise<void> {
    this.busy = true;
    try {
      while ((this.shown !== this.wanted || this.stale) && !this.ended) {
        const wanted = this.wanted;
        this.stale = false;
        const { sequence } = this;
        if (await this.motion.show(wanted, this.pulses[wanted], () => this.ended || this.stale || this.wanted !== wanted) || !sequence) {
          this.shown = wanted;
          continue;
        }
        const began = performance.now();
        // In playback, the next frame is requested while this one is decoded. This one is shown, too.
        const far = () => this.ended || Math.abs(this.wanted - wanted) > 50;
        sequence.wantViews(viewsWanted);
        const decoded = await sequence.show(wanted, far);
        this.shown = wanted;
        this.unread = decoded?.views === 'unread';
        if (!decoded || this.ended) continue;
        const decodeMs = performance.now() - began;
        show(this.take, decoded.frame, { number: wanted, bytes: decoded.bytes, decodeMs, live: null, views: decoded.views });
      }
    } finally {
      this.shown = this.wanted;
      this.busy = false;
    }
  }
}

/** Keeps the connection to the live stream and shows the newest mesh. */
class LiveWork {
  private socket: WebSocket | null = null;
  private readonly queue = new LiveQueue<MeshHead>();
  private readonly clock = new ServerClock();
  private readonly pings: number;
  private decoder: Decoder | null = null;
  private due = false;
  private ended = false;
  private last = -1;
  private skipped = 0;

  constructor(
    private readonly take: number,
    private readonly url: string,
  ) {
    this.pings = self.setInterval(() => this.ping(), PING_MS);
  }

  async open(): Promise<void> {
    this.decoder = new Decoder(await wasm);
    this.connect();
  }

  want(): void {}
  setMotion(): void {}
  setPoints(): void {}
  viewsChanged(): void {}

  end(): void {
    this.ended = true;
    clearInterval(this.pings);
    this.socket?.close();
  }

  private connect(): void {
    if (this.ended) return;
    post({ kind: 'link', take: this.take, link: 'connecting' });
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.last = -1;
      post({ kind: 'link', take: this.take, link: 'open' });
      this.ping();
    };
    socket.onmessage = (event) => this.onMessage(event.data as string | ArrayBuffer);
    socket.onclose = () => setTimeout(() => this.connect(), RECONNECT_MS);
    this.socket = socket;
  }

  private ping(): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(`ping ${Math.round(now())}`);
  }

  private onMessage(data: string | ArrayBuffer): void {
    if (typeof data === 'string') {
      const pong = JSON.parse(data) as Pong;
      if (pong.type === 'pong') this.clock.add(pong.ping, pong.now_ms, now());
      return;
    }
    const message = splitMessage<MeshHead>(data);
    if (!message) return;
    if (this.last >= 0) this.skipped += message.head.number - this.last - 1;
    this.last = message.head.number;
    this.queue.push(message);
    if (this.due) return;
    this.due = true;
    setTimeout(() => this.decode()); // after the messages that have already arrived
  }

  private decode(): void {
    this.due = false;
    if (!this.decoder || this.ended) return;
    const began = performance.now();
    const shown = this.queue.decode(this.decoder);
    const frame = shown && this.decoder.frame();
    if (!shown || !frame) return;
    const { head } = shown;
    const there = this.clock.at(now());
    const edgeMs = head.edge_ms === null || there === null ? null : head.edge_ms - there + now();
    const live = { take: head.take, missing: head.missing, edgeMs, skipped: this.skipped };
    const decodeMs = performance.now() - began;
    show(this.take, frame, { number: head.number, bytes: shown.bytes.length, decodeMs, live });
  }
}

function trouble(take: number, error: unknown): void {
  post({ kind: 'trouble', take, text: error instanceof Error ? error.message : String(error) });
}

let work: TakeWork | LiveWork | null = null;
let viewsWanted = false;

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  if (message.kind === 'want') return work?.want(message.frame);
  if (message.kind === 'motion') return work?.setMotion(message.url);
  if (message.kind === 'points') return work?.setPoints(message.points);
  if (message.kind === 'views') {
    viewsWanted = message.wanted;
    return work?.viewsChanged();
  }
  work?.end();
  work = null;
  if (message.kind === 'nothing') return;
  work = message.kind === 'take' ? new TakeWork(message.take, message.url) : new LiveWork(message.take, message.url);
  work.open().catch((error) => trouble(message.take, error));
};
