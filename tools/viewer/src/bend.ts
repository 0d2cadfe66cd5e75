// Bends of joints over a range of frames, as `v3dctl edit` makes them (docs/editing.md): of the skeleton, and of the surface by
// linear blend skinning.
import { parseJson } from '../player/src/json_field';
import { aboutAxis, product, type Quaternion, rotated, rotationOf, subtreeOf } from './pose';
import { type Joint, PARTS, type Pose, type Skeleton, type Skin } from './skeleton_file';

export interface Bend {
  joint: number;
  degrees: number;
  /** Unit vector in the frame of the joint: x forward, y to the left, z along the bone. */
  axis: [number, number, number];
  /** Frames first to end - 1 of the action (editedFrames()). */
  first: number;
  end: number;
  /** Frames at both ends in which the angle grows from 0. */
  ramp: number;
}

/** The pulses of the frames that `v3dctl edit` numbers from 0: from the first to the last of each surface with a skin. */
export const editedFrames = ({ skins }: Skeleton): number[] =>
  [...new Set(skins.flatMap(({ pulses }) => consecutive(pulses)))].sort((a, b) => a - b);

/** Also the lost pulses between them. */
const consecutive = (pulses: readonly number[]): number[] =>
  pulses.length ? Array.from({ length: pulses[pulses.length - 1] - pulses[0] + 1 }, (_, n) => pulses[0] + n) : [];

/** The skin of the surface that has this pulse and this number of vertices. The later one of a shared pulse is shown. */
export function skinAt({ skins }: Skeleton, pulse: number, vertices: number): Skin | null {
  return skins.findLast((skin) => skin.vertices === vertices && skin.pulses.includes(pulse)) ?? null;
}

/** Joints whose turn moves the surface: the skin has parts of their subtree. */
export function movesSurface({ joints, skins }: Skeleton, joint: number): boolean {
  const subtree = subtreeOf(joints, joint);
  return skins.some(({ parts }) => [...parts].some((part) => subtree.has(part)));
}

/** Part of the angle at a frame, 0 to 1. */
export function shareAt({ first, end, ramp }: Bend, frame: number): number {
  if (frame < first || frame >= end) return 0;
  if (ramp === 0) return 1;
  const t = Math.min(1, Math.min(frame - first + 1, end - frame) / (ramp + 1));
  return t * t * (3 - 2 * t);
}

/** A rotation about a point. */
export interface Turn {
  centre: [number, number, number];
  rotation: Quaternion;
}

/** The turn of the joint and its descendants. */
export function turnAt(pose: Pose, bend: Bend, share: number): Turn {
  const axis = rotated(rotationOf(pose, bend.joint), bend.axis);
  const centre = [...pose.positions.subarray(3 * bend.joint, 3 * bend.joint + 3)] as Turn['centre'];
  return { centre, rotation: aboutAxis(axis, (share * bend.degrees * Math.PI) / 180) };
}

/** The pose with the joint and its descendants turned. */
export function turnedPose(pose: Pose, joints: readonly Joint[], joint: number, { centre, rotation }: Turn): Pose {
  const positions = pose.positions.slice(), rotations = pose.rotations.slice();
  for (const n of subtreeOf(joints, joint)) {
    const arm = centre.map((c, k) => pose.positions[3 * n + k] - c);
    positions.set(rotated(rotation, arm).map((c, k) => c + centre[k]), 3 * n);
    rotations.set(product(rotation, rotationOf(pose, n)), 4 * n);
  }
  return { ...pose, positions, rotations };
}

/** Positions of the vertices with the same turn: each moves by the share of its weights in the subtree of the joint. */
export function turnedSurface(
  positions: Float32Array, skin: Skin, joints: readonly Joint[], joint: number, { centre, rotation }: Turn,
): Float32Array {
  const moved = positions.slice();
  const subtree = subtreeOf(joints, joint);
  const isTurned = Array.from({ length: 256 }, (_, part) => subtree.has(part));
  const [x, y, z] = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => rotated(rotation, axis));
  for (let v = 0; v < skin.vertices; ++v) {
    let sum = 0;
    for (let k = PARTS * v; k < PARTS * (v + 1); ++k) if (isTurned[skin.joints[k]]) sum += skin.weights[k];
    if (sum === 0) continue;
    const share = sum / 255;
    const a = positions[3 * v] - centre[0], b = positions[3 * v + 1] - centre[1], c = positions[3 * v + 2] - centre[2];
    for (let k = 0; k < 3; ++k) {
      const turned = centre[k] + x[k] * a + y[k] * b + z[k] * c;
      moved[3 * v + k] += share * (turned - positions[3 * v + k]);
    }
  }
  return moved;
}

/** The operation of docs/editing.md. */
export function operationOf({ joint, degrees, axis, first, end, ramp }: Bend, joints: readonly Joint[]): Record<string, unknown> {
  const round = (value: number, digits: number) => Number(value.toFixed(digits));
  return {
    do: 'bend', joint: joints[joint].name, degrees: round(degrees, 2), axis: axis.map((c) => round(c, 4)),
    frames: [first, end], ramp,
  };
}

/** The operations of an edit file, which `v3dctl edit` has checked. Throws a message for another text. */
export function readOperations(text: string): unknown[] {
  const file = parseJson(text);
  file.expectObject(['format', 'version', 'operations']);
  if (file.at('format').text() !== 'v3d-edit') file.at('format').reject('expected "v3d-edit"');
  return file.at('operations').list().map(({ value }) => value);
}

/** An edit file. */
export function editFile(operations: readonly unknown[]): string {
  const inOneLine = (value: unknown) => JSON.stringify(value, null, 1).replace(/\n */g, ' ');
  const lines = operations.map((operation) => `    ${inOneLine(operation)}`).join(',\n');
  return `{\n  "format": "v3d-edit", "version": 1,\n  "operations": [\n${lines}\n  ]\n}\n`;
}
