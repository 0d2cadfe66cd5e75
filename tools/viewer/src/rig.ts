// Cameras of the studio as viewpoints. World: metres, z up; cameras: x right, y down, z forward.
import { Matrix4, Vector3 } from 'three';
import { fetchJson } from './request';

export interface RigCamera {
  name: string;
  width: number;
  height: number;
  matrix: number[][];
  distortion: number[];
  rotation: number[][];
  translation: number[];
}

/** Pose of a camera of three.js (x right, y up, looks along -z) that equals this camera. */
export function worldFromCamera(camera: RigCamera): Matrix4 {
  const [a, b, c] = camera.rotation;
  const t = camera.translation;
  // Rows of the rotation are the camera's axes in the world; y and z change sign.
  const at = (k: number) => -(a[k] * t[0] + b[k] * t[1] + c[k] * t[2]);
  return new Matrix4().set(
    a[0], -b[0], -c[0], at(0),
    a[1], -b[1], -c[1], at(1),
    a[2], -b[2], -c[2], at(2),
    0, 0, 0, 1,
  );
}

/** The rectangle of the whole camera image on a screen, pixels of the screen. */
export function imageOnScreen(camera: RigCamera, width: number, height: number) {
  const scale = Math.min(width / camera.width, height / camera.height);
  const [w, h] = [camera.width * scale, camera.height * scale];
  return { scale, left: (width - w) / 2, top: (height - h) / 2, width: w, height: h };
}

/** Projection matrix of the camera without distortion, on such a screen. */
export function projectionOf(camera: RigCamera, width: number, height: number, near: number, far: number): Matrix4 {
  const image = imageOnScreen(camera, width, height);
  const [fx, fy] = [camera.matrix[0][0], camera.matrix[1][1]];
  // Pixel centres have integer coordinates: the image begins half a pixel before.
  const x = (screen: number) => (((screen - image.left) / image.scale - 0.5 - camera.matrix[0][2]) / fx) * near;
  const y = (screen: number) => (((screen - image.top) / image.scale - 0.5 - camera.matrix[1][2]) / fy) * near;
  const projection = new Matrix4().makePerspective(x(0), x(width), -y(0), -y(height), near, far);
  projection.elements[4] = (-2 * camera.matrix[0][1] * image.scale) / width; // skew
  return projection;
}

export function centerOf(camera: RigCamera): Vector3 {
  return new Vector3().setFromMatrixPosition(worldFromCamera(camera));
}

/** The cameras of a calibration; empty if there is none. Throws a message for the user. */
export async function fetchRig(url: string): Promise<RigCamera[]> {
  return (await fetchJson<{ cameras: RigCamera[] }>(url))?.cameras ?? [];
}
