// The form of a bend: which turn of the chosen joint, by how much, when; and its operation as an edit file.
import { type Bend, editedFrames, editFile, operationOf, shareAt, skinAt, turnAt, turnedPose, turnedSurface } from './bend';
import { download, find } from './page';
import { aboutAxis, type Quaternion, rotationOf, TURNS } from './pose';
import type { Pose, Skeleton } from './skeleton_file';
import type { Stage } from './stage';
import { vertexNormals } from '../player/src/surface';
import type { ShownFrame } from '../player/src/worker_messages';

const input = (id: string) => find<HTMLInputElement>(id);

/** Half of the range of a new bend, and its ramp, seconds. */
const HALF_S = 0.5, RAMP_S = 0.25;
const OTHER_AXIS = 'other';

/** A turn as an axis and an angle of at most 180 degrees; the largest component of the axis is positive. */
function axisAndDegrees([w, x, y, z]: Quaternion): { axis: Bend['axis']; degrees: number } {
  const length = Math.hypot(x, y, z);
  if (length < 1e-9) return { axis: [0, 1, 0], degrees: 0 };
  const largest = [x, y, z].reduce((a, b) => (Math.abs(b) > Math.abs(a) ? b : a));
  const sign = Math.sign(largest);
  const degrees = (sign * 2 * Math.atan2(length, w) * 180) / Math.PI;
  return { axis: [x, y, z].map((c) => (sign * c) / length) as Bend['axis'], degrees: degrees - 360 * Math.round(degrees / 360) };
}

export class BendPanel {
  private on = false;
  private skeleton: Skeleton | null = null;
  private frames: number[] = [];
  /** Frames by pulse. */
  private frameAt = new Map<number, number>();
  private bend: Bend | null = null;
  /** Operations of an edited take. */
  private before: readonly unknown[] | null = null;
  private canShow = true;

  /** `changed`: the surface has to be shown again. */
  constructor(private readonly stage: Stage, private readonly changed: () => void) {
    find('bend-axis').replaceChildren(...TURNS.map(({ name }, n) => new Option(name, String(n))), new Option('another axis', OTHER_AXIS));
    input('bend-degrees').addEventListener('input', () => this.change({ degrees: Number(input('bend-degrees').value) }));
    input('bend-degrees').addEventListener('change', () => input('bend-degrees').blur()); // keys act on the page again
    find('bend-axis').addEventListener('change', () => this.setAxis());
    for (const id of ['bend-from', 'bend-to', 'bend-ramp']) input(id).addEventListener('change', () => this.setTimes());
    find('bend-reset').addEventListener('click', () => this.change({ degrees: 0 }));
    find('bend-save').addEventListener('click', () => download(new Blob([this.text()], { type: 'application/json' }), 'edit.json'));
    stage.handle.onTurn = (turn) => this.change(axisAndDegrees(turn));
  }

  /** To call for each opened take: its skeleton with a skin, null without one; and the operations of an edited take. */
  open(skeleton: Skeleton | null, before: readonly unknown[] | null): void {
    this.end();
    this.skeleton = skeleton;
    this.before = before;
    this.frames = skeleton ? editedFrames(skeleton) : [];
    this.frameAt = new Map(this.frames.map((pulse, frame) => [pulse, frame]));
  }

  get isOn(): boolean {
    return this.on;
  }

  /** Begins to bend a joint around a pulse. */
  begin(joint: number, pulse: number, rate: number): void {
    const at = Math.max(0, this.frames.findIndex((frame) => frame >= pulse));
    const half = Math.max(1, Math.round(HALF_S * rate));
    this.on = true;
    this.bend = {
      joint, degrees: 0, axis: [...TURNS[0].axis], first: Math.max(0, at - half), end: Math.min(this.frames.length, at + half + 1),
      ramp: Math.round(RAMP_S * rate),
    };
    this.draw();
  }

  /** Another joint begins without a turn. */
  choose(joint: number): void {
    if (this.bend && joint !== this.bend.joint) this.change({ joint, degrees: 0 });
  }

