// The skeletons of a take: drawn over the surface, joint angles over time, similar poses, and bends of joints.
import { AnglePlot } from './angle_plot';
import type { AuxiliaryContent } from './auxiliary_content';
import { movesSurface } from './bend';
import { BendPanel } from './bend_panel';
import { find } from './page';
import type { Playback } from '../player/src/playback';
import { SearchPace, similarPoses, turnCurves } from './pose';
import { canBend, fetchSkeletons, NO_SKELETONS, type PerformerSkeleton, type SkeletonSet } from './skeleton_set';
import type { Stage } from './stage';
import type { Transport } from './transport';
import type { ShownFrame } from '../player/src/worker_messages';

/** Similar poses are at least this far from one another, seconds. */
const APART_S = 0.5;
/** While a take plays, similar poses are sought this often at most. */
const SIMILAR_EVERY_MS = 250;
const FIRST_JOINT = 'left_elbow';

export interface SkeletonHost {
  stage: Stage;
  transport: Transport;
  auxiliary: AuxiliaryContent;
  playback(): Playback | null;
  /** Shows the last frame again. */
  redraw(): void;
  /** Is this performer visible? */
  shows(performer: number): boolean;
  /** Shows the tracked surface. */
  showMotion(): void;
}

export class SkeletonPanel {
  private folder: string | null = null;
  private skeletons: PerformerSkeleton[] = [];
  private on = false;
  private anglesOn = false;
  private similarOn = false;
  /** Number of a skeleton in the list and of a joint. */
  private chosen = { skeleton: 0, joint: 0 };
  private troubles: string[] = [];
  private shown: ShownFrame | null = null;
  private readonly bend: BendPanel;
  private readonly plot: AnglePlot;

  constructor(private readonly host: SkeletonHost) {
    this.plot = new AnglePlot(find('angles'), find('timeline'), (pulse) => host.transport.seek(pulse));
    this.bend = new BendPanel(host.stage, () => {
      this.plotDue = true; // once per refresh of the screen, because a slider sends more events
      host.redraw();
    });
    find('skeleton-on').addEventListener('click', () => this.toggle());
    find('angles-on').addEventListener('click', () => this.toggleAngles());
    find('similar-on').addEventListener('click', () => this.toggleSimilar());
    find('bend-on').addEventListener('click', () => this.toggleBend());
    const list = find<HTMLSelectElement>('joint');
    list.addEventListener('change', () => {
      const [skeleton, joint] = list.value.split(' ').map(Number);
      list.blur();
      this.choose({ skeleton, joint });
    });
    host.stage.onRay = (ray) => {
      const hit = host.stage.jointAt(ray);
      if (hit) this.choose({ ...hit, skeleton: this.drawn[hit.skeleton] });
      return hit !== null;
    };
  }

  /** To call for each opened take, with its URL; null: something else is open. */
  open(folder: string | null): void {
    this.folder = folder;
    this.shown = null;
    this.set(NO_SKELETONS);
    if (folder !== null) this.host.auxiliary.load('Skeletons', () => fetchSkeletons(folder), (skeletons) => this.set(skeletons));
  }

  private set({ skeletons, operations, troubles }: SkeletonSet): void {
    if (skeletons.length === 0 && this.folder === null) this.on = this.anglesOn = this.similarOn = false;
    this.skeletons = skeletons;
    this.troubles = troubles;
    this.bend.open(this.canBend ? skeletons[0] : null, operations);
    const joint = skeletons[0]?.joints.findIndex(({ name }) => name === FIRST_JOINT) ?? 0;
    this.chosen = { skeleton: 0, joint: Math.max(0, joint) };
    this.drawList();
    this.draw();
    this.host.redraw();
  }

  /** Draws the skeletons at the pulse of a frame. Returns the frame with the bend. */
  show(frame: ShownFrame): ShownFrame {
    this.shown = frame;
    const { chosen, host } = this;
    const result = this.bend.show(frame, this.skeletons[0]?.at.get(frame.pulse));
    this.drawn = this.skeletons.map((_, n) => n).filter((n) => this.on && this.skeletons[n].at.has(frame.pulse)
      && ((this.skeletons.length === 1 && this.skeletons[0].performer === 1) || host.shows(this.skeletons[n].performer)));
    host.stage.showSkeletons(this.drawn.map((n) => {
      const { joints, at } = this.skeletons[n];
      const pose = at.get(frame.pulse)!;
      return { joints, pose: n === 0 ? this.bend.bentPose(pose) : pose, chosen: n === chosen.skeleton ? chosen.joint : -1 };
    }));
    this.drawNote();
    return result;
  }
  private drawn: number[] = [];

  /** To call at each refresh of the screen; `now`: its time, ms. */
  turn(now: number): void {
    const playback = this.host.playback();
    if (playback !== this.playback) {
      this.playback = playback;
      this.draw();
    }
    if (this.plotDue) this.drawPlot();
    const pulse = playback?.pulse ?? -1;
    if (this.pace.isDue(pulse, playback?.playing ?? false, now)) this.drawSimilar();
    if (pulse === this.pulse) return;
    this.pulse = pulse;
    if (this.anglesOn) this.plot.setPulse(pulse);
  }
  private pulse = -1;
  private plotDue = false;
  /** Of the similar poses, which are sought among all of the take. */
  private readonly pace = new SearchPace(SIMILAR_EVERY_MS);
  private playback: Playback | null = null;

