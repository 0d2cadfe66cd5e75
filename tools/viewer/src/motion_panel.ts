// The tracked surface of a take: its switch, its colours and its trails.
import type { AuxiliaryContent } from './auxiliary_content';
import { find } from './page';
import { isThere } from './request';
import type { Stage } from './stage';
import { completed } from '../player/src/surface';
import type { MotionMessage, ShownFrame, ToWorker, TrackedSegment, TrailPoint } from '../player/src/worker_messages';

const MAX_TRAILS = 20;

export class MotionPanel {
  private url: string | null = null;
  private on = false;
  /** The take has no meshes: tracked surfaces cannot be switched off. */
  private alone = false;
  /** True from switching it on until the file is read. */
  private reading = false;
  private frozen = false;
  private segment: TrackedSegment | null = null;
  private points: TrailPoint[] = [];
  private shown: ShownFrame | null = null;
  private trouble = '';

  /** `changed`: the shown frame has other colours. */
  constructor(
    private readonly stage: Stage,
    private readonly send: (message: ToWorker) => void,
    private readonly changed: () => void,
    private readonly auxiliary: AuxiliaryContent,
  ) {
    find('motion-on').addEventListener('click', () => this.toggle());
    find('freeze').addEventListener('click', () => this.toggleFreeze());
    find('clear-trails').addEventListener('click', () => this.setPoints([]));
    stage.onClick = (vertex) => this.addTrail(vertex);
  }

  /** To call for each opened take; null: something else is open. */
  open(url: string | null): void {
    this.url = url;
    this.on = this.reading = this.frozen = this.alone = false;
    this.segment = this.shown = null;
    this.points = [];
    this.trouble = '';
    find('motion').hidden = true;
    this.stage.showTrails([]);
    this.draw();
    if (url === null) return;
    this.auxiliary.load('motion.v3d', () => isThere(url), (there) => (find('motion').hidden = !there));
  }

  /** To call when the worker has opened the meshes of the same take again. */
  resume(): void {
    if (!this.on) return;
    this.send({ kind: 'motion', url: this.url });
    this.send({ kind: 'points', points: this.points });
  }

  /** To call for a take whose only frames are tracked surfaces; the worker has opened them. */
  setAlone(): void {
    this.on = this.alone = true;
    this.reading = false;
    find('motion').hidden = false;
    this.draw();
  }

  /** Tracked surfaces get the triangles of their segment and the wanted colours; meshes do not change. */
  complete(frame: ShownFrame): ShownFrame {
    this.shown = frame;
    const { tracked } = frame;
    if (!tracked) this.stage.showTrails([]);
    this.drawNote();
    if (!tracked || !this.segment) return frame;
    const whole = completed(frame, this.segment);
    return this.frozen ? { ...whole, colours: this.segment.colours } : whole;
  }

  onMessage(message: MotionMessage): void {
    if (message.kind === 'segment') {
      this.segment = message.segment;
      this.stage.showTrails([]);
    } else if (message.kind === 'motion-opened') {
      this.reading = false;
      this.trouble = ''; // of a request that was repeated
      this.draw();
    } else if (message.kind === 'trails') {
      const numberOf = (point: TrailPoint) => this.points.findIndex((own) => isSame(own, point));
      this.stage.showTrails(message.trails.map(({ point, path }) => ({ number: numberOf(point), path }))
        .filter(({ number }) => number >= 0));
    } else {
      this.trouble = message.text;
      if (message.fatal) this.on = this.reading = false;
      this.draw();
    }
  }

  get isOn(): boolean {
    return this.on;
  }

  toggle(): void {
    if (find('motion').hidden || this.alone) return;
    this.on = this.reading = !this.on;
    this.trouble = '';
    if (!this.on) this.setPoints([]);
    this.send({ kind: 'motion', url: this.on ? this.url : null });
    this.draw();
  }

  toggleFreeze(): void {
    if (!this.on) return;
    this.frozen = !this.frozen;
    this.draw();
    this.changed();
  }

  private addTrail(vertex: number): void {
    const segment = this.shown?.tracked?.segment;
    if (!this.on || segment === undefined || this.points.length >= MAX_TRAILS) return;
    const point = { segment, vertex };
    if (!this.points.some((own) => isSame(own, point))) this.setPoints([...this.points, point]);
  }

  private setPoints(points: TrailPoint[]): void {
    this.points = points;
    if (points.length === 0) this.stage.showTrails([]);
    this.send({ kind: 'points', points });
    this.draw();
  }

  private draw(): void {
    find('motion-on').hidden = this.alone;
    find('motion-on').ariaPressed = String(this.on);
    find('freeze').ariaPressed = String(this.frozen);
    find<HTMLButtonElement>('freeze').disabled = !this.on;
    find<HTMLButtonElement>('clear-trails').disabled = this.points.length === 0;
    this.drawNote();
  }

  private drawNote(): void {
    const note = this.trouble || (this.on ? this.state() : '');
    if (find('motion-note').textContent !== note) find('motion-note').textContent = note;
  }

  private state(): string {
    if (this.reading) return 'Reading motion.v3d …';
    if (this.shown && !this.shown.tracked) return 'This pulse has no tracked surface. The viewer shows its mesh.';
    if (this.points.length === 0) return 'Click on the surface to draw the trail of a point.';
    return `${this.points.length} of ${MAX_TRAILS} trails`;
  }
}

const isSame = (a: TrailPoint, b: TrailPoint) => a.segment === b.segment && a.vertex === b.vertex;
