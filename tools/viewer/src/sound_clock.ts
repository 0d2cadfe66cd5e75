// When the sound of a take is played, and which part of it. Pure: the caller passes all times.

/** Parts of the sound that are requested and played as one, seconds. */
export const PART_S = 0.5;
/** The sound starts again when it is further than this from the picture, seconds. */
const MAX_OFFSET_S = 0.005;
/** Offsets are measured with jitter: the median of so many counts. */
const OFFSETS = 9;
/** A larger offset is a jump of the playback. */
const JUMP_S = 0.02;

/** The relation of the playback to the clock of the sound output: pulse `pulse` is heard at `at_s`. */
export interface Anchor {
  pulse: number;
  at_s: number;
}

/** Follows a playback, which runs on the clock of the page, with the sound output, which has a clock of its own. */
export class SoundClock {
  anchor: Anchor | null = null;
  private offsets: number[] = []; // of the sound behind the picture, seconds

  /** `rate`: pulses per second. */
  constructor(private readonly rate: number) {}

  stop(): void {
    this.anchor = null;
    this.offsets = [];
  }

  /**
   * The playback is at `pulse` while the sound output is at `heard_s`. Returns true when the sound must start again,
   * from `pulse` and the new anchor on.
   */
  follow(pulse: number, heard_s: number): boolean {
    const { anchor, offsets } = this;
    const offset = anchor ? (pulse - anchor.pulse) / this.rate - (heard_s - anchor.at_s) : Infinity;
    if (!anchor || Math.abs(offset) >= JUMP_S) {
      this.anchor = { pulse, at_s: heard_s };
      this.offsets = [];
      return true;
    }
    offsets.push(offset);
    if (offsets.length < OFFSETS) return false;
    const median = [...offsets].sort((a, b) => a - b)[(OFFSETS - 1) / 2];
    offsets.shift();
    if (Math.abs(median) <= MAX_OFFSET_S) return false;
    this.anchor = { pulse: anchor.pulse, at_s: anchor.at_s - median };
    this.offsets = [];
    return true;
  }

  /** The time of the sound output at which a pulse is heard. Requires an anchor. */
  timeOf(pulse: number): number {
    return this.anchor!.at_s + (pulse - this.anchor!.pulse) / this.rate;
  }
}

/**
 * A part of a file as an audio buffer is played: samples [first, end), from `offset_s` of the buffer on, at `speed`. The
 * samples before and after the file are silence.
 */
export interface Part {
  first: number;
  end: number;
  offset_s: number;
  /** Duration in the buffer, seconds. */
  seconds: number;
  /** Samples per second of the file that correspond to a second of the playback, by its rate. */
  speed: number;
}

/** No part of a sound map is steeper: a part of a damaged map would not fit into memory. */
const MAX_SPEED = 10;

/** The samples of the pulses [from, to) of a file; null where it has none. */
export function partOf(
  file: { rate_hz: number; samples: number }, sampleAt: (pulse: number) => number, from: number, to: number, rate: number,
): Part | null {
  const begin = sampleAt(from);
  const end = sampleAt(to);
  const speed = (end - begin) / file.rate_hz / ((to - from) / rate);
  if (end <= 0 || begin >= file.samples || !(speed > 0 && speed < MAX_SPEED)) return null;
  const first = Math.floor(begin);
  return { first, end: Math.ceil(end) + 1, offset_s: (begin - first) / file.rate_hz, seconds: (end - begin) / file.rate_hz, speed };
}