  toggle(): void {
    if (this.skeletons.length === 0) return;
    this.on = !this.on;
    this.draw();
    this.host.redraw();
  }

  toggleAngles(): void {
    if (this.skeletons.length === 0) return;
    this.anglesOn = !this.anglesOn;
    this.draw();
  }

  toggleSimilar(): void {
    if (this.skeletons.length === 0) return;
    this.similarOn = !this.similarOn;
    this.draw();
  }

  toggleBend(): void {
    const playback = this.host.playback();
    if (!this.canBend || !playback) return;
    if (this.bend.isOn) {
      this.bend.end();
    } else {
      this.on = true;
      this.host.showMotion();
      playback.playing = false;
      this.bend.begin(this.jointToBend(), playback.pulse, playback.rate);
    }
    this.draw();
    this.host.redraw();
    if (this.bend.isOn) find('skeleton').scrollIntoView({ block: 'nearest' });
  }

  private get canBend(): boolean {
    return this.troubles.length === 0 && canBend(this.skeletons[0]);
  }

  /** The chosen joint if it moves the surface, otherwise the joint before it. Chooses it, too. */
  private jointToBend(): number {
    const [skeleton] = this.skeletons;
    let joint = this.chosen.skeleton === 0 ? this.chosen.joint : 0;
    while (!movesSurface(skeleton, joint) && skeleton.joints[joint].parent >= 0) joint = skeleton.joints[joint].parent;
    this.chosen = { skeleton: 0, joint };
    return joint;
  }

  private choose(chosen: { skeleton: number; joint: number }): void {
    this.chosen = chosen;
    if (this.bend.isOn) this.bend.choose(this.jointToBend());
    this.draw();
    this.host.redraw();
  }

  private drawList(): void {
    const several = this.skeletons.length > 1;
    find('joint').replaceChildren(...this.skeletons.map(({ joints, performer }, s) => {
      const group = document.createElement('optgroup');
      group.label = several ? `Performer ${performer}` : 'Joints';
      group.append(...joints.map(({ name }, j) => new Option(name.replaceAll('_', ' '), `${s} ${j}`)));
      return group;
    }));
  }

  private draw(): void {
    find('skeleton').hidden = this.skeletons.length === 0 && this.troubles.length === 0;
    for (const [id, on] of [['skeleton-on', this.on], ['angles-on', this.anglesOn], ['similar-on', this.similarOn],
      ['bend-on', this.bend.isOn]] as const) {
      find(id).ariaPressed = String(on);
      find<HTMLButtonElement>(id).disabled = this.skeletons.length === 0;
    }
    find<HTMLButtonElement>('bend-on').disabled = !this.canBend;
    find('joint-field').hidden = this.skeletons.length === 0;
    find<HTMLSelectElement>('joint').value = `${this.chosen.skeleton} ${this.chosen.joint}`;
    this.drawPlot();
    this.drawSimilar();
    this.drawNote();
  }

  private drawPlot(): void {
    this.plotDue = false;
    const skeleton = this.skeletons[this.chosen.skeleton];
    const playback = this.host.playback();
    this.plot.shown = this.anglesOn && skeleton !== undefined && playback !== null;
    if (!this.anglesOn || !skeleton || !playback) return;
    const poses = this.chosen.skeleton === 0 ? skeleton.poses.map((pose) => this.bend.bentPose(pose)) : skeleton.poses;
    const pulses = poses.map(({ pulse }) => pulse);
    this.plot.draw({ pulses, turns: turnCurves({ ...skeleton, poses }, this.chosen.joint) }, playback.first, playback.last);
    this.plot.setPulse(playback.pulse);
    this.plot.setRange(this.bend.range);
  }

  /** Marks the poses most like that of the pulse. */
  private drawSimilar(): void {
    const skeleton = this.skeletons[this.chosen.skeleton];
    const playback = this.host.playback();
    const on = this.similarOn && skeleton && playback;
    const found = on ? similarPoses(skeleton, playback.pulse, Math.ceil(APART_S * playback.rate)) : [];
    this.similar = found.length;
    this.host.transport.mark(found.map(({ pulse, metres }, n) => ({
      pulse, strength: 1 - 0.15 * n, title: `pulse ${pulse}: ${(1000 * metres).toFixed(0)} mm from this pose`,
    })));
    this.drawNote();
  }
  private similar = 0;

  private drawNote(): void {
    const note = this.troubles.join(' ') || this.state();
    if (find('skeleton-note').textContent !== note) find('skeleton-note').textContent = note;
  }

  private state(): string {
    if (this.skeletons.length === 0) return '';
    if (this.shown && this.on && this.drawn.length === 0) return 'This pulse has no skeleton.';
    if (this.bend.isOn) return this.bend.note;
    if (this.similarOn) return this.similar ? '' : 'No other pose of the take is within 150 mm of this one.';
    if (this.on && !this.canBend) return 'To bend joints: run v3dctl track, then v3dctl skeleton.';
    return '';
  }
}
