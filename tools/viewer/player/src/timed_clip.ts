// A mesh file or a motion file on the clock of the page.
import { DoubleSide, Mesh, MeshBasicMaterial } from 'three';
import { HttpSource } from './byte_source';
import { type Clip, type ClipEvents, fileNameOf, lineOf } from './clip';
import { Playback } from './playback';
import { SurfaceGeometry } from './surface_geometry';
import { SurfaceWorker } from './surface_worker';
import type { ShownFrame } from './worker_messages';

const GREY = 180;

/** Linear light of each sRGB value, 16 bits. three.js takes colours of vertices as linear. */
const LINEAR = Uint16Array.from({ length: 256 }, (_, byte) => {
  const value = byte / 255;
  return Math.round(65535 * (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4));
});

/** The kind of a file by its first bytes. */
async function kindOf(url: string, deadlineMs: number): Promise<'take' | 'tracked'> {
  const head = await new HttpSource(url, deadlineMs).read(0, 4);
  const magic = String.fromCharCode(...head);
  if (magic === 'V3DM') return 'take';
  if (magic === 'V3DT') return 'tracked';
  throw new Error('is neither a mesh file nor a motion file; expected mesh.v3d or motion.v3d of a take');
}

export class TimedClip implements Clip {
  readonly hasSound = false;
  muted = false;
  volume = 1;
  pulse = -1;
  private readonly surface = new SurfaceGeometry();
  readonly mesh = new Mesh(this.surface.geometry, new MeshBasicMaterial({ vertexColors: true, side: DoubleSide, toneMapped: false }));
  private readonly worker: SurfaceWorker;
  private playback = new Playback([], 25);
  private wanted = -1;
  private opening: { resolve(): void; reject(error: Error): void } | null = null;

  private constructor(
    private readonly file: string,
    private readonly events: ClipEvents,
  ) {
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.worker = new SurfaceWorker((number, frame) => this.show(number, frame), (text) => this.fail(text));
  }

  /** Opens the file and shows its first surface. Throws one line. `rate`: pulses per second, which the file does not state. */
  static async open(url: string, rate: number, deadlineMs: number, events: ClipEvents): Promise<TimedClip> {
    const clip = new TimedClip(fileNameOf(url), events);
    try {
      const { pulses } = await clip.worker.open(url, await kindOf(url, deadlineMs), deadlineMs);
      if (pulses.length === 0) throw new Error('has no surface; expected at least one pulse');
      clip.playback = new Playback(pulses.map((pulse) => ({ pulse })), rate);
      clip.playback.loop = false;
      await clip.showFirst();
      return clip;
    } catch (error) {
      clip.dispose();
      throw new Error(lineOf(clip.file, error, 'a mesh.v3d or motion.v3d on a server with range requests'));
    }
  }

  private showFirst(): Promise<void> {
    return new Promise((resolve, reject) => {
      this.opening = { resolve, reject };
      this.update(0);
    });
  }

  get duration(): number {
    return (this.playback.last - this.playback.first + 1) / this.playback.rate;
  }
  get currentTime(): number {
    return (this.playback.exact - this.playback.first) / this.playback.rate;
  }
  get paused(): boolean {
    return !this.playback.playing;
  }
  get loop(): boolean {
    return this.playback.loop;
  }
  set loop(on: boolean) {
    this.playback.loop = on;
  }

  play(): Promise<void> {
    if (this.paused) this.playback.toggle();
    return Promise.resolve();
  }
  pause(): void {
    this.playback.playing = false;
  }
  seek(seconds: number): void {
    this.playback.seek(this.playback.first + Math.floor(seconds * this.playback.rate + 1e-6));
  }

  update(seconds: number): void {
    const { playback } = this;
    const before = playback.playing;
    playback.advance(seconds);
    if (playback.frame !== this.wanted) {
      this.wanted = playback.frame;
      this.worker.want(this.wanted);
    }
    if (before && !playback.playing) this.events.ended();
  }

  dispose(): void {
    this.worker.end();
    this.surface.dispose();
    (this.mesh.material as MeshBasicMaterial).dispose();
  }

  private fail(text: string): void {
    this.pause();
    if (this.opening) this.opening.reject(new Error(text));
    else this.events.failed(lineOf(this.file, text, 'an undamaged file'));
  }

  private show(number: number, frame: ShownFrame | null): void {
    if (!frame) return this.fail(`surface ${number} is damaged; copy the file again`);
    const { positions, normals, indices } = frame;
    const colours = frame.colours ?? new Uint8Array(positions.length).fill(GREY);
    this.surface.show(indices, {
      position: { values: positions, size: 3 },
      normal: { values: normals, size: 3 },
      color: { values: Uint16Array.from(colours, (byte) => LINEAR[byte]), size: 3, normalized: true },
    });
    this.mesh.visible = true;
    this.pulse = frame.pulse;
    this.opening?.resolve();
    this.opening = null;
    this.events.shown();
  }
}
