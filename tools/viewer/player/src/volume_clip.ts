// A delivery of v3dctl export --format volume: the surfaces of motion.v3d with the texture of a video (docs/export.md).
import { DoubleSide, Mesh, MeshBasicMaterial, SRGBColorSpace, VideoFrameTexture } from 'three';
import { fetchFile } from './byte_source';
import { type Clip, type ClipEvents, lineOf } from './clip';
import { DeliverySound } from './delivery_sound';
import { type Manifest, MAX_MANIFEST_BYTES, parseManifest } from './manifest';
import type { SegmentSurface } from './segment_file';
import { SegmentStore } from './segment_store';
import { SurfaceGeometry } from './surface_geometry';
import { SurfaceQueue } from './surface_queue';
import { SurfaceWorker } from './surface_worker';
import { chooseVideo, closePicture, type Picture, VideoFrames } from './video_frames';
import type { SegmentShape, ShownFrame } from './worker_messages';

/** Positions of the vertices of a segment's file, which seams divide. */
export function spread(positions: Float32Array, numbers: Uint32Array): Float32Array {
  const spread = new Float32Array(3 * numbers.length);
  for (let v = 0, to = 0; v < numbers.length; ++v) {
    const from = 3 * numbers[v];
    spread[to++] = positions[from];
    spread[to++] = positions[from + 1];
    spread[to++] = positions[from + 2];
  }
  return spread;
}

/** Checks that the motion file has the pulses of every segment. Returns the shapes. Throws one line. */
export function matchSegments(manifest: Manifest, shapes: readonly SegmentShape[]): SegmentShape[] {
  if (shapes.length !== manifest.segments.length) {
    throw new Error(`has ${shapes.length} segments; expected ${manifest.segments.length}, as the manifest`);
  }
  return manifest.segments.map((segment, n) => {
    const { pulses, vertices, triangles } = shapes[n];
    if (pulses[0] !== segment.firstPulse || pulses[pulses.length - 1] !== segment.lastPulse) {
      throw new Error(`segment ${n} has pulses ${pulses[0]} to ${pulses[pulses.length - 1]}; expected ${segment.firstPulse} to ${segment.lastPulse}, as the manifest`);
    }
    if ((segment.vertices ?? vertices) !== vertices || (segment.triangles ?? triangles) !== triangles) {
      throw new Error(`segment ${n} has ${vertices} vertices and ${triangles} triangles; expected ${segment.vertices} and ${segment.triangles}, as the manifest`);
    }
    return shapes[n];
  });
}

/** What open() has fetched. */
interface Opened {
  manifest: Manifest;
  video: VideoFrames;
  sound: DeliverySound;
  queue: SurfaceQueue;
  segments: SegmentStore;
}

export class VolumeClip implements Clip {
  pulse = -1;
  private readonly surface = new SurfaceGeometry();
  private readonly texture = new VideoFrameTexture();
  readonly mesh: Mesh;
  private readonly worker: SurfaceWorker;
  private opened!: Opened;
  private opening: { resolve(): void; reject(error: Error): void } | null = null;
  /** A picture of the video whose surface is not there yet, and the picture of the texture. */
  private pending: { picture: Picture; number: number } | null = null;
  private textured: Picture | null = null;
  private failure: string | null = null;
  /** The video pauses by itself at its end, also in a loop. */
  private playing = false;

  private constructor(private readonly events: ClipEvents) {
    this.texture.colorSpace = SRGBColorSpace;
    this.texture.flipY = false; // as glTF: the first row is at the coordinate 0
    this.mesh = new Mesh(this.surface.geometry, new MeshBasicMaterial({ map: this.texture, side: DoubleSide, toneMapped: false }));
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.worker = new SurfaceWorker((number, frame) => this.opened?.queue.answer(number, frame), (text) => this.fail(text));
  }

  /** Opens a delivery and shows its first picture. Throws one line. `url`: that of the manifest. */
  static async open(url: string, deadlineMs: number, events: ClipEvents): Promise<VolumeClip> {
    const clip = new VolumeClip(events);
    try {
      await clip.open(url, deadlineMs);
      return clip;
    } catch (error) {
      clip.dispose();
      throw error;
    }
  }

  private async open(url: string, deadlineMs: number): Promise<void> {
    const manifest = await this.fetchManifest(url, deadlineMs);
    const choice = chooseVideo(manifest.videos, (type) => document.createElement('video').canPlayType(type));
    if (!choice) {
      const types = manifest.videos.map(({ type }) => type).join(', ');
      throw new Error(`manifest.json: texture.videos: this browser plays none of ${types}; expected one that it plays`);
    }
    const { shapes, numberOf } = await this.openMotion(new URL(manifest.motion, url).href, manifest, deadlineMs);
    await new Promise<void>((resolve, reject) => {
      this.opening = { resolve, reject };
      const tryToShow = () => this.tryToShow();
      const failed = (text: string) => this.fail(text);
      const picture = (picture: Picture, number: number) => this.receive(picture, number);
      const file = new URL(choice.file, url).href;
      const video = new VideoFrames(file, choice.file, manifest, deadlineMs, { picture, ended: () => this.onEnd(), failed });
      const pulseSeconds = 1 / manifest.rate;
      const sound = new DeliverySound({ video: video.video, url: file, seconds: manifest.pulses * pulseSeconds, pulseSeconds, deadlineMs });
      this.opened = {
        manifest, video, sound, queue: new SurfaceQueue(() => this.worker, numberOf, manifest, tryToShow),
        segments: new SegmentStore(url, manifest.segments, shapes, deadlineMs, tryToShow, failed),
      };
      this.opened.segments.get(0);
    });
  }

