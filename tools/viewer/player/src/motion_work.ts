// The part of the worker that shows tracked surfaces of the open take.
import { NoSuchFile, Unavailable } from './byte_source';
import { fetchMotion, TrackedTake } from './motion_file';
import type { Post, SegmentShape, TrackedSegment, TrailPoint } from './worker_messages';

export class MotionWork {
  private tracked: TrackedTake | null = null;
  private segment: TrackedSegment | null = null;
  /** Ends the requests of the last opening. */
  private requests = new AbortController();
  private reported = false;
  private hasMeshes = true;
  /** Vertices whose trails are sent. */
  points: TrailPoint[] = [];

  /** `changed`: the shown frame has to be shown again. */
  constructor(
    private readonly module: () => Promise<WebAssembly.Module>,
    private readonly take: number,
    private readonly post: Post,
    private readonly changed: () => void,
    private readonly deadlineMs = Infinity,
  ) {}

  /** Segments of the open file. */
  get segments(): SegmentShape[] {
    return this.tracked?.shapes ?? [];
  }

  /** Reads the file and shows its surfaces; null: shows meshes. */
  async open(url: string | null): Promise<void> {
    const signal = this.begin();
    const obsolete = () => signal.aborted;
    this.tracked = null;
    this.segment = null;
    this.reported = false;
    try {
      const trouble = (error: unknown) => this.post({ kind: 'motion-trouble', take: this.take, text: this.textOf(error), fatal: false });
      const bytes = url === null ? null : await fetchMotion(url, signal, this.deadlineMs, trouble);
      const module = await this.module();
      if (obsolete()) return;
      if (bytes) {
        this.tracked = new TrackedTake(module, bytes);
        this.post({ kind: 'motion-opened', take: this.take });
      }
      this.changed();
    } catch (error) {
      if (!obsolete()) this.fail(error);
    }
  }

  /** Opens a take without meshes. Returns its pulses. Throws a message for the page; NoSuchFile: there is no file. */
  async openAlone(url: string): Promise<number[]> {
    this.hasMeshes = false;
    const signal = this.begin();
    try {
      const trouble = (error: unknown) => this.post({ kind: 'trouble', take: this.take, text: this.textOf(error) });
      const module = await this.module(); // first: a failure repeats all of this
      const bytes = await fetchMotion(url, signal, this.deadlineMs, trouble);
      if (!bytes) return [];
      this.tracked = new TrackedTake(module, bytes);
      return this.tracked.pulses;
    } catch (error) {
      throw error instanceof NoSuchFile || error instanceof Unavailable ? error : new Error(this.textOf(error));
    }
  }

  end(): void {
    this.requests.abort();
    this.tracked = null;
  }

  /** Ends the last opening. Returns the signal of a new one. */
  private begin(): AbortSignal {
    this.requests.abort();
    this.requests = new AbortController();
    return this.requests.signal;
  }

  /** Shows the tracked surface of a pulse, then its trails. Returns false if the mesh must be shown. */
  async show(number: number, pulse: number, obsolete: () => boolean): Promise<boolean> {
    const { tracked } = this;
    const place = tracked?.placeOf(pulse);
    if (!tracked || !place) return false;
    try {
      const isNew = this.segment?.number !== place.segment;
      const segment = isNew ? tracked.segment(place.segment) : this.segment;
      const frame = segment && tracked.frame(number, place, segment);
      if (!segment || !frame) {
        this.report();
        return false;
      }
      if (isNew) this.post({ kind: 'segment', take: this.take, segment });
      this.segment = segment;
      if (this.points.length > 0) tracked.keep(place, frame.positions.slice());
      this.post({ kind: 'frame', take: this.take, frame }, [frame.positions.buffer, frame.normals.buffer]);
      const trails = await tracked.trails(place, this.points, obsolete);
      if (tracked === this.tracked) this.post({ kind: 'trails', take: this.take, trails });
      return true;
    } catch (error) {
      this.fail(error);
      return false;
    }
  }

  /** Reports damaged pulses once. */
  private report(): void {
    if (this.reported) return;
    this.reported = true;
    const instead = this.hasMeshes ? 'shows the meshes of those pulses' : 'skips those pulses';
    const text = `motion.v3d of this take is damaged in part. The viewer ${instead}.`;
    this.post({ kind: 'motion-trouble', take: this.take, text, fatal: false });
  }

  private fail(error: unknown): void {
    this.tracked = null;
    this.post({ kind: 'motion-trouble', take: this.take, text: this.textOf(error), fatal: true });
  }

  private textOf(error: unknown): string {
    return error instanceof WebAssembly.RuntimeError ? 'The browser has too little memory for motion.v3d of this take.'
      : error instanceof RangeError ? `motion.v3d of this take is damaged.${this.hasMeshes ? ' The viewer shows the meshes.' : ''}`
      : error instanceof Error ? error.message : String(error);
  }
}
