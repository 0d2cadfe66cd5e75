// The player as an object of three.js.
import { Object3D, type Object3DEventMap } from 'three';
import type { Clip, ClipEvents } from './clip';
import { TimedClip } from './timed_clip';
import { VolumeClip } from './volume_clip';

export interface VolumePlayerEventMap extends Object3DEventMap {
  /** Duration and first pulse are known, and the first picture is shown. */
  loadedmetadata: object;
  play: object;
  pause: object;
  /** Another pulse is shown. */
  timeupdate: { pulse: number; currentTime: number };
  ended: object;
  /** The browser allows sound only after a gesture: call play() from a click, or set muted. */
  autoplayblocked: object;
  /** Nothing further plays. One line: what, where, and what would be right. */
  error: { message: string };
}

export interface VolumePlayerOptions {
  /** Pulses per second of a mesh file or a motion file, which does not state them. Default 25. */
  rate?: number;
  /** The longest time for a response of the server and for a picture of a video, seconds. Default 30. */
  deadline?: number;
}

/** Address of the manifest of a delivery, or of a file of surfaces. A folder means its manifest.json. */
export function resolveSource(src: string, base: string): { url: string; isDelivery: boolean } {
  const url = new URL(src, base);
  if (url.protocol !== 'http:' && url.protocol !== 'https:') throw new Error(`${src}: expected an address that begins with http: or https:`);
  if (url.pathname.endsWith('/')) url.pathname += 'manifest.json';
  return { url: url.href, isDelivery: url.pathname.endsWith('.json') };
}

/**
 * Plays a delivery of `v3dctl export --format volume`, a mesh file or a motion file. Metres, y up as three.js has it; the origin
 * is that of the take. Call update() before each picture of the screen. All methods belong to the thread of the page.
 */
export class VolumePlayer extends Object3D<VolumePlayerEventMap> {
  private clip: Clip | null = null;
  private readonly upright = new Object3D();
  private loading = 0;
  private updated: number | null = null;
  private settings = { loop: false, muted: false, volume: 1 };
  private message: string | null = null;
  private hasEnded = false;

  constructor(private readonly options: VolumePlayerOptions = {}) {
    super();
    this.upright.rotation.x = -Math.PI / 2; // the take has z up
    this.add(this.upright);
  }

  /**
   * Loads a source and shows its first picture: the address of a folder with manifest.json, of a manifest, of mesh.v3d or
   * motion.v3d. Resolves after `loadedmetadata`; rejects with the message of `error`. A later call replaces the source.
   */
  async load(src: string): Promise<void> {
    const loading = ++this.loading;
    this.unload();
    const isLate = () => loading !== this.loading;
    try {
      const clip = await this.open(src, isLate);
      if (isLate()) return clip.dispose();
      Object.assign(clip, this.settings);
      this.clip = clip;
      this.upright.add(clip.mesh);
      this.dispatchEvent({ type: 'loadedmetadata' });
      this.announce();
    } catch (error) {
      if (isLate()) return;
      this.fail((error as Error).message);
      throw error;
    }
  }

  private async open(src: string, isLate: () => boolean): Promise<Clip> {
    await Promise.resolve(); // events come after the caller has added its listeners
    const { rate = 25, deadline = 30 } = this.options;
    const events: ClipEvents = {
      shown: () => isLate() || this.announce(),
      ended: () => isLate() || this.end(),
      failed: (text) => isLate() || this.fail(text),
    };
    const { url, isDelivery } = resolveSource(src, document.baseURI);
    return isDelivery ? VolumeClip.open(url, 1000 * deadline, events) : TimedClip.open(url, rate, 1000 * deadline, events);
  }

  /**
   * Starts playback, after the end from the start. Resolves when it plays. Rejects with a NotAllowedError and dispatches
   * `autoplayblocked` when the browser requires a gesture for sound.
   */
  async play(): Promise<void> {
    const { clip } = this;
    if (!clip || this.message !== null) return;
    this.hasEnded = false;
    try {
      await clip.play();
      this.dispatchEvent({ type: 'play' });
    } catch (error) {
      const { name } = error as Error;
      if (name === 'NotAllowedError') this.dispatchEvent({ type: 'autoplayblocked' });
      if (name !== 'AbortError') throw error; // pause() came first
    }
  }

  pause(): void {
    if (!this.clip || this.clip.paused) return;
    this.clip.pause();
    this.dispatchEvent({ type: 'pause' });
  }

  /** Shows the pulse at a time from the first pulse, seconds. Playback continues there. */
  seek(seconds: number): void {
    this.hasEnded = false;
    this.clip?.seek(Math.min(this.duration, Math.max(0, seconds)));
  }

  /** To call before each picture of the screen. `now`: its time, milliseconds, as requestAnimationFrame() passes it. */
  update(now = performance.now()): void {
    const seconds = this.updated === null ? 0 : Math.min(0.5, (now - this.updated) / 1000);
    this.updated = now;
    if (this.message === null) this.clip?.update(Math.max(0, seconds));
  }

  /** Seconds; 0 before `loadedmetadata`. */
  get duration(): number {
    return this.clip?.duration ?? 0;
  }
  /** Seconds from the first pulse. */
  get currentTime(): number {
    return this.clip?.currentTime ?? 0;
  }
  /** Pulse on the screen, as the take counts them; -1: none. */
  get pulse(): number {
    return this.clip?.pulse ?? -1;
  }
  get paused(): boolean {
    return this.clip?.paused ?? true;
  }
  get ended(): boolean {
    return this.hasEnded;
  }
  /** True when the source has sound. */
  get hasSound(): boolean {
    return this.clip?.hasSound ?? false;
  }
  /** Message of the last `error`; null: none. */
  get error(): string | null {
    return this.message;
  }

  get loop(): boolean {
    return this.settings.loop;
  }
  set loop(on: boolean) {
    this.set({ loop: on });
  }
  get muted(): boolean {
    return this.settings.muted;
  }
  set muted(on: boolean) {
    this.set({ muted: on });
  }
  /** 0 to 1. */
  get volume(): number {
    return this.settings.volume;
  }
  set volume(volume: number) {
    this.set({ volume: Math.min(1, Math.max(0, volume)) });
  }

  /** Ends worker and video, and frees the memory of the graphics card. Nothing is shown then; load() may follow. */
  dispose(): void {
    ++this.loading;
    this.unload();
  }

  private set(settings: Partial<typeof this.settings>): void {
    Object.assign(this.settings, settings);
    if (this.clip) Object.assign(this.clip, settings);
  }

  private unload(): void {
    this.message = null;
    this.hasEnded = false;
    this.upright.clear();
    this.clip?.dispose();
    this.clip = null;
  }

  private announce(): void {
    if (this.clip) this.dispatchEvent({ type: 'timeupdate', pulse: this.pulse, currentTime: this.currentTime });
  }

  private end(): void {
    this.hasEnded = true;
    this.dispatchEvent({ type: 'ended' });
  }

  private fail(text: string): void {
    this.message = text;
    this.dispatchEvent({ type: 'error', message: text });
  }
}
