// OpenCV's lens model, as in base/geometry/camera_model.h, in TypeScript and in GLSL (for photographs).
import { Matrix3 } from 'three';
import type { RigCamera } from './rig';

/** k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tau_x tau_y; missing ones are 0. */
export function coefficientsOf(camera: RigCamera): number[] {
  return Array.from({ length: 14 }, (_, n) => camera.distortion[n] ?? 0);
}

/** The homography of a sensor that is tilted (OpenCV: computeTiltProjectionMatrix). */
export function tiltOf(camera: RigCamera): Matrix3 {
  const [x, y] = coefficientsOf(camera).slice(12);
  const [cx, sx, cy, sy] = [Math.cos(x), Math.sin(x), Math.cos(y), Math.sin(y)];
  const turn = new Matrix3(cy, 0, -sy, 0, 1, 0, sy, 0, cy).multiply(new Matrix3(1, 0, 0, 0, cx, sx, 0, -sx, cx));
  const [xz, yz, zz] = [turn.elements[6], turn.elements[7], turn.elements[8]];
  return new Matrix3(zz, 0, -xz, 0, zz, -yz, 0, 0, 1).multiply(turn);
}

/** Distorts the normalised point (x / z, y / z). */
export function distort(camera: RigCamera, x: number, y: number): [number, number] {
  const [k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4] = coefficientsOf(camera);
  const s = x * x + y * y;
  const radial = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)));
  const u = x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x) + s * (s1 + s * s2);
  const v = y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y + s * (s3 + s * s4);
  const e = tiltOf(camera).elements;
  const w = e[2] * u + e[5] * v + e[8];
  return [(e[0] * u + e[3] * v + e[6]) / w, (e[1] * u + e[4] * v + e[7]) / w];
}

/** The squared radius up to which the radial polynomial increases. Beyond it, distorted points would be wrong. */
export function maxRadius2(camera: RigCamera): number {
  const [k1, k2, , , k3, k4, k5, k6] = coefficientsOf(camera);
  const grows = (s: number) => {
    const top = 1 + s * (k1 + s * (k2 + s * k3));
    const bottom = 1 + s * (k4 + s * (k5 + s * k6));
    const topSlope = k1 + s * (2 * k2 + s * 3 * k3);
    const bottomSlope = k4 + s * (2 * k5 + s * 3 * k6);
    return bottom > 0 && top * bottom + 2 * s * (topSlope * bottom - top * bottomSlope) > 0;
  };
  for (let r = 0.004; r <= 40; r += 0.004) {
    if (!grows(r * r)) return (r - 0.004) ** 2;
  }
  return 1e12;
}

/** GLSL uniforms and a function: the image point, 0 to 1 from the upper left corner, of (x / z, y / z). */
export const LENS_GLSL = `
uniform float lens[14];
uniform mat3 tilt;
uniform mat3 matrix;
uniform vec2 imageSize;
uniform float maxRadius2;
vec2 inImage(vec2 p) {
  float s = dot(p, p);
  if (s > maxRadius2) return vec2(-1.0);
  float radial = (1.0 + s * (lens[0] + s * (lens[1] + s * lens[4]))) / (1.0 + s * (lens[5] + s * (lens[6] + s * lens[7])));
  vec2 bent = p * radial + s * (vec2(lens[8], lens[10]) + s * vec2(lens[9], lens[11]));
  bent.x += 2.0 * lens[2] * p.x * p.y + lens[3] * (s + 2.0 * p.x * p.x);
  bent.y += lens[2] * (s + 2.0 * p.y * p.y) + 2.0 * lens[3] * p.x * p.y;
  vec3 onSensor = tilt * vec3(bent, 1.0);
  vec3 pixel = matrix * vec3(onSensor.xy / onSensor.z, 1.0);
  return (pixel.xy + 0.5) / imageSize; // pixel centres have integer coordinates
}`;
