// Skeletons over the surface: a line for each bone and a dot for each joint. Colours tell left from right, opacity is the
// confidence.
import { BufferGeometry, Color, Float32BufferAttribute, Group, type InterleavedBufferAttribute, Points, PointsMaterial, type Ray, Vector3 } from 'three';
import { Line2 } from 'three/addons/lines/Line2.js';
import { LineGeometry } from 'three/addons/lines/LineGeometry.js';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import type { Joint, Pose } from './skeleton_file';
import { roundPoints } from './trails';

const LEFT = new Color(0x4fb4ff), RIGHT = new Color(0xff8a4a), MIDDLE = new Color(0xf4f6f8), PROP = new Color(0xd6e34d);
const CHOSEN = new Color(0xffffff);
/** Opacity of confidence 0; confidence 1 is opaque. */
const FAINTEST = 0.2;
const BONE_PX = 4;
const JOINT_PX = 9, CHOSEN_PX = 16;
/** Radius of a click, as part of the distance from the viewpoint. */
const REACH = 0.011;

function colourOf({ name }: Joint): Color {
  if (name.startsWith('left_')) return LEFT;
  if (name.startsWith('right_')) return RIGHT;
  return name.startsWith('prop_') ? PROP : MIDDLE;
}

const opacity = (confidence: number) => FAINTEST + (1 - FAINTEST) * confidence;
const positionOf = ({ positions }: Pose, joint: number) => new Vector3().fromArray(positions, 3 * joint);

export interface DrawnSkeleton {
  joints: readonly Joint[];
  pose: Pose;
  /** Number of the chosen joint; -1: none. */
  chosen: number;
}

export class SkeletonOverlay {
  readonly group = new Group();
  private readonly bones: Line2[] = [];
  private readonly dots = new Points(new BufferGeometry(),
    new PointsMaterial({ size: JOINT_PX, sizeAttenuation: false, vertexColors: true, depthTest: false, transparent: true }));
  private readonly mark = new Points(new BufferGeometry(),
    new PointsMaterial({ size: CHOSEN_PX, sizeAttenuation: false, color: CHOSEN, depthTest: false, transparent: true, opacity: 0.85 }));
  private drawn: DrawnSkeleton[] = [];

  constructor() {
    for (const [points, order] of [[this.mark, 3], [this.dots, 4]] as const) {
      roundPoints(points.material);
      points.frustumCulled = false;
      points.renderOrder = order;
    }
    this.group.add(this.mark, this.dots);
  }

  show(skeletons: DrawnSkeleton[]): void {
    this.drawn = skeletons;
    const positions: number[] = [], colours: number[] = [], chosen: number[] = [];
    let used = 0;
    for (const { joints, pose, chosen: mark } of skeletons) {
      joints.forEach((joint, n) => {
        positions.push(...positionOf(pose, n).toArray());
        colours.push(...colourOf(joint).toArray(), opacity(pose.confidences[n]));
        if (n === mark) chosen.push(...positionOf(pose, n).toArray());
        if (joint.parent >= 0) this.drawBone(used++, pose, joint, n);
      });
    }
    for (let n = used; n < this.bones.length; ++n) this.bones[n].visible = false;
    setPoints(this.dots, positions, colours);
    setPoints(this.mark, chosen, null);
  }

  private drawBone(number: number, pose: Pose, joint: Joint, n: number): void {
    const bone = this.bones[number] ?? this.addBone();
    const ends = [positionOf(pose, joint.parent), positionOf(pose, n)];
    setEnds(bone.geometry, ends.flatMap((end) => end.toArray()));
    bone.material.color.copy(colourOf(joint));
    bone.material.opacity = opacity(Math.min(pose.confidences[n], pose.confidences[joint.parent]));
    bone.visible = true;
  }

  private addBone(): Line2 {
    const material = new LineMaterial({ linewidth: BONE_PX, depthTest: false, transparent: true });
    const bone = new Line2(new LineGeometry(), material);
    bone.frustumCulled = false;
    bone.renderOrder = 2;
    this.bones.push(bone);
    this.group.add(bone);
    return bone;
  }

  /** The joint at a ray: one whose dot is there, otherwise the one that turns the bone there. */
  jointAt(ray: Ray): { skeleton: number; joint: number } | null {
    let best: { skeleton: number; joint: number } | null = null, least = 1;
    /** Distance from the ray, where 1 is the reach of a click. */
    const consider = (skeleton: number, joint: number, at: Vector3, away: number) => {
      const reach = away / (REACH * at.distanceTo(ray.origin));
      if (reach < least) [best, least] = [{ skeleton, joint }, reach];
    };
    this.drawn.forEach(({ joints, pose }, skeleton) => joints.forEach((joint, n) => {
      const at = positionOf(pose, n);
      consider(skeleton, n, at, 0.5 * ray.distanceToPoint(at)); // dots come before lines
      if (joint.parent < 0) return;
      const onBone = new Vector3();
      const squared = ray.distanceSqToSegment(positionOf(pose, joint.parent), at, undefined, onBone);
      consider(skeleton, joint.parent, onBone, Math.sqrt(squared));
    }));
    return best;
  }
}

/** Moves a line of two points in its buffer. A new one for each picture would stay on the graphics card until a garbage collection. */
function setEnds(geometry: LineGeometry, ends: number[]): void {
  const known = geometry.getAttribute('instanceStart') as InterleavedBufferAttribute | undefined;
  if (!known) {
    geometry.setPositions(ends);
    return;
  }
  known.data.set(ends);
  known.data.needsUpdate = true;
}

function setPoints(points: Points<BufferGeometry, PointsMaterial>, positions: number[], colours: number[] | null): void {
  points.geometry.dispose();
  points.geometry = new BufferGeometry();
  points.geometry.setAttribute('position', new Float32BufferAttribute(positions, 3));
  if (colours) points.geometry.setAttribute('color', new Float32BufferAttribute(colours, 4));
  points.visible = positions.length > 0;
}
