// Plays the sound of a take in step with its pictures, by Web Audio.
import { PART_S, type Part, partOf, SoundClock } from './sound_clock';
import { sampleOf, type SoundSource, type Stereo } from './sound_file';

/** Parts are scheduled this long before they are heard, seconds. */
const AHEAD_S = 1.5;
const MAX_PARTS = 32;
/** While scrubbing, each new position is heard for so long, seconds. */
const GRAIN_S = 0.06;
/** The shortest time between the starts of two such grains, seconds. */
const GRAIN_STEP_S = 0.04;
/** Fades a grain in and out. */
const HANN = Float32Array.from({ length: 65 }, (_, n) => 0.5 - 0.5 * Math.cos((2 * Math.PI * n) / 64));

/** Events that browsers count as a gesture of the user. */
const GESTURES = ['pointerdown', 'pointerup', 'touchend', 'click', 'keydown'];

/** Reported times of which the best counts. */
const TIMES = 15;

/** The loudspeakers of the PC. Opened by the first sound, because browsers allow that after a click or key only. */
export class SoundOutput {
  private opened: AudioContext | null = null;
  private ahead: number[] = []; // of the context before the page, seconds, as reported
  /** A call of resume() is pending. Browsers keep each until they allow sound. */
  private asked = false;

  /** `gestures`: where clicks and keys arrive. After one, a browser may allow what it has not answered. */
  constructor(gestures: EventTarget = globalThis) {
    for (const gesture of GESTURES) gestures.addEventListener(gesture, () => this.asked && this.ask(), true);
  }

  get context(): AudioContext {
    return (this.opened ??= new AudioContext({ latencyHint: 'interactive' }));
  }

  /** Whether the browser allows sound; asks for it. */
  isRunning(): boolean {
    const { context } = this;
    if (context.state === 'running') return true;
    this.ahead = [];
    if (!this.asked) this.ask();
    return false;
  }

  private ask(): void {
    this.asked = true;
    const answered = () => (this.asked = false);
    this.context.resume().then(answered, answered);
  }

  /**
   * The time of the context that leaves the loudspeaker at a time of the page, milliseconds. A busy PC reports times late,
   * never early: the earliest of the last reports counts.
   */
  heardAt(now: number): number {
    this.ahead.push(this.reportedAhead());
    if (this.ahead.length > TIMES) this.ahead.shift();
    return Math.max(...this.ahead) + now / 1000;
  }

  private reportedAhead(): number {
    const { context } = this;
    const { contextTime, performanceTime } = context.getOutputTimestamp();
    if (contextTime && performanceTime) return contextTime - performanceTime / 1000;
    return context.currentTime - (context.outputLatency || context.baseLatency) - performance.now() / 1000;
  }
}

/** What a playback does at the moment. */
export interface Played {
  /** Position, with its fraction. */
  exact: number;
  playing: boolean;
  speed: number;
  /** The last pulse that is heard. */
  outPulse: number;
  /** A new position is heard shortly while it does not play. */
  scrubbing?: boolean;
}

/** `failed`: it plays, but without the parts that cannot be read. */
export type SoundState = 'none' | 'off' | 'muted' | 'blocked' | 'playing' | 'failed';

/** The sound of one take. Silent at another speed than 1, and while paused, except for new positions while scrubbing. */
export class SoundPlayer {
  state: SoundState = 'none';
  /** Of the samples, 1: as recorded. */
  gain = 1;
  private readonly clock: SoundClock;
  private readonly playing = new Set<AudioBufferSourceNode>();
  private readonly parts = new Map<string, Promise<AudioBuffer | null>>(); // the last used is last
  private next = 0; // the first pulse that is not scheduled
  private started = 0;
  private readonly failures = new Map<string, string>(); // by file, until a part of it can be read
  private ended = false;
  private position: number | null = null; // of the last picture
  private scrubbed: number | null = null; // the last position that was heard, or need not be
  private nextGrain = 0; // on the clock of the context, seconds

  /** `trouble` gets the errors of all files, '' when there is none. */
  constructor(
    private readonly output: SoundOutput,
    private readonly sources: SoundSource[],
    /** Pulses per second. */
    private readonly rate: number,
    private readonly trouble: (text: string) => void,
  ) {
    this.clock = new SoundClock(rate);
  }

  /** To call for every picture. The playback is at its position at `now`, on the clock of the page, milliseconds. */
  follow(played: Played, now: number): void {
    this.state = this.stateFor(played);
    const { exact } = played;
    this.position = exact;
    if (this.state !== 'playing') {
      this.stop();
      return this.scrub(played);
    }
    this.scrubbed = exact;
    if (this.clock.follow(exact, this.output.heardAt(now))) {
      this.silence();
      this.next = exact;
      ++this.started;
    }
    while (this.next <= played.outPulse && this.clock.timeOf(this.next) < this.output.context.currentTime + AHEAD_S) {
      this.next = this.schedule(this.next, played.outPulse + 1);
    }
    if (this.failures.size) this.state = 'failed';
  }

  end(): void {
    this.stop();
    if (this.failures.size) this.trouble('');
    this.ended = true;
  }

