// Reader of skeleton.json (docs/skeleton.md): joints, poses, and the skin of tracked surfaces.
import { type Field, MAX_METRES, parseJson } from '../player/src/json_field';

/** Largest file that the page reads, bytes. */
export const MAX_SKELETON_BYTES = 128 << 20;
const MAX_JOINTS = 255;
/** Limits of motion.v3d (docs/motion-format.md). */
const MAX_VERTICES = 524_288;
/**
 * Frames from the first to the last pulse of each skin, summed over all skins: 11 hours at 25 a second. The page has an entry for each
 * (editedFrames()), and two pulses of a damaged file may lie 10^15 apart.
 */
const MAX_SKIN_FRAMES = 1_000_000;
/** Parts that move a vertex. */
export const PARTS = 4;

export interface Joint {
  name: string;
  /** Number of the parent, which is smaller; -1: none. */
  parent: number;
}

/** A skeleton at a pulse. World, metres. */
export interface Pose {
  pulse: number;
  /** x, y, z of each joint. */
  positions: Float64Array;
  /** w, x, y, z of each joint: unit quaternions from the frame of the joint to the world. */
  rotations: Float64Array;
  /** 0 to 1, of each joint. */
  confidences: Float64Array;
}

/** Weights of the vertices of a tracked surface, for linear blend skinning. */
export interface Skin {
  pulses: number[];
  vertices: number;
  /** Four joints of each vertex, and their weights with the sum 255. */
  joints: Uint8Array;
  weights: Uint8Array;
  /** Joints with a weight. */
  parts: Set<number>;
}

export interface Skeleton {
  joints: Joint[];
  /** Of increasing pulses. */
  poses: Pose[];
  skins: Skin[];
}

/** Parses the file. The message of a thrown error names the field and the expected value. */
export function parseSkeleton(text: string): Skeleton {
  const file = parseJson(text);
  file.expectObject(['format', 'version', 'rate_hz', 'stature_m', 'joints', 'pulses', 'skins']);
  if (file.at('format').text() !== 'v3d-skeleton') file.at('format').reject('expected "v3d-skeleton"');
  file.at('version').number(1, 1);
  const joints = readJoints(file.at('joints'));
  return { joints, poses: readPoses(file.at('pulses'), joints.length), skins: readSkins(file.find('skins'), joints.length) };
}

function readJoints(field: Field): Joint[] {
  const joints: Joint[] = [];
  for (const entry of field.list()) {
    entry.expectObject(['name', 'parent', 'bone_m']);
    const parent = entry.at('parent');
    const at = joints.findIndex(({ name }) => name === parent.value);
    if (at < 0 && parent.value !== null) parent.reject('expected the name of a joint before this one, or null');
    const name = entry.at('name').text();
    if (joints.some((joint) => joint.name === name)) entry.at('name').reject('expected a name that no other joint has');
    joints.push({ name, parent: at });
  }
  if (joints.length < 1 || joints.length > MAX_JOINTS) field.reject(`expected 1 to ${MAX_JOINTS} joints`);
  return joints;
}

/** One list of `size` numbers for each joint. */
function readRows(field: Field, joints: number, size: number, limit: number): Float64Array {
  const rows = field.list();
  if (rows.length !== joints) field.reject(`expected an entry for each of the ${joints} joints`);
  const values = new Float64Array(joints * size);
  rows.forEach((row, n) => values.set(row.numbers(size, -limit, limit), n * size));
  return values;
}

function readRotations(field: Field, joints: number): Float64Array {
  const values = readRows(field, joints, 4, 2);
  for (let at = 0; at < values.length; at += 4) {
    const length = Math.hypot(...values.subarray(at, at + 4));
    if (Math.abs(length - 1) > 0.01) field.reject('expected unit quaternions');
    for (let k = at; k < at + 4; ++k) values[k] /= length;
  }
  return values;
}

function readPoses(field: Field, joints: number): Pose[] {
  let last = -1;
  return field.list().map((entry) => {
    entry.expectObject(['pulse', 'positions', 'rotations', 'confidences']);
    const pulse = entry.at('pulse').pulse();
    if (pulse <= last) entry.at('pulse').reject('expected a later pulse than the one before');
    last = pulse;
    return {
      pulse,
      positions: readRows(entry.at('positions'), joints, 3, MAX_METRES),
      rotations: readRotations(entry.at('rotations'), joints),
      confidences: Float64Array.from(entry.at('confidences').numbers(joints, 0, 1)),
    };
  });
}

function readSkins(field: Field | null, joints: number): Skin[] {
  let frames = 0;
  return (field?.list() ?? []).map((entry) => {
    entry.expectObject(['pulses', 'vertices', 'weights']);
    const vertices = entry.at('vertices').number(0, MAX_VERTICES);
    const pulses = entry.at('pulses').list().map((pulse) => pulse.pulse());
    if (pulses.length === 0) entry.at('pulses').reject('expected at least one pulse');
    frames += Math.max(0, pulses[pulses.length - 1] - pulses[0]) + 1;
    if (frames > MAX_SKIN_FRAMES) entry.at('pulses').reject(`expected at most ${MAX_SKIN_FRAMES} frames in all skins`);
    return { pulses, vertices, ...readWeights(entry.at('weights'), vertices, joints) };
  });
}

function readWeights(field: Field, vertices: number, count: number): Pick<Skin, 'joints' | 'weights' | 'parts'> {
  const bytes = bytesOf(field);
  if (bytes.length !== 2 * PARTS * vertices) field.reject(`expected ${2 * PARTS} bytes for each vertex`);
  const joints = new Uint8Array(PARTS * vertices), weights = new Uint8Array(PARTS * vertices);
  const parts = new Set<number>();
  for (let v = 0; v < vertices; ++v) {
    const at = 2 * PARTS * v;
    joints.set(bytes.subarray(at, at + PARTS), PARTS * v);
    weights.set(bytes.subarray(at + PARTS, at + 2 * PARTS), PARTS * v);
    let sum = 0;
    for (let k = PARTS * v; k < PARTS * (v + 1); ++k) {
      if (joints[k] >= count) field.reject(`vertex ${v} has joint ${joints[k]}, but there are ${count}`);
      if (weights[k] > 0) parts.add(joints[k]);
      sum += weights[k];
    }
    if (sum !== 255) field.reject(`vertex ${v} has weights with the sum ${sum}; expected 255`);
  }
  return { joints, weights, parts };
}

function bytesOf(field: Field): Uint8Array {
  try {
    return Uint8Array.from(atob(field.text()), (digit) => digit.charCodeAt(0));
  } catch {
    return field.reject('expected base64');
  }
}
