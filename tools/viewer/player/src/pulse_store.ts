// Cache of data of single pulses. The latest request is fetched first; data that arrives too late is dropped.

import { Unavailable } from './byte_source';

/** Pause after a failed request. It doubles while requests of the same pulse fail, up to the longest one, unless the server is busy. */
const AGAIN_MS = 1000, MAX_AGAIN_MS = 30_000;

export interface PulseStoreOptions<T> {
  /** Null: the pulse has no data. Rejects when this is unknown at the moment. `signal`: the store has ended. */
  fetch(pulse: number, signal: AbortSignal): Promise<T | null>;
  /** Called when data of a pulse has arrived. */
  ready(pulse: number): void;
  /** Called for data that is dropped. */
  dispose?(thing: T): void;
  /** Maximum numbers of stored pulses and of concurrent requests. */
  keep?: number;
  atOnce?: number;
}

export class PulseStore<T> {
  private readonly kept = new Map<number, T | null>(); // the last used is last
  private readonly underWay = new Set<number>();
  private wanted: number[] = [];
  private timer: ReturnType<typeof setTimeout> | undefined;
  /** The last pause; 0: the last request succeeded. */
  private pauseMs = 0;
  private readonly requests = new AbortController();
  /** Mean duration of the last requests, milliseconds. */
  tookMs = 0;
  /** Why the last request failed, which is repeated; '': it did not fail. */
  trouble = '';

  constructor(private readonly options: PulseStoreOptions<T>) {}

  /** Requests the pulse and the likely next ones. Earlier requests are cancelled. */
  want(pulse: number, ahead: number[] = []): void {
    if (pulse !== this.wanted[0]) this.shorten();
    this.wanted = [pulse, ...ahead];
    this.fetchNext();
  }

  /** Null: the pulse has no data; undefined: not fetched yet. */
  get(pulse: number): T | null | undefined {
    const thing = this.kept.get(pulse);
    if (thing === undefined) return undefined;
    this.kept.delete(pulse);
    this.kept.set(pulse, thing);
    return thing;
  }

  private get ended(): boolean {
    return this.requests.signal.aborted;
  }

  end(): void {
    this.requests.abort();
    clearTimeout(this.timer);
    this.wanted = [];
    for (const pulse of [...this.kept.keys()]) this.drop(pulse);
  }

  private fetchNext(): void {
    while (!this.ended && this.timer === undefined && this.underWay.size < (this.options.atOnce ?? 2)) {
      const next = this.wanted.find((pulse) => !this.kept.has(pulse) && !this.underWay.has(pulse));
      if (next === undefined) return;
      void this.fetch(next);
    }
  }

  private async fetch(pulse: number): Promise<void> {
    this.underWay.add(pulse);
    const began = performance.now();
    try {
      const thing = await this.options.fetch(pulse, this.requests.signal);
      const took = performance.now() - began;
      this.tookMs = this.tookMs ? 0.7 * this.tookMs + 0.3 * took : took;
      this.trouble = '';
      this.pauseMs = 0;
      this.keep(pulse, thing);
    } catch (error) {
      this.trouble = (error as Error).message;
      if (this.timer === undefined) this.pause(error instanceof Unavailable ? AGAIN_MS : Math.min(2 * this.pauseMs, MAX_AGAIN_MS));
    }
    this.underWay.delete(pulse);
    this.fetchNext();
  }

  private keep(pulse: number, thing: T | null): void {
    if (this.ended || !this.wanted.includes(pulse)) {
      if (thing !== null) this.options.dispose?.(thing);
      return;
    }
    this.kept.set(pulse, thing);
    const oldest = [...this.kept.keys()].filter((other) => !this.wanted.includes(other));
    while (this.kept.size > (this.options.keep ?? 8) && oldest.length) this.drop(oldest.shift()!);
    this.options.ready(pulse);
  }

  private drop(pulse: number): void {
    const thing = this.kept.get(pulse);
    this.kept.delete(pulse);
    if (thing) this.options.dispose?.(thing);
  }

  private pause(ms: number): void {
    if (this.ended) return;
    this.pauseMs = Math.max(ms, AGAIN_MS);
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      this.timer = undefined;
      this.fetchNext();
    }, this.pauseMs);
  }

  /** Another pulse does not wait for the repeated requests of the last one. */
  private shorten(): void {
    if (this.timer !== undefined && this.pauseMs > AGAIN_MS) this.pause(AGAIN_MS);
  }
}
