// The plot of the turns of a joint over the take, above the time line and with the same time axis.
import { TURNS } from './pose';

const SVG = 'http://www.w3.org/2000/svg';
const HEIGHT = 100;
/** Smallest range of the vertical axis, degrees. */
const LEAST_RANGE = 60;

export interface Curves {
  pulses: number[];
  /** In the order of TURNS, of each pulse. */
  turns: [number, number, number][];
}

export class AnglePlot {
  private readonly svg: SVGElement;
  private readonly head: HTMLElement;
  private readonly range: HTMLElement;
  private readonly ends: HTMLElement[];
  private first = 0;
  private last = 1;

  /** `seek`: the user points at a pulse. */
  constructor(private readonly panel: HTMLElement, private readonly timeline: HTMLElement, seek: (pulse: number) => void) {
    const area = panel.querySelector<HTMLElement>('.area')!;
    this.svg = area.querySelector('svg')!;
    this.head = area.querySelector('.head')!;
    this.range = area.querySelector('.range')!;
    this.ends = [...panel.querySelectorAll<HTMLElement>('.end')];
    const follow = (event: PointerEvent) => {
      const box = area.getBoundingClientRect();
      if (box.width > 0) seek(Math.round(this.first + ((event.clientX - box.left) / box.width) * (this.last - this.first)));
    };
    area.addEventListener('pointerdown', (event) => {
      area.setPointerCapture(event.pointerId);
      follow(event);
    });
    area.addEventListener('pointermove', (event) => {
      if (event.buttons === 1) follow(event);
    });
    new ResizeObserver(() => this.align()).observe(timeline);
    panel.querySelector('.legend-of-turns')!.replaceChildren(...TURNS.map(({ name }, k) => {
      const entry = document.createElement('span');
      entry.textContent = name;
      entry.className = `turn-${k}`;
      return entry;
    }));
  }

  set shown(on: boolean) {
    this.panel.hidden = !on;
    this.align();
  }

  /** Draws curves over the pulses first to last; an axis of degrees that holds them all. */
  draw({ pulses, turns }: Curves, first: number, last: number): void {
    this.first = first;
    this.last = Math.max(last, first + 1);
    const [least, most] = extremes(turns.flat());
    const span = Math.max(LEAST_RANGE, 1.1 * (most - least));
    const [low, high] = [(least + most - span) / 2, (least + most + span) / 2];
    const y = (turn: number) => (HEIGHT * (high - turn)) / span;
    const lines = TURNS.map((_, k) => path(pulses.map((pulse, n) => [this.across(pulse), y(turns[n][k]), pulse]), `turn-${k}`));
    this.svg.replaceChildren(zeroLine(y(0)), ...lines);
    [high, low].forEach((degrees, n) => (this.ends[n].textContent = `${degrees.toFixed(0)}°`));
  }

  setPulse(pulse: number): void {
    this.head.style.left = `${this.across(pulse)}%`;
  }

  /** Marks a range of pulses; null: none. */
  setRange(range: [number, number] | null): void {
    this.range.hidden = range === null;
    if (!range) return;
    this.range.style.left = `${this.across(range[0])}%`;
    this.range.style.width = `${this.across(range[1]) - this.across(range[0])}%`;
  }

  private across(pulse: number): number {
    return (100 * (pulse - this.first)) / (this.last - this.first);
  }

  /** The time axis lies above that of the time line. */
  private align(): void {
    if (this.panel.hidden) return;
    const own = this.panel.getBoundingClientRect(), line = this.timeline.getBoundingClientRect();
    this.panel.style.setProperty('--left', `${line.left - own.left}px`);
    this.panel.style.setProperty('--right', `${own.right - line.right}px`);
  }
}

/** Smallest and largest value; 0 and 0 of none. */
function extremes(values: number[]): [number, number] {
  let [low, high] = [values[0] ?? 0, values[0] ?? 0];
  for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return [low, high];
}

/** A line through points of successive pulses, with gaps where pulses are missing. */
function path(points: [number, number, number][], look: string): SVGElement {
  const line = document.createElementNS(SVG, 'path');
  const command = ([x, y, pulse]: number[], n: number) =>
    `${n > 0 && points[n - 1][2] === pulse - 1 ? 'L' : 'M'}${x.toFixed(3)} ${y.toFixed(2)}`;
  line.setAttribute('d', points.map(command).join(''));
  line.setAttribute('class', look);
  return line;
}

function zeroLine(y: number): SVGElement {
  const line = document.createElementNS(SVG, 'path');
  line.setAttribute('d', `M0 ${y}H100`);
  line.setAttribute('class', 'zero');
  return line;
}
