// Surfaces of a delivery, decoded before their pictures are shown.
import type { Manifest } from './manifest';
import { PulseStore } from './pulse_store';
import type { SurfaceWorker } from './surface_worker';
import type { ShownFrame } from './worker_messages';

/** Number of surfaces that are decoded in advance, and of those that are kept. */
const AHEAD = 4;
const KEPT = 10;
/** The largest number of pictures that are skipped when decoding is slow. */
const MAX_LATE = 8;

/** Surfaces by the numbers of their pictures, decoded in advance. */
export class SurfaceQueue {
  private readonly store: PulseStore<ShownFrame>;
  private asked: { picture: number; resolve(frame: ShownFrame | null): void } | null = null;
  /** Last answer of the worker, which does not send it again. */
  private last: { number: number; frame: ShownFrame | null } | null = null;

  constructor(
    private readonly worker: () => SurfaceWorker,
    /** Number of the surface of a picture in the motion file; undefined: it has none. */
    readonly numberOf: ReadonlyMap<number, number>,
    private readonly manifest: Manifest,
    ready: () => void,
  ) {
    this.store = new PulseStore({ fetch: (picture) => this.fetch(picture), ready, keep: KEPT, atOnce: 1 });
  }

  get(picture: number): ShownFrame | null | undefined {
    return this.store.get(picture);
  }

  /** Requests a picture and, in playback, the next ones. Those that would come too late are requested last. */
  want(picture: number, playing: boolean, loop: boolean): void {
    const { pulses, rate } = this.manifest;
    const isLate = playing && this.store.get(picture) === undefined;
    const late = isLate ? Math.min(MAX_LATE, Math.ceil((this.store.tookMs / 1000) * rate)) : 0;
    const count = late + 1 + (playing ? AHEAD : 0);
    const order = Array.from({ length: count }, (_, n) => picture + ((n + late) % count));
    const wanted = order.map((n) => (loop ? n % pulses : n)).filter((n) => this.numberOf.has(n));
    if (wanted.length) this.store.want(wanted[0], wanted.slice(1));
  }

  /** Answer of the worker. */
  answer(number: number, frame: ShownFrame | null): void {
    this.last = { number, frame };
    if (!this.asked || this.numberOf.get(this.asked.picture) !== number) return;
    this.asked.resolve(frame);
    this.asked = null;
  }

  end(): void {
    this.store.end();
  }

  private fetch(picture: number): Promise<ShownFrame | null> {
    const number = this.numberOf.get(picture)!;
    // It may have arrived too late for an earlier request.
    if (this.last?.number === number) return Promise.resolve(this.last.frame);
    return new Promise((resolve) => {
      this.asked = { picture, resolve };
      this.worker().want(number);
    });
  }
}
