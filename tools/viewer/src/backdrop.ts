// Background of a scene: a colour, a picture or a video that fills the screen, or a panorama of all directions.
import {
  BackSide, BoxGeometry, Color, GLSL3, LinearFilter, MathUtils, Mesh, type Scene, ShaderMaterial, SRGBColorSpace, type Texture,
  TextureLoader, VideoTexture,
} from 'three';
import { type AuxiliaryContent, repeatable } from './auxiliary_content';
import type { SceneBackground } from './scene_file';

const vertexShader = `
out vec3 direction;
void main() {
  direction = position;
  gl_Position = (projectionMatrix * viewMatrix * vec4(position + cameraPosition, 1.0)).xyww;
}`;
// No mipmaps: they would show a line at the seam of the panorama.
const fragmentShader = `
precision highp float;
uniform sampler2D sphere;
uniform float turn;
in vec3 direction;
out vec4 colour;
const float PI = 3.14159265358979;
void main() {
  vec3 d = normalize(direction);
  float azimuth = atan(d.y, d.x) - turn;
  colour = vec4(texture(sphere, vec2(fract(0.5 - azimuth / (2.0 * PI)), 1.0 - acos(clamp(d.z, -1.0, 1.0)) / PI)).rgb, 1.0);
}`;

export class Backdrop {
  private shown = '';
  /** Number of calls of clear(): what was loaded before the last one is late. */
  private cleared = 0;
  private texture: Texture | null = null;
  private video: HTMLVideoElement | null = null;
  private videoAt = 0;
  private readonly uniforms = { sphere: { value: null as Texture | null }, turn: { value: 0 } };
  private readonly sphere = new Mesh(
    new BoxGeometry(1, 1, 1),
    new ShaderMaterial({ vertexShader, fragmentShader, glslVersion: GLSL3, side: BackSide, depthWrite: false, uniforms: this.uniforms }));

  constructor(
    private readonly scene: Scene,
    private readonly changed: () => void,
    private readonly trouble: (text: string) => void,
  ) {
    this.sphere.frustumCulled = false;
    this.sphere.renderOrder = -1;
    this.sphere.visible = false;
    scene.add(this.sphere);
  }

  /** `url`: of a file named in the scene. `auxiliary` loads it. */
  set(background: SceneBackground, url: (file: string) => string, auxiliary: AuxiliaryContent): void {
    this.uniforms.turn.value = MathUtils.degToRad(background.turn_deg);
    const file = background.image || background.video || background.sphere;
    const what = `${background.colour} ${background.image && 'image'} ${background.sphere && 'sphere'} ${file && url(file)}`;
    if (what === this.shown) return this.changed();
    this.clear();
    this.shown = what;
    this.scene.background = new Color(background.colour);
    this.trouble('');
    if (file) this.load(url(file), background.video !== '', background.sphere !== '', auxiliary);
    this.changed();
  }

  private load(url: string, isVideo: boolean, isSphere: boolean, auxiliary: AuxiliaryContent): void {
    const { cleared } = this;
    const isLate = () => cleared !== this.cleared;
    const load = repeatable(() => (isVideo ? this.loadVideo(url, isLate) : this.loadPicture(url, isSphere, isLate)), url, isLate);
    auxiliary.load(`Background ${url}`, load, (done) => {
      if (done !== null || isLate()) return;
      this.trouble(isVideo ? `The background ${url} is no video that this browser plays.` : `The background ${url} is not there.`);
    });
  }

  private async loadPicture(url: string, isSphere: boolean, isLate: () => boolean): Promise<true> {
    const texture = await new TextureLoader().loadAsync(url);
    if (isLate()) {
      texture.dispose();
      return true;
    }
    texture.generateMipmaps = false;
    texture.minFilter = LinearFilter;
    this.texture = texture;
    if (isSphere) {
      this.uniforms.sphere.value = texture; // without colour conversion: the bytes are drawn unchanged
      this.sphere.visible = true;
    } else {
      texture.colorSpace = SRGBColorSpace;
      this.scene.background = texture;
    }
    this.changed();
    return true;
  }

  /** Shows a video. Rejects when it cannot be played. */
  private loadVideo(url: string, isLate: () => boolean): Promise<true> {
    this.texture?.dispose();
    const video = document.createElement('video');
    Object.assign(video, { src: url, muted: true, playsInline: true, preload: 'auto' });
    this.video = video;
    const texture = (this.texture = new VideoTexture(video));
    texture.colorSpace = SRGBColorSpace;
    this.scene.background = texture;
    const isOld = () => isLate() || this.video !== video;
    video.addEventListener('loadedmetadata', () => isOld() || this.seekVideo());
    for (const event of ['seeked', 'loadeddata']) {
      video.addEventListener(event, () => {
        if (isOld()) return;
        texture.needsUpdate = true;
        this.changed();
        this.seekVideo(); // the requested time may have changed meanwhile
      });
    }
    return new Promise((done, fail) => {
      video.addEventListener('loadeddata', () => done(true));
      video.addEventListener('error', () => fail(new Error('cannot be played')));
    });
  }

  /** Sets the time of the scene, seconds; a video shows the same time. */
  setTime(seconds: number): void {
    this.videoAt = seconds;
    this.seekVideo();
  }

  private seekVideo(): void {
    const video = this.video;
    if (!video || video.readyState < 1) return;
    const at = Math.min(this.videoAt, video.duration || 0);
    if (Math.abs(video.currentTime - at) > 0.02 && !video.seeking) video.currentTime = at;
  }

  /** Fills a screen of that aspect ratio; the picture is cropped at the sides, or above and below. */
  fit(width: number, height: number): void {
    const image = (this.video ?? this.texture?.image) as { width?: number; height?: number; videoWidth?: number; videoHeight?: number } | null;
    if (!this.texture || !image) return;
    const shape = ((image.videoWidth ?? image.width) || 1) / ((image.videoHeight ?? image.height) || 1);
    const part = shape / (width / Math.max(1, height));
    this.texture.repeat.set(Math.min(1, 1 / part), Math.min(1, part));
    this.texture.offset.set((1 - this.texture.repeat.x) / 2, (1 - this.texture.repeat.y) / 2);
  }

  clear(): void {
    this.shown = '';
    ++this.cleared;
    this.scene.background = null;
    this.sphere.visible = false;
    this.uniforms.sphere.value = null;
    this.texture?.dispose();
    this.texture = null;
    const { video } = this;
    this.video = null;
    video?.removeAttribute('src');
    video?.load(); // ends its requests
  }
}
