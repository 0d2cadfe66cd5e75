// The sound of a delivery in a loop: one buffer that Web Audio repeats on its own clock, without a gap.
import { fetchFile } from './byte_source';

/** Longer sound stays in the video, because a buffer takes 0.4 MB for each second. */
export const MAX_LOOP_S = 300;
const MAX_FILE_BYTES = 256 << 20;
/** A source is started this long ahead, so that it starts at its time. */
const START_S = 0.05;

/** `sound` with exactly `samples` samples: its end is cut, or silence is added. */
export function withLength(context: BaseAudioContext, sound: AudioBuffer, samples: number): AudioBuffer {
  const exact = context.createBuffer(sound.numberOfChannels, samples, sound.sampleRate);
  for (let channel = 0; channel < sound.numberOfChannels; ++channel) {
    exact.copyToChannel(sound.getChannelData(channel).subarray(0, samples), channel);
  }
  return exact;
}

/** How much `to` is later than `from` in a loop, seconds: from minus half a loop to half a loop. */
export function loopDistance(from: number, to: number, seconds: number): number {
  const ahead = (((to - from) % seconds) + seconds) % seconds;
  return ahead > seconds / 2 ? ahead - seconds : ahead;
}

/** Repeats from time 0 to `seconds` of the file. Times are media times of the file. One thread. */
export class LoopSound {
  private readonly context = new AudioContext();
  private readonly gain = this.context.createGain();
  private buffer: Promise<AudioBuffer> | null = null;
  private source: AudioBufferSourceNode | null = null;
  /** Time of the context at which the source was at media time 0. */
  private zero = 0;

  constructor(
    private readonly url: string,
    private readonly seconds: number,
    private readonly deadlineMs: number,
  ) {
    this.gain.connect(this.context.destination);
  }

  /** Whether the sound is decoded. */
  isReady = false;

  get isPlaying(): boolean {
    return this.source !== null;
  }
  set volume(volume: number) {
    this.gain.gain.value = volume;
  }

  /** Fetches and decodes the sound, once. Throws where that is impossible. */
  load(): Promise<AudioBuffer> {
    return (this.buffer ??= this.decode());
  }

  /**
   * Plays on from the media time that `at` returns, unless `isWanted` is false by then. Requires a gesture of the user on the page.
   * Throws as load().
   */
  async play(at: () => number, isWanted: () => boolean): Promise<void> {
    const buffer = await this.load();
    const { context } = this;
    await context.resume();
    if (!isWanted()) return;
    this.stop();
    const { sampleRate } = context;
    const source = new AudioBufferSourceNode(context, { buffer, loop: true });
    source.connect(this.gain);
    // Whole samples, so that none is interpolated.
    const wait = Math.ceil(START_S * sampleRate) / sampleRate;
    const from = (Math.round((at() + wait) * sampleRate) % buffer.length) / sampleRate;
    const begin = context.currentTime + wait;
    source.start(begin, from);
    this.zero = begin - from;
    this.source = source;
  }

  stop(): void {
    this.source?.stop();
    this.source?.disconnect();
    this.source = null;
  }

  /** The media time that leaves the loudspeakers now. Requires isPlaying. */
  get currentTime(): number {
    const { context } = this;
    const heard = context.currentTime - (context.outputLatency || context.baseLatency) - this.zero;
    return ((heard % this.seconds) + this.seconds) % this.seconds;
  }

  dispose(): void {
    this.stop();
    void this.context.close();
  }

  private async decode(): Promise<AudioBuffer> {
    const { context } = this;
    const bytes = await fetchFile(this.url, MAX_FILE_BYTES, this.deadlineMs);
    const sound = await context.decodeAudioData(bytes.buffer as ArrayBuffer);
    this.isReady = true;
    return withLength(context, sound, Math.round(this.seconds * sound.sampleRate));
  }
}
