// Playback position in a take. Pure: the caller passes the elapsed time.
import { entryAt } from './mesh_file';

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

/** Time is counted in pulses. A pulse without a mesh shows the previous mesh. */
export class Playback {
  playing = false;
  speed = 1;
  loop = true;
  inPulse: number;
  outPulse: number;
  private position: number;

  constructor(
    private readonly entries: readonly { pulse: number }[],
    readonly rate: number,
  ) {
    this.position = this.first;
    this.inPulse = this.first;
    this.outPulse = this.last;
  }

  /** Whether these are all its pulses. */
  isOf(pulses: readonly number[]): boolean {
    return pulses.length === this.entries.length && this.entries.every(({ pulse }, n) => pulse === pulses[n]);
  }

  get first(): number {
    return this.entries.length ? this.entries[0].pulse : 0;
  }
  get last(): number {
    return this.entries.length ? this.entries[this.entries.length - 1].pulse : 0;
  }
  get pulse(): number {
    return Math.floor(this.position);
  }
  /** The position with its fraction: pulse 2.5 is half a period after pulse 2. */
  get exact(): number {
    return this.position;
  }
  /** Number of the mesh to show. */
  get frame(): number {
    return entryAt(this.entries, this.pulse);
  }

  advance(seconds: number): void {
    if (!this.playing) return;
    const end = this.outPulse + 1;
    this.position += seconds * this.rate * this.speed;
    if (this.position < end) return;
    if (this.loop) {
      this.position = this.inPulse + ((this.position - end) % (end - this.inPulse));
    } else {
      this.position = this.outPulse;
      this.playing = false;
    }
  }

  /** Pulses of the next meshes in playback, without those that end within `seconds`; empty when paused. */
  ahead(count: number, inSeconds: number): number[] {
    if (!this.playing || this.entries.length === 0) return [];
    const step = Math.max(1, Math.round(this.speed));
    const first = Math.floor(this.position + inSeconds * this.rate * this.speed) + step;
    const span = this.outPulse + 1 - this.inPulse;
    const pulses = Array.from({ length: count }, (_, n) => first + n * step)
      .map((pulse) => (pulse <= this.outPulse ? pulse : this.loop ? this.inPulse + ((pulse - this.inPulse) % span) : this.outPulse))
      .map((pulse) => this.entries[entryAt(this.entries, pulse)].pulse);
    return [...new Set(pulses)];
  }

  toggle(): void {
    this.playing = !this.playing;
    const atEnd = this.pulse >= this.outPulse || this.pulse < this.inPulse;
    if (this.playing && atEnd) this.position = this.inPulse;
  }

  seek(pulse: number): void {
    this.position = Math.min(this.last, Math.max(this.first, Math.round(pulse)));
  }

  /** Steps by meshes, not by pulses. */
  step(meshes: number): void {
    this.playing = false;
    if (this.entries.length === 0) return;
    const n = Math.min(this.entries.length - 1, Math.max(0, this.frame + meshes));
    this.seek(this.entries[n].pulse);
  }

  setIn(): void {
    this.inPulse = this.pulse;
    if (this.outPulse < this.inPulse) this.outPulse = this.last;
  }
  setOut(): void {
    this.outPulse = this.pulse;
    if (this.inPulse > this.outPulse) this.inPulse = this.first;
  }
  clearInOut(): void {
    this.inPulse = this.first;
    this.outPulse = this.last;
  }

  faster(steps: number): void {
    const at = SPEEDS.indexOf(this.speed) + steps;
    this.speed = SPEEDS[Math.min(SPEEDS.length - 1, Math.max(0, at))];
  }
}

/** "0:12.08": minutes, seconds, pulses of the second. */
export function timeCode(pulse: number, rate: number): string {
  const seconds = Math.floor(pulse / rate);
  const rest = Math.floor(pulse - seconds * rate);
  const two = (n: number) => String(n).padStart(2, '0');
  return `${Math.floor(seconds / 60)}:${two(seconds % 60)}.${two(rest)}`;
}
