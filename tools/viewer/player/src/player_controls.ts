// Controls over the picture of <v3d-player>: buttons, time line, the request for a gesture, and errors.
import { timeCode } from './playback';
import type { VolumePlayer } from './volume_player';

/** Time line: steps of a second. */
const STEP_S = 0.001;

const HTML = `<style>
  :host { display: block; position: relative; aspect-ratio: 16 / 9; background: #101216; color: #e6e8ec; font: 14px system-ui, sans-serif; }
  :host([hidden]), [hidden] { display: none !important; }
  canvas { display: block; width: 100%; height: 100%; touch-action: none; }
  .bar { position: absolute; inset: auto 0 0; display: flex; gap: 8px; align-items: center; padding: 6px 10px; background: #0009; }
  .bar input { flex: 1; min-width: 40px; }
  button { font: inherit; color: inherit; background: #ffffff22; border: 0; border-radius: 4px; padding: 4px 10px; cursor: pointer; }
  .gesture { position: absolute; inset: 0; margin: auto; width: max-content; height: max-content; padding: 12px 20px; background: #000c; }
  .trouble { position: absolute; inset: 0 0 auto; margin: 0; padding: 10px; background: #5b1d1dee; overflow-wrap: anywhere; }
</style>
<canvas part="canvas"></canvas>
<button class="gesture" hidden>Play with sound</button>
<p class="trouble" role="alert" hidden></p>
<div class="bar" part="controls" hidden>
  <button class="play">Play</button>
  <input type="range" min="0" max="0" step="${STEP_S}" value="0" aria-label="Time, seconds">
  <output class="time"></output>
  <button class="sound" hidden aria-pressed="true">Sound</button>
</div>`;

export class PlayerControls {
  readonly canvas: HTMLCanvasElement;
  private readonly bar: HTMLElement;
  private readonly gesture: HTMLElement;
  private readonly trouble: HTMLElement;
  private readonly playButton: HTMLElement;
  private readonly line: HTMLInputElement;
  private readonly time: HTMLElement;
  private readonly sound: HTMLElement;

  /** `play`: called for a click that starts playback. */
  constructor(
    root: ShadowRoot,
    private readonly player: VolumePlayer,
    play: () => void,
  ) {
    root.innerHTML = HTML;
    const find = <T extends HTMLElement>(selector: string) => root.querySelector<T>(selector)!;
    this.canvas = find('canvas');
    this.bar = find('.bar');
    this.gesture = find('.gesture');
    this.trouble = find('.trouble');
    this.playButton = find('.play');
    this.line = find('input');
    this.time = find('.time');
    this.sound = find('.sound');
    this.gesture.addEventListener('click', play);
    this.playButton.addEventListener('click', () => (player.paused ? play() : player.pause()));
    this.line.addEventListener('input', () => player.seek(Number(this.line.value)));
    this.sound.addEventListener('click', () => {
      const host = root.host as HTMLElement & { muted: boolean };
      host.muted = !host.muted;
      this.sound.setAttribute('aria-pressed', String(!host.muted));
    });
  }

  set shown(on: boolean) {
    this.bar.hidden = !on;
  }

  /** To call before another source is loaded. */
  reset(): void {
    this.trouble.hidden = this.gesture.hidden = true;
    this.line.max = this.line.value = '0';
    this.time.textContent = '';
  }

  /** Removes this error, unless another one is shown. */
  clearTrouble(text: string): void {
    if (this.trouble.textContent === text) this.trouble.hidden = true;
  }

  /** Shows what an event of the player says. */
  update(event: string, detail: { message?: string }): void {
    const { player } = this;
    if (event === 'loadedmetadata') {
      this.line.max = String(player.duration);
      this.sound.hidden = !player.hasSound;
      this.sound.setAttribute('aria-pressed', String(!player.muted));
    }
    if (event === 'error') {
      this.trouble.textContent = detail.message ?? '';
      this.trouble.hidden = false;
    }
    this.gesture.hidden = event === 'play' ? true : event === 'autoplayblocked' ? false : this.gesture.hidden;
    this.line.value = String(player.currentTime);
    this.time.textContent = `${timeCode(player.currentTime * 100, 100)} / ${timeCode(player.duration * 100, 100)}`;
    this.playButton.textContent = player.paused ? 'Play' : 'Pause';
  }
}