  private async fetchManifest(url: string, deadlineMs: number): Promise<Manifest> {
    try {
      return parseManifest(new TextDecoder().decode(await fetchFile(url, MAX_MANIFEST_BYTES, deadlineMs)));
    } catch (error) {
      throw new Error(lineOf('manifest.json', error, 'the manifest of a delivery of v3dctl export --format volume'));
    }
  }

  /** Opens the motion file. Returns its segments, and the number of the surface of each picture that has one. */
  private async openMotion(url: string, manifest: Manifest, deadlineMs: number): Promise<{ shapes: SegmentShape[]; numberOf: Map<number, number> }> {
    try {
      const { pulses, segments } = await this.worker.open(url, 'tracked', deadlineMs);
      const numberOf = new Map(pulses.map((pulse, number) => [pulse - manifest.firstPulse, number]));
      return { shapes: matchSegments(manifest, segments), numberOf };
    } catch (error) {
      throw new Error(lineOf(manifest.motion, error, 'the motion file of the delivery, on a server with range requests'));
    }
  }

  get duration(): number {
    return this.opened.manifest.pulses / this.opened.manifest.rate;
  }
  get currentTime(): number {
    return Math.min(this.duration, this.opened.video.video.currentTime);
  }
  get paused(): boolean {
    return !this.playing;
  }
  get hasSound(): boolean {
    return this.opened.manifest.hasSound;
  }
  get loop(): boolean {
    return this.opened.sound.loop;
  }
  set loop(on: boolean) {
    this.opened.sound.loop = on;
  }
  get muted(): boolean {
    return this.opened.sound.muted;
  }
  /** A video without sound counts as muted, so that browsers let it start. */
  set muted(on: boolean) {
    this.opened.sound.muted = on || !this.hasSound;
  }
  get volume(): number {
    return this.opened.sound.volume;
  }
  set volume(volume: number) {
    this.opened.sound.volume = volume;
  }

  async play(): Promise<void> {
    this.playing = true;
    try {
      await this.opened.video.video.play();
      this.opened.sound.playing = this.playing;
    } catch (error) {
      if ((error as Error).name !== 'AbortError') this.playing = false; // otherwise pause() came first, or a seek
      throw error;
    }
  }
  pause(): void {
    this.playing = false;
    this.opened.sound.playing = false;
    this.opened.video.video.pause();
  }
  seek(seconds: number): void {
    this.opened.sound.seek(seconds);
    this.seekPicture(seconds);
  }
  private seekPicture(seconds: number): void {
    const { video, manifest } = this.opened;
    video.seek(Math.min(manifest.pulses - 1, Math.max(0, Math.floor(seconds * manifest.rate + 1e-6))));
  }

  update(): void {
    this.opened.sound.update();
    this.opened.video.update();
  }

  dispose(): void {
    this.failure ??= '';
    this.worker.end();
    this.opened?.sound.dispose();
    this.opened?.video.dispose();
    this.opened?.queue.end();
    this.opened?.segments.end();
    closePicture(this.pending?.picture ?? null);
    closePicture(this.textured);
    this.surface.dispose();
    this.texture.dispose();
    (this.mesh.material as MeshBasicMaterial).dispose();
  }

  private fail(text: string): void {
    if (this.failure !== null) return;
    this.failure = text;
    this.playing = false;
    this.opened?.sound.dispose();
    this.opened?.video.video.pause();
    if (this.opening) this.opening.reject(new Error(text));
    else this.events.failed(text);
  }

  private onEnd(): void {
    if (this.loop && this.playing) {
      this.seekPicture(this.opened.sound.restart);
      this.play().catch(() => undefined); // pause() came first
    } else {
      this.playing = false;
      this.opened.sound.playing = false;
      this.events.ended();
    }
  }

  /** A picture became current in the video. It is shown with its surface, and not before. */
  private receive(picture: Picture, number: number): void {
    closePicture(this.pending?.picture ?? null);
    this.pending = { picture, number };
    this.opened.queue.want(number, !this.paused, this.loop);
    this.tryToShow();
  }

  private tryToShow(): void {
    const { pending } = this;
    if (!pending || this.failure !== null) return;
    const { manifest, queue, segments } = this.opened;
    const pulse = manifest.firstPulse + pending.number;
    if (queue.numberOf.has(pending.number)) {
      const frame = queue.get(pending.number);
      const segment = segments.get(manifest.segments.findLastIndex(({ firstPulse }) => firstPulse <= pulse));
      if (frame === null) return this.fail(`${manifest.motion}: the surface of pulse ${pulse} is damaged; copy the file again`);
      if (!frame || !segment) return;
      this.draw(segment, frame, pending.picture);
    } else {
      this.mesh.visible = false; // a pulse without a surface
      closePicture(pending.picture);
    }
    this.pending = null;
    this.pulse = pulse;
    this.opening?.resolve();
    this.opening = null;
    this.events.shown();
  }

  /** Positions and texture of one pulse, for the next picture of the screen. */
  private draw({ numbers, coordinates, indices }: SegmentSurface, frame: ShownFrame, picture: Picture): void {
    this.surface.show(indices, {
      position: { values: spread(frame.positions, numbers), size: 3 },
      normal: { values: spread(frame.normals, numbers), size: 3 },
      uv: { values: coordinates, size: 2, normalized: true },
    });
    if (picture !== this.textured) closePicture(this.textured);
    this.textured = picture;
    this.texture.setFrame(picture);
    this.mesh.visible = true;
  }
}
