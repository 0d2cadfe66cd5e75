// What belongs to single pulses of a take and is fetched: what is wanted last comes first, what comes too late is dropped.

/** Not to ask without a pause where nobody answers. */
const AGAIN_MS = 1000;

export interface PulseStoreOptions<T> {
  /** Null: there is none of this pulse. Rejects where nobody can tell at the moment. */
  fetch(pulse: number): Promise<T | null>;
  /** Something of a pulse has come. */
  ready(pulse: number): void;
  /** What is no longer kept. */
  dispose?(thing: T): void;
  /** So many are kept, and so many fetched at a time. */
  keep?: number;
  atOnce?: number;
}

export class PulseStore<T> {
  private readonly kept = new Map<number, T | null>(); // what was used last is last
  private readonly underWay = new Set<number>();
  private wanted: number[] = [];
  private resting = false;
  private ended = false;
  /** How long the last took, milliseconds; the mean of some. */
  tookMs = 0;

  constructor(private readonly options: PulseStoreOptions<T>) {}

  /** The pulse, and those that may be wanted next; what was wanted before is not any more. */
  want(pulse: number, ahead: number[] = []): void {
    this.wanted = [pulse, ...ahead];
    this.fetchNext();
  }

  /** Null: there is none; undefined: it is not here. */
  get(pulse: number): T | null | undefined {
    const thing = this.kept.get(pulse);
    if (thing === undefined) return undefined;
    this.kept.delete(pulse);
    this.kept.set(pulse, thing);
    return thing;
  }

  end(): void {
    this.ended = true;
    this.wanted = [];
    for (const pulse of [...this.kept.keys()]) this.drop(pulse);
  }

  private fetchNext(): void {
    while (!this.ended && !this.resting && this.underWay.size < (this.options.atOnce ?? 2)) {
      const next = this.wanted.find((pulse) => !this.kept.has(pulse) && !this.underWay.has(pulse));
      if (next === undefined) return;
      void this.fetch(next);
    }
  }

  private async fetch(pulse: number): Promise<void> {
    this.underWay.add(pulse);
    const began = performance.now();
    try {
      const thing = await this.options.fetch(pulse);
      const took = performance.now() - began;
      this.tookMs = this.tookMs ? 0.7 * this.tookMs + 0.3 * took : took;
      this.keep(pulse, thing);
    } catch {
      this.rest();
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

  private rest(): void {
    this.resting = true;
    setTimeout(() => {
      this.resting = false;
      this.fetchNext();
    }, AGAIN_MS);
  }
}

/** The bytes at that address; null for 404. Throws for anything else. */
export async function fetchThere(url: string): Promise<Response | null> {
  const answer = await fetch(url);
  if (answer.status === 404) return null;
  if (!answer.ok) throw new Error(`The server answered ${answer.status}.`);
  return answer;
}
