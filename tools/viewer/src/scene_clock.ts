// State of a scene at a given time: the viewpoint on the camera path, and the pulse of a take. Pure. The formulas are in
// docs/scene.md; tools/v3dctl/scene/scene_file.cc has the same.
import type { CameraKey, SceneTake, Vector } from './scene_file';

const HARDLY = 1e-6;

const clamp = (n: number, low: number, high: number) => Math.min(high, Math.max(low, n));

const numbersOf = (key: CameraKey) => [...key.eye, ...key.look, key.fov_deg];
const keyOf = (at_s: number, n: number[]): CameraKey => ({
  at_s,
  eye: n.slice(0, 3) as Vector,
  look: n.slice(3, 6) as Vector,
  fov_deg: Math.min(150, Math.max(1, n[6])),
});

function slope(keys: readonly CameraKey[], at: number): number[] {
  const before = keys[Math.max(0, at - 1)];
  const behind = keys[Math.min(at + 1, keys.length - 1)];
  const from = numbersOf(before);
  return numbersOf(behind).map((n, k) => (n - from[k]) / (behind.at_s - before.at_s));
}

/** Viewpoint on cubic curves through the keys; constant before the first and after the last. */
export function cameraAt(keys: readonly CameraKey[], seconds: number): CameraKey {
  const last = keys[keys.length - 1];
  if (seconds <= keys[0].at_s) return keyOf(seconds, numbersOf(keys[0]));
  if (seconds >= last.at_s) return keyOf(seconds, numbersOf(last));
  const next = keys.findIndex((key) => key.at_s > seconds);
  const span = keys[next].at_s - keys[next - 1].at_s;
  const u = (seconds - keys[next - 1].at_s) / span;
  const [u2, u3] = [u * u, u * u * u];
  const [p, q] = [numbersOf(keys[next - 1]), numbersOf(keys[next])];
  const [m, n] = [slope(keys, next - 1), slope(keys, next)];
  return keyOf(seconds, p.map((_, k) =>
    (2 * u3 - 3 * u2 + 1) * p[k] + (u3 - 2 * u2 + u) * span * m[k] + (3 * u2 - 2 * u3) * q[k] + (u3 - u2) * span * n[k]));
}

/** The part of a take that a scene shows: its in point, and the number of its pulses. */
function partOf(take: SceneTake, first: number, last: number): { from: number; length: number } {
  const from = clamp(take.in_pulse ?? first, first, last);
  return { from, length: clamp(take.out_pulse ?? last, from, last) - from + 1 };
}

/** Where the sound of a take is, and its last pulse; null where it is silent. The parameters are those of pulseAt(). */
export function soundAt(take: SceneTake, rate: number, first: number, last: number, seconds: number) {
  const { from, length } = partOf(take, first, last);
  const n = (seconds - take.start_s - take.sound_shift_s) * take.speed * rate;
  if (take.outside !== 'loop' && (n < 0 || n >= length)) return null;
  return { exact: from + (((n % length) + length) % length), outPulse: from + length - 1 };
}

/** The shown pulse; null when the take is hidden. `rate`: of the take; `first`, `last`: pulses of its meshes. */
export function pulseAt(take: SceneTake, rate: number, first: number, last: number, seconds: number): number | null {
  const { from, length } = partOf(take, first, last);
  const n = Math.floor((seconds - take.start_s) * take.speed * rate + HARDLY);
  if (take.outside === 'hide' && (n < 0 || n >= length)) return null;
  if (take.outside === 'loop') return from + ((n % length) + length) % length;
  return from + clamp(n, 0, length - 1);
}
