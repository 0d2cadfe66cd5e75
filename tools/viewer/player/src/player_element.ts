// The web component <v3d-player>.
import { Box3, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { watchContext } from './context_loss';
import { PlayerControls } from './player_controls';
import { VolumePlayer } from './volume_player';

/** Vertical field of view, degrees. */
const FOV = 40;
/** A browser that gives the picture back does so within a second or two. */
const CONTEXT_LOST_MS = 5000;
const CONTEXT_LOST = 'The graphics card has lost the picture; expected it back within 5 s: reload the page.';
const FORWARDED = ['loadedmetadata', 'play', 'pause', 'timeupdate', 'ended', 'autoplayblocked', 'error'] as const;

/** Canvas, camera and light-free scene of a player. */
class PlayerStage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(FOV, 1, 0.02, 200);
  private readonly orbit: OrbitControls;
  private changed = true;
  private readonly endWatch: () => void;

  /** `lost`, `restored`: called when the graphics card has lost the picture for some seconds, and has it again. Throws without WebGL 2. */
  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly player: VolumePlayer,
    lost: () => void,
    restored: () => void,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.endWatch = watchContext(canvas, CONTEXT_LOST_MS, lost, () => {
      this.redraw();
      restored();
    });
    this.scene.add(player);
    this.orbit = new OrbitControls(this.camera, canvas);
    this.orbit.enableDamping = true;
    this.orbit.addEventListener('change', () => this.redraw());
  }

  redraw(): void {
    this.changed = true;
  }

  /** Moves the camera to a distance that shows the whole surface. */
  frame(): void {
    this.player.updateMatrixWorld(true);
    const box = new Box3().setFromObject(this.player);
    if (box.isEmpty()) return;
    const middle = box.getCenter(new Vector3());
    const away = (0.55 * box.getSize(new Vector3()).length()) / Math.sin((FOV * Math.PI) / 360);
    this.camera.position.copy(middle).addScaledVector(new Vector3(0.35, 0.2, 1).normalize(), away);
    this.orbit.target.copy(middle);
    this.redraw();
  }

  render(): void {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = Math.min(devicePixelRatio, 2);
    if (this.canvas.width !== Math.floor(clientWidth * ratio) || this.canvas.height !== Math.floor(clientHeight * ratio)) {
      this.renderer.setPixelRatio(ratio);
      this.renderer.setSize(clientWidth, clientHeight, false);
      this.camera.aspect = clientWidth / Math.max(1, clientHeight);
      this.camera.updateProjectionMatrix();
      this.redraw();
    }
    this.orbit.update();
    if (!this.changed) return;
    this.changed = false;
    this.renderer.render(this.scene, this.camera);
  }

  dispose(): void {
    this.endWatch();
    this.orbit.dispose();
    this.renderer.dispose();
  }
}

/**
 * Attributes: src, autoplay, loop, controls, muted, rate, deadline (docs/player.md). Events are those of VolumePlayer, as
 * CustomEvents whose `detail` has their values.
 */
export class V3dPlayerElement extends HTMLElement {
  static readonly observedAttributes = ['src', 'loop', 'muted', 'controls'];
  /** The object of three.js; null while the element is not in a document. */
  player: VolumePlayer | null = null;
  private stage: PlayerStage | null = null;
  private controlBar: PlayerControls | null = null;
  private picture = 0;

  connectedCallback(): void {
    const number = (name: string) => (this.hasAttribute(name) ? { [name]: Number(this.getAttribute(name)) } : {});
    this.player = new VolumePlayer({ ...number('rate'), ...number('deadline') });
    this.controlBar = new PlayerControls(this.shadowRoot ?? this.attachShadow({ mode: 'open' }), this.player, () => this.start());
    this.follow(this.player);
    try {
      this.stage = new PlayerStage(
        this.controlBar.canvas, this.player, () => this.report(CONTEXT_LOST), () => this.controlBar?.clearTrouble(CONTEXT_LOST));
    } catch {
      return this.report('This browser has no WebGL 2; expected one of 2021 or later with a graphics driver that supports it.');
    }
    for (const name of V3dPlayerElement.observedAttributes) this.apply(name);
    this.turn();
  }

  disconnectedCallback(): void {
    cancelAnimationFrame(this.picture);
    this.player?.dispose();
    this.stage?.dispose();
    this.player = this.stage = null;
  }

  attributeChangedCallback(name: string): void {
    if (this.stage) this.apply(name);
  }

  /** Starts playback. Rejects when the browser requires a gesture; the player then shows a button. */
  async play(): Promise<void> {
    await this.player?.play();
  }
  pause(): void {
    this.player?.pause();
  }

  get src(): string {
    return this.getAttribute('src') ?? '';
  }
  set src(src: string) {
    this.setAttribute('src', src);
  }
  get currentTime(): number {
    return this.player?.currentTime ?? 0;
  }
  set currentTime(seconds: number) {
    this.player?.seek(seconds);
  }
  get duration(): number {
    return this.player?.duration ?? 0;
  }
  get pulse(): number {
    return this.player?.pulse ?? -1;
  }
  get paused(): boolean {
    return this.player?.paused ?? true;
  }
  get ended(): boolean {
    return this.player?.ended ?? false;
  }
  get error(): string | null {
    return this.player?.error ?? null;
  }
  get muted(): boolean {
    return this.hasAttribute('muted');
  }
  set muted(on: boolean) {
    this.toggleAttribute('muted', on);
  }
  get loop(): boolean {
    return this.hasAttribute('loop');
  }
  set loop(on: boolean) {
    this.toggleAttribute('loop', on);
  }

  private apply(name: string): void {
    const { player } = this;
    if (!player) return;
    if (name === 'loop') player.loop = this.loop;
    if (name === 'muted') player.muted = this.muted;
    if (name === 'controls') this.controlBar!.shown = this.hasAttribute('controls');
    if (name === 'src') void this.load(player);
  }

  /** Without an address the player stops and becomes empty. */
  private async load(player: VolumePlayer): Promise<void> {
    if (!this.src) {
      player.pause();
      player.dispose();
      this.stage?.redraw();
    }
    this.controlBar?.reset();
    if (!this.src) return;
    try {
      await player.load(this.src);
      if (this.hasAttribute('autoplay')) await player.play();
    } catch {
      // The events `error` and `autoplayblocked` have said so.
    }
  }

  /** For clicks: a rejection is shown by the player itself. */
  private start(): void {
    this.play().catch(() => undefined);
  }

  private follow(player: VolumePlayer): void {
    for (const name of FORWARDED) {
      player.addEventListener(name, (event) => {
        const { type, target: _, ...detail } = event as { type: string; target: unknown };
        if (name === 'loadedmetadata') this.stage?.frame();
        this.stage?.redraw();
        this.controlBar?.update(name, detail);
        this.dispatchEvent(new CustomEvent(type, { detail }));
      });
    }
  }

  private report(message: string): void {
    this.controlBar?.update('error', { message });
    this.dispatchEvent(new CustomEvent('error', { detail: { message } }));
  }

  private turn(): void {
    this.picture = requestAnimationFrame((now) => {
      this.player?.update(now);
      this.stage?.render();
      this.turn();
    });
  }
}