  private stateFor(played: Played): SoundState {
    if (this.sources.length === 0) return 'none';
    if (!played.playing) return 'off';
    if (played.speed !== 1) return 'muted';
    return this.output.isRunning() ? 'playing' : 'blocked';
  }

  /** Plays a grain of the sound where the position is a new one. */
  private scrub({ exact, playing, scrubbing }: Played): void {
    if (playing || !scrubbing || this.scrubbed === null || this.sources.length === 0) {
      this.scrubbed = exact;
      return;
    }
    if (exact === this.scrubbed || !this.output.isRunning()) return;
    const { currentTime } = this.output.context;
    if (currentTime < this.nextGrain) return; // a later picture plays it
    this.nextGrain = currentTime + GRAIN_STEP_S;
    this.scrubbed = exact;
    this.playGrain(exact);
  }

  /** Plays the sound from a pulse on, at most to the end of its part. */
  private playGrain(from: number): void {
    const pulses = PART_S * this.rate;
    const index = Math.floor(from / pulses + 1e-9);
    const to = Math.min(from + GRAIN_S * this.rate, (index + 1) * pulses);
    this.useParts(index, from, to, (buffer, part) => {
      if (from === this.position && this.scrubbed === from) this.play(buffer, part, this.output.context.currentTime, HANN);
    });
  }

  /** Calls `use` for each file with the buffer of a part and the pulses [from, to) in it, when the buffer is there. */
  private useParts(index: number, from: number, to: number, use: (buffer: AudioBuffer, part: Part) => void): void {
    const pulses = PART_S * this.rate;
    for (const [n, { file }] of this.sources.entries()) {
      const sampleAt = (pulse: number) => sampleOf(file.map, pulse);
      const whole = partOf(file, sampleAt, index * pulses, (index + 1) * pulses, this.rate);
      const part = partOf(file, sampleAt, from, to, this.rate);
      if (!whole || !part) continue;
      const offset_s = part.offset_s + (part.first - whole.first) / file.rate_hz;
      void this.buffer(n, index, whole).then((buffer) => buffer && use(buffer, { ...part, offset_s }));
    }
  }

  /** Plays the pulses from `from` on, up to the end of their part. Returns the end. */
  private schedule(from: number, limit: number): number {
    const pulses = PART_S * this.rate;
    const index = Math.floor(from / pulses + 1e-9);
    const to = Math.min(limit, (index + 1) * pulses);
    const run = this.started;
    this.useParts(index, from, to, (buffer, part) => {
      if (run === this.started && this.clock.anchor) this.play(buffer, part, this.clock.timeOf(from));
    });
    return to;
  }

  /** `fade`: the curve of the gain over the part; otherwise constant. */
  private play(buffer: AudioBuffer, part: Part, at: number, fade?: Float32Array<ArrayBuffer>): void {
    const { context } = this.output;
    const late = Math.max(0, context.currentTime - at);
    const seconds = part.seconds - late * part.speed;
    if (seconds <= 0) return;
    const source = new AudioBufferSourceNode(context, { buffer, playbackRate: part.speed });
    const gain = new GainNode(context, { gain: fade ? 0 : this.gain });
    if (fade) gain.gain.setValueCurveAtTime(fade.map((value) => value * this.gain), at + late, seconds / part.speed);
    source.connect(gain).connect(context.destination);
    source.start(at + late, part.offset_s + late * part.speed, seconds);
    source.onended = () => this.playing.delete(source);
    this.playing.add(source);
  }

  private buffer(n: number, index: number, part: Part): Promise<AudioBuffer | null> {
    const key = `${n} ${index}`;
    const known = this.parts.get(key);
    const buffer = known ?? this.read(this.sources[n], part);
    this.parts.delete(key);
    this.parts.set(key, buffer);
    // After a failure, the next use of the part reads it again.
    void buffer.then((read) => read === null && this.parts.get(key) === buffer && this.parts.delete(key));
    if (this.parts.size > MAX_PARTS) this.parts.delete(this.parts.keys().next().value!);
    return buffer;
  }

  private async read(source: SoundSource, part: Part): Promise<AudioBuffer | null> {
    try {
      const stereo: Stereo = await source.read(part.first, part.end);
      const buffer = new AudioBuffer({ numberOfChannels: 2, length: stereo.left.length, sampleRate: source.file.rate_hz });
      buffer.copyToChannel(stereo.left, 0);
      buffer.copyToChannel(stereo.right, 1);
      this.report(source.file.file, '');
      return buffer;
    } catch (error) {
      this.report(source.file.file, `${source.file.file}: ${(error as Error).message}`);
      return null;
    }
  }

  private report(file: string, failure: string): void {
    if (this.ended || (this.failures.get(file) ?? '') === failure) return;
    if (failure) this.failures.set(file, failure);
    else this.failures.delete(file);
    this.trouble([...this.failures.values()].join('\n'));
  }

  private silence(): void {
    for (const source of this.playing) source.stop();
    this.playing.clear();
  }

  private stop(): void {
    if (!this.clock.anchor) return;
    this.silence();
    this.clock.stop();
    ++this.started;
  }
}