  end(): void {
    this.on = false;
    this.bend = null;
    this.stage.handle.hide();
    this.draw();
  }

  /** The first and last pulse of the bend; null: nothing is bent. */
  get range(): [number, number] | null {
    return this.bend && [this.frames[this.bend.first], this.frames[this.bend.end - 1]];
  }

  /** The pose with the bend. */
  bentPose(pose: Pose): Pose {
    const share = this.shareAt(pose.pulse);
    if (!this.bend || !this.skeleton || share === 0) return pose;
    return turnedPose(pose, this.skeleton.joints, this.bend.joint, turnAt(pose, this.bend, share));
  }

  /** What the user can do. */
  get note(): string {
    if (!this.canShow) return 'This pulse has no surface that can be bent.';
    const take = this.before === null ? 'this take' : 'the take that this one was made from';
    return `Drag a ring or the slider. v3dctl edit applies the saved file to ${take}.`;
  }

  /** The frame with the bend, and the rings at its joint. `pose`: at its pulse, without the bend. */
  show(frame: ShownFrame, pose: Pose | undefined): ShownFrame {
    const { bend, skeleton } = this;
    const skin = skeleton && frame.tracked ? skinAt(skeleton, frame.pulse, frame.positions.length / 3) : null;
    this.canShow = skin !== null && pose !== undefined;
    if (!bend || !skeleton || !pose || !skin) {
      this.stage.handle.hide();
      return frame;
    }
    const at = pose.positions.subarray(3 * bend.joint, 3 * bend.joint + 3);
    this.stage.handle.show([...at], rotationOf(pose, bend.joint), aboutAxis(bend.axis, (bend.degrees * Math.PI) / 180));
    const share = this.shareAt(frame.pulse);
    if (share === 0 || bend.degrees === 0) return frame;
    const turn = turnAt(pose, bend, share);
    const positions = turnedSurface(frame.positions, skin, skeleton.joints, bend.joint, turn);
    return { ...frame, positions, normals: vertexNormals(positions, frame.indices) };
  }

  private shareAt(pulse: number): number {
    const frame = this.frameAt.get(pulse);
    return this.bend && frame !== undefined ? shareAt(this.bend, frame) : 0;
  }

  /** The edit file with the bend. */
  private text(): string {
    return this.bend && this.skeleton ? editFile([...(this.before ?? []), operationOf(this.bend, this.skeleton.joints)]) : '';
  }

  private change(to: Partial<Bend>): void {
    if (!this.bend) return;
    this.bend = { ...this.bend, ...to };
    this.draw();
    this.changed();
  }

  private setAxis(): void {
    const { value } = find<HTMLSelectElement>('bend-axis');
    find('bend-axis').blur();
    if (value !== OTHER_AXIS) this.change({ axis: [...TURNS[Number(value)].axis] });
    else this.draw();
  }

  private setTimes(): void {
    const frameAt = (id: string) => {
      const next = this.frames.findIndex((frame) => frame >= Number(input(id).value));
      return next < 0 ? this.frames.length - 1 : next;
    };
    const first = frameAt('bend-from');
    const ramp = Math.max(0, Math.round(Number(input('bend-ramp').value) || 0));
    this.change({ first, end: Math.max(first, frameAt('bend-to')) + 1, ramp });
  }

  private draw(): void {
    find('bend').hidden = !this.on;
    if (!this.bend || !this.range) return;
    const { axis, degrees, ramp } = this.bend;
    const known = TURNS.findIndex((turn) => turn.axis.every((c, k) => Math.abs(c - axis[k]) < 1e-3));
    find<HTMLSelectElement>('bend-axis').value = known < 0 ? OTHER_AXIS : String(known);
    input('bend-degrees').value = String(Math.round(degrees));
    find('bend-angle').textContent = `${degrees.toFixed(0)}°`;
    [input('bend-from').value, input('bend-to').value] = this.range.map(String);
    input('bend-ramp').value = String(ramp);
    find('bend-text').textContent = this.text();
    find<HTMLButtonElement>('bend-save').disabled = degrees === 0;
  }
}
