// The sound of the open take or scene, and the button that switches it.
import type { AuxiliaryContent } from './auxiliary_content';
import type { Composition } from './composition';
import { press } from './page';
import type { Playback } from '../player/src/playback';
import { fetchSound } from './sound_file';
import { SoundOutput, SoundPlayer } from './sound_player';
import type { Take } from './take_list';

export class SoundControl {
  readonly output = new SoundOutput();
  private player: SoundPlayer | null = null;
  private on = true;

  constructor(
    private readonly button: HTMLElement,
    private readonly canvas: HTMLElement,
    private readonly auxiliary: AuxiliaryContent,
    private readonly trouble: (text: string) => void,
  ) {
    button.addEventListener('click', () => this.toggle());
  }

  /** The sound of a take; null for a scene, whose takes have their own, and for live meshes. */
  open(take: Take | null): void {
    this.player?.end();
    this.player = null;
    this.button.hidden = true;
    this.button.dataset.state = '';
    if (!take) return;
    this.auxiliary.load('Sound', () => fetchSound(take.name), (sources) => {
      if (sources.length === 0) return;
      this.player = new SoundPlayer(this.output, sources, take.rate_hz, this.trouble);
      this.button.hidden = false;
    });
  }

  toggle(): void {
    this.on = !this.on;
    press(this.button, this.on);
  }

  /** `now`: the time of the page, ms. */
  follow(playback: Playback, composition: Composition | null, now: number): void {
    const { exact, speed, outPulse } = playback;
    const playing = playback.playing && this.on;
    if (composition) {
      this.button.hidden = !composition.hasSound;
      composition.playSound(exact / playback.rate, playing, speed, now);
    }
    if (!this.player) return;
    this.player.follow({ exact, playing, speed, outPulse, scrubbing: this.on && !playback.playing }, now);
    this.button.dataset.state = this.player.state;
    this.canvas.dataset.sound = this.player.state; // for the browser tests, as is the position
    this.canvas.dataset.position = `${now} ${exact}`;
  }
}
