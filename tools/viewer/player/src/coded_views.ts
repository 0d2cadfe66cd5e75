// Views of cameras that compact frames have (docs/compact-frame.md), for view-dependent colours without raw frames.
import type { Frame } from '../../../../codec/v3d_decoder.mjs';
import { MAX_CAMERAS, ROW, type VertexViews } from './camera_views';

/** Whether a compact frame has colours of cameras. */
export function hasCodedViews(bytes: Uint8Array): boolean {
  return bytes.length >= 128 && (bytes[16] & 32) !== 0;
}

/** Copies the views of a decoded frame for the shader. Null when it has none, or more cameras than the shader supports. */
export function codedViews(frame: Pick<Frame, 'pulse' | 'cameras' | 'positions' | 'views'>): VertexViews | null {
  const { views } = frame;
  if (!views || views.length > MAX_CAMERAS) return null;
  const vertices = frame.positions.length / 3;
  const rows = Math.max(1, Math.ceil(vertices / ROW));
  if (rows > 2 * ROW) return null;
  const texels = new Uint8Array(views.length * rows * ROW * 4);
  views.forEach(({ colours }, camera) => texels.set(colours, camera * rows * ROW * 4));
  const cameras = views.map(({ axis }, camera) => ({ name: frame.cameras[camera], axis }));
  return { pulse: frame.pulse, vertices, cameras, rows, texels };
}
