// The texture video of a delivery: its pictures with their numbers, its sound, and its clock.
import { lineOf } from './clip';
import type { Manifest, VideoChoice } from './manifest';

/** A picture of the video that can be uploaded as a texture. */
export type Picture = VideoFrame | HTMLVideoElement;

export function closePicture(picture: Picture | null): void {
  if (picture && !(picture instanceof HTMLVideoElement)) picture.close();
}

/** Seeking goes this far beyond the start of a picture, seconds, so that rounded times name the right picture. */
const INSIDE_S = 0.001;

/** The first video that the browser plays; null: none. */
export function chooseVideo(videos: readonly VideoChoice[], canPlay: (type: string) => string): VideoChoice | null {
  return videos.find(({ type }) => canPlay(type) === 'probably') ?? videos.find(({ type }) => canPlay(type) !== '') ?? null;
}

/** Number of the picture at a media time, which is that of its start or a little later. */
export const pictureAt = (seconds: number, rate: number, pictures: number) =>
  Math.min(pictures - 1, Math.max(0, Math.floor(seconds * rate + 0.01)));

const ANNOUNCES_PICTURES = 'HTMLVideoElement' in globalThis && 'requestVideoFrameCallback' in HTMLVideoElement.prototype;

export interface VideoEvents {
  /** A picture is current. The receiver closes it. */
  picture(picture: Picture, number: number): void;
  ended(): void;
  failed(text: string): void;
}

export class VideoFrames {
  readonly video = document.createElement('video');
  private watchdog: ReturnType<typeof setTimeout> | undefined;
  private last = -1;
  private disposed = false;

  constructor(
    url: string,
    private readonly file: string,
    private readonly manifest: Manifest,
    private readonly deadlineMs: number,
    private readonly events: VideoEvents,
  ) {
    const { video } = this;
    video.crossOrigin = 'anonymous';
    video.playsInline = true;
    video.preload = 'auto';
    video.addEventListener('error', () => this.fail(this.errorText()));
    video.addEventListener('loadedmetadata', () => this.check());
    for (const name of ['waiting', 'seeking'] as const) video.addEventListener(name, () => this.watch());
    for (const name of ['playing', 'timeupdate', 'pause'] as const) video.addEventListener(name, () => this.unwatch());
    for (const name of ['loadeddata', 'seeked'] as const) {
      video.addEventListener(name, () => {
        this.unwatch();
        this.show(video.currentTime);
      });
    }
    video.addEventListener('ended', () => this.onEnd());
    this.watch();
    this.follow();
    video.src = url;
  }

  /** Number of the picture at the position of the video. */
  get number(): number {
    return pictureAt(this.video.currentTime, this.manifest.rate, this.manifest.pulses);
  }

  seek(picture: number): void {
    this.video.currentTime = picture / this.manifest.rate + INSIDE_S;
  }

  /** To call for every picture of the screen: follows the video in browsers that do not announce its pictures. */
  update(): void {
    if (!ANNOUNCES_PICTURES && this.number !== this.last) this.show(this.video.currentTime);
  }

  dispose(): void {
    this.disposed = true;
    this.unwatch();
    this.video.removeAttribute('src');
    this.video.load();
  }

  private follow(): void {
    const { video } = this;
    if (!ANNOUNCES_PICTURES) return;
    video.requestVideoFrameCallback((_now, { mediaTime }) => {
      if (this.disposed) return;
      this.show(mediaTime);
      this.follow();
    });
  }

  /** Passes the current picture on. A VideoFrame states its own time, which is that of its pixels; else `seconds` is. */
  private show(seconds: number): void {
    const { video, manifest } = this;
    if (this.disposed || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) return;
    const frame = 'VideoFrame' in window ? new VideoFrame(video) : null;
    const number = pictureAt(frame ? frame.timestamp / 1e6 : seconds, manifest.rate, manifest.pulses);
    this.last = number;
    this.events.picture(frame ?? video, number);
  }

  private check(): void {
    const { video, manifest } = this;
    const expected = manifest.pulses / manifest.rate;
    if (video.videoWidth !== manifest.side || video.videoHeight !== manifest.side) {
      return this.fail(`has pictures of ${video.videoWidth}x${video.videoHeight}; expected ${manifest.side}x${manifest.side}, the side in the manifest`);
    }
    if (Math.abs(video.duration - expected) > 1.5 / manifest.rate) this.fail(this.shortText(video.duration));
  }

  private shortText(seconds: number): string {
    const { pulses, rate } = this.manifest;
    return `lasts ${seconds.toFixed(2)} s; expected ${(pulses / rate).toFixed(2)} s, ${pulses} pulses at ${rate} Hz`;
  }

  /** A truncated file ends before its last picture. After a seek, the position is no longer that of the end. */
  private onEnd(): void {
    this.unwatch();
    if (this.video.ended && this.number < this.manifest.pulses - 2) return this.fail(this.shortText(this.video.currentTime));
    this.show(this.video.currentTime); // a slow screen may have left out the last picture
    this.events.ended();
  }

  private errorText(): string {
    const { error } = this.video;
    if (error?.code === MediaError.MEDIA_ERR_NETWORK) return 'cannot be fetched; expected a server that answers';
    const detail = error?.message ? ` (${error.message})` : '';
    return `cannot be played${detail}; expected the file of the delivery, whole`;
  }

  private fail(text: string): void {
    if (this.disposed) return;
    this.unwatch();
    this.video.pause();
    this.events.failed(lineOf(this.file, text, ''));
  }

  private watch(): void {
    this.unwatch();
    const late = () => this.fail(`has no picture after ${this.deadlineMs / 1000} s; expected a server that answers`);
    if (this.deadlineMs !== Infinity) this.watchdog = setTimeout(late, this.deadlineMs);
  }
  private unwatch(): void {
    clearTimeout(this.watchdog);
  }
}
