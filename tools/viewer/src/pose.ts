// Geometry of poses: joint angles, and how alike two poses are.
import type { Joint, Pose, Skeleton } from './skeleton_file';

export type Quaternion = [number, number, number, number];

export const rotationOf = (pose: Pose, joint: number) => [...pose.rotations.subarray(4 * joint, 4 * joint + 4)] as Quaternion;

/** a b: rotates by b, then by a. Quaternions are w, x, y, z. */
export function product([aw, ax, ay, az]: Quaternion, [bw, bx, by, bz]: Quaternion): Quaternion {
  return [
    aw * bw - ax * bx - ay * by - az * bz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
  ];
}

export const inverse = ([w, x, y, z]: Quaternion): Quaternion => [w, -x, -y, -z];

export function rotated(q: Quaternion, [x, y, z]: readonly number[]): [number, number, number] {
  const [, a, b, c] = product(product(q, [0, x, y, z]), inverse(q));
  return [a, b, c];
}

/** Rotation by `radians` about a unit vector. */
export function aboutAxis([x, y, z]: readonly number[], radians: number): Quaternion {
  const sine = Math.sin(radians / 2);
  return [Math.cos(radians / 2), sine * x, sine * y, sine * z];
}

/** The numbers of a joint and its descendants. */
export function subtreeOf(joints: readonly Joint[], root: number): Set<number> {
  const subtree = new Set([root]);
  joints.forEach(({ parent }, n) => {
    if (subtree.has(parent)) subtree.add(n); // parents come first
  });
  return subtree;
}

/** The three turns of a joint against its parent, as `v3dctl edit` bends them. */
export const TURNS = [
  { name: 'bend (y)', axis: [0, 1, 0] },
  { name: 'side (x)', axis: [1, 0, 0] },
  { name: 'twist (z)', axis: [0, 0, 1] },
] as const;

/**
 * Turns of a joint against its parent, degrees, in the order of TURNS: the rotation is that about y (left), after that about x
 * (forward), after that about z (along the bone). A joint without a parent turns against the world.
 */
export function turnsOf(pose: Pose, joint: number, parent: number): [number, number, number] {
  const own = rotationOf(pose, joint);
  const [w, x, y, z] = parent < 0 ? own : product(inverse(rotationOf(pose, parent)), own);
  const sine = Math.min(1, Math.max(-1, 2 * (w * x - y * z)));
  const degrees = [
    Math.atan2(2 * (x * z + w * y), 1 - 2 * (x * x + y * y)),
    Math.asin(sine),
    Math.atan2(2 * (x * y + w * z), 1 - 2 * (x * x + z * z)),
  ].map((radians) => (radians * 180) / Math.PI);
  return degrees as [number, number, number];
}

/** turnsOf() at all poses, continuous: no value jumps by a whole turn. */
export function turnCurves({ joints, poses }: Skeleton, joint: number): [number, number, number][] {
  let last: number[] | null = null;
  return poses.map((pose) => {
    const turns = turnsOf(pose, joint, joints[joint].parent);
    const before = last ?? turns;
    last = turns.map((turn, k) => turn - 360 * Math.round((turn - before[k]) / 360));
    return last as [number, number, number];
  });
}

/**
 * Distance of two poses, metres: root mean square over the first `count` joints, after the rotation about the vertical axis and
 * the shift along the floor that make it least. The cost of a transition in docs/editing.md, for a window of one frame.
 */
export function poseDistance(a: Float64Array, b: Float64Array, count: number): number {
  let ax = 0, ay = 0, bx = 0, by = 0, along = 0, across = 0, squares = 0, heights = 0;
  for (let n = 0; n < 3 * count; n += 3) {
    ax += a[n]; ay += a[n + 1]; bx += b[n]; by += b[n + 1];
    along += a[n] * b[n] + a[n + 1] * b[n + 1];
    across += a[n + 1] * b[n] - a[n] * b[n + 1];
    squares += a[n] ** 2 + a[n + 1] ** 2 + b[n] ** 2 + b[n + 1] ** 2;
    heights += (a[n + 2] - b[n + 2]) ** 2;
  }
  along -= (ax * bx + ay * by) / count;
  across -= (ay * bx - ax * by) / count;
  squares -= (ax ** 2 + ay ** 2 + bx ** 2 + by ** 2) / count;
  return Math.sqrt(Math.max(0, heights + squares - 2 * Math.hypot(along, across)) / count);
}

export interface SimilarPose {
  pulse: number;
  /** poseDistance(). */
  metres: number;
}

/**
 * The poses most like that of a pulse, best first: at least `apart` pulses from it and from one another, at most `count`, and
 * none farther than `farthest` metres. Props do not count.
 */
export function similarPoses({ joints, poses }: Skeleton, pulse: number, apart: number, count = 5, farthest = 0.15): SimilarPose[] {
  const query = poses.find((pose) => pose.pulse === pulse);
  if (!query) return [];
  const body = joints.filter(({ name }) => !name.startsWith('prop_')).length;
  const ranked = poses.filter((pose) => Math.abs(pose.pulse - pulse) >= apart)
    .map((pose) => ({ pulse: pose.pulse, metres: poseDistance(query.positions, pose.positions, body) }))
    .filter(({ metres }) => metres <= farthest)
    .sort((a, b) => a.metres - b.metres || a.pulse - b.pulse);
  const found: SimilarPose[] = [];
  for (const pose of ranked) {
    if (found.length === count) break;
    if (found.every((other) => Math.abs(other.pulse - pose.pulse) >= apart)) found.push(pose);
  }
  return found;
}

/** When a search that depends on the pulse is due: at each other pulse, in playback at intervals. */
export class SearchPace {
  private pulse = -1;
  private at = -Infinity;

  constructor(private readonly everyMs: number) {}

  /** `now` in milliseconds. After the last pulse of a playback, it becomes due once more. */
  isDue(pulse: number, playing: boolean, now: number): boolean {
    if (pulse === this.pulse || (playing && now - this.at < this.everyMs)) return false;
    this.pulse = pulse;
    this.at = now;
    return true;
  }
}
