// The bar below the stage: buttons, time line, speed.
import { find } from './page';
import { type Playback, SPEEDS, timeCode } from '../player/src/playback';

export type Action = 'first' | 'back' | 'play' | 'forward' | 'in' | 'out' | 'clear' | 'loop' | 'slower' | 'faster' | 'last' | 'second-back' | 'second-on';

export class Transport {
  private readonly bar = find('transport');
  private readonly line = find('timeline');
  private readonly speed = find<HTMLSelectElement>('speed');
  private playback: Playback | null = null;

  constructor() {
    for (const button of this.bar.querySelectorAll<HTMLElement>('[data-do]')) {
      button.addEventListener('click', () => this.act(button.dataset.do as Action));
    }
    for (const speed of SPEEDS) this.speed.add(new Option(`${speed}×`, String(speed)));
    this.speed.addEventListener('change', () => {
      if (this.playback) this.playback.speed = Number(this.speed.value);
      this.speed.blur();
    });
    this.line.addEventListener('pointerdown', (event) => {
      this.line.setPointerCapture(event.pointerId);
      this.scrub(event);
    });
    this.line.addEventListener('pointermove', (event) => {
      if (event.buttons === 1) this.scrub(event);
    });
    this.set(null);
  }

  /** Sets the playback; null: none. */
  set(playback: Playback | null): void {
    this.playback = playback;
    this.bar.classList.toggle('off', playback === null);
    this.update();
  }

  act(action: Action): void {
    const p = this.playback;
    if (!p) return;
    switch (action) {
      case 'first': p.seek(p.inPulse); break;
      case 'last': p.seek(p.outPulse); break;
      case 'back': p.step(-1); break;
      case 'forward': p.step(1); break;
      case 'second-back': p.seek(p.pulse - p.rate); break;
      case 'second-on': p.seek(p.pulse + p.rate); break;
      case 'play': p.toggle(); break;
      case 'in': p.setIn(); break;
      case 'out': p.setOut(); break;
      case 'clear': p.clearInOut(); break;
      case 'loop': p.loop = !p.loop; break;
      case 'slower': p.faster(-1); break;
      case 'faster': p.faster(1); break;
    }
    this.update();
  }

  /** Marks pulses in the time line; a click on a mark jumps there. `strength`: 0 to 1. */
  mark(marks: { pulse: number; title: string; strength: number }[]): void {
    const buttons = marks.map(({ pulse, title, strength }) => {
      const button = document.createElement('button');
      button.className = 'similar';
      button.title = button.ariaLabel = title;
      button.dataset.pulse = String(pulse);
      button.style.left = `${this.part(pulse)}%`;
      button.style.opacity = String(strength);
      button.addEventListener('pointerdown', (event) => { // in playback, the mark may be gone before the click
        event.stopPropagation(); // no scrubbing
        this.seek(pulse);
      });
      button.addEventListener('click', () => this.seek(pulse)); // by a key
      return button;
    });
    for (const old of this.line.querySelectorAll('.similar')) old.remove();
    this.line.append(...buttons);
  }

  /** Pauses at a pulse; NaN: goes on. */
  seek(pulse: number): void {
    if (!this.playback || Number.isNaN(pulse)) return;
    this.playback.playing = false;
    this.playback.seek(pulse);
    this.update();
  }

  /** Place of a pulse in the time line, per cent. */
  private part(pulse: number): number {
    const p = this.playback;
    return p && p.last > p.first ? (100 * (pulse - p.first)) / (p.last - p.first) : 0;
  }

  private scrub(event: PointerEvent): void {
    const box = this.line.getBoundingClientRect();
    const p = this.playback;
    if (!p || box.width === 0) return;
    this.seek(p.first + ((event.clientX - box.left) / box.width) * (p.last - p.first));
  }

  update(): void {
    const p = this.playback;
    if (!p) return;
    const place = (selector: string, pulse: number) => {
      this.line.querySelector<HTMLElement>(selector)!.style.left = `${this.part(pulse)}%`;
    };
    place('.head', p.pulse);
    place('.in', p.inPulse);
    place('.out', p.outPulse);
    const range = this.line.querySelector<HTMLElement>('.range')!;
    range.style.left = `${this.part(p.inPulse)}%`;
    range.style.width = `${this.part(p.outPulse) - this.part(p.inPulse)}%`;
    const cut = p.inPulse !== p.first || p.outPulse !== p.last;
    for (const mark of this.line.querySelectorAll<HTMLElement>('.mark, .range')) mark.hidden = !cut;
    find('time').textContent = timeCode(p.pulse - p.first, p.rate);
    find('length').textContent = timeCode(p.last - p.first, p.rate);
    this.line.setAttribute('aria-valuemin', String(p.first));
    this.line.setAttribute('aria-valuemax', String(p.last));
    this.line.setAttribute('aria-valuenow', String(p.pulse));
    this.line.setAttribute('aria-valuetext', timeCode(p.pulse - p.first, p.rate));
    this.bar.classList.toggle('playing', p.playing);
    this.bar.querySelector('[data-do=loop]')!.setAttribute('aria-pressed', String(p.loop));
    this.speed.value = String(p.speed);
  }
}
