// The sound of a delivery: that of its video, or in a loop the same sound by Web Audio, which the pictures follow.
import { LoopSound, loopDistance, MAX_LOOP_S } from './loop_sound';

/** Pictures that are farther from the sound are sought; nearer ones play faster or slower. */
const MAX_DISTANCE_S = 0.5;
const MAX_RATE_CHANGE = 0.25;

/** Speed of pictures that are `late` seconds behind the sound. */
export function pictureRate(late: number, pulseSeconds: number): number {
  if (Math.abs(late) < pulseSeconds / 2) return 1;
  return 1 + Math.min(MAX_RATE_CHANGE, Math.max(-MAX_RATE_CHANGE, 2 * late));
}

export interface DeliverySoundOptions {
  video: HTMLVideoElement;
  /** Address of the video, whose sound is repeated. */
  url: string;
  /** Of one pass of the loop. */
  seconds: number;
  /** Of one picture. */
  pulseSeconds: number;
  deadlineMs: number;
}

export class DeliverySound {
  private sound: LoopSound | null = null;
  private state = { loop: false, muted: true, volume: 1, playing: false };
  private starts = 0;
  /** The sound cannot be decoded; the video keeps it. */
  private failed = false;

  constructor(private readonly options: DeliverySoundOptions) {}

  get loop(): boolean {
    return this.state.loop;
  }
  set loop(on: boolean) {
    this.set({ loop: on });
  }
  get muted(): boolean {
    return this.state.muted;
  }
  set muted(on: boolean) {
    this.set({ muted: on });
  }
  get volume(): number {
    return this.state.volume;
  }
  set volume(volume: number) {
    this.set({ volume });
  }

  /** To call when the video plays, after a gesture where the browser requires one, and when it pauses. */
  set playing(on: boolean) {
    this.set({ playing: on });
  }

  /** To call when the video continues at another media time, seconds. */
  seek(seconds: number): void {
    if (this.sound?.isPlaying) void this.start(() => seconds);
  }

  /** Media time at which pictures begin after the end of a pass, seconds. */
  get restart(): number {
    const heard = this.sound?.isPlaying ? this.sound.currentTime : 0;
    return heard < this.options.seconds / 2 ? heard : 0;
  }

  /** To call for every picture of the screen: keeps the pictures in step with the loop. */
  update(): void {
    const { video, seconds, pulseSeconds } = this.options;
    if (!this.sound?.isPlaying || video.seeking) return;
    const heard = this.sound.currentTime;
    const late = loopDistance(video.currentTime, heard, seconds);
    // The video begins the next pass by itself.
    if (Math.abs(late) > MAX_DISTANCE_S && heard > video.currentTime) video.currentTime = heard;
    else video.playbackRate = pictureRate(late, pulseSeconds);
  }

  dispose(): void {
    ++this.starts;
    this.sound?.dispose();
    this.sound = null;
    this.failed = true;
  }

  private get isLoop(): boolean {
    const { loop, muted } = this.state;
    return loop && !muted && !this.failed && this.options.seconds <= MAX_LOOP_S && 'AudioContext' in globalThis;
  }

  private set(change: Partial<typeof this.state>): void {
    const was = this.isLoop && this.state.playing;
    Object.assign(this.state, change);
    const { video, url, seconds, deadlineMs } = this.options;
    video.muted = this.state.muted;
    if (this.isLoop) {
      this.sound ??= new LoopSound(url, seconds, deadlineMs);
      this.sound.load().catch(() => this.fail());
    }
    if (this.sound) this.sound.volume = this.state.volume;
    if (this.isLoop && this.state.playing) {
      if (!was) void this.start(() => video.currentTime);
    } else {
      this.stop();
    }
    this.setVideo();
  }

  private async start(at: () => number): Promise<void> {
    const start = ++this.starts;
    try {
      await this.sound?.play(at, () => start === this.starts);
    } catch {
      this.fail();
    }
    this.setVideo();
  }

  private stop(): void {
    ++this.starts;
    this.sound?.stop();
    this.options.video.playbackRate = 1;
  }

  private fail(): void {
    this.failed = true;
    this.stop();
    this.setVideo();
  }

  /** A silent video that is not muted still waits for the gesture that the browser requires. */
  private setVideo(): void {
    this.options.video.volume = this.isLoop && (this.sound?.isReady ?? false) ? 0 : this.state.volume;
  }
}
