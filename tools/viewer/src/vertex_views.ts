// Colour and visibility of the vertices of a mesh in every camera (daemon/viewd/view_json.h, vertex_views_message()).
import { splitMessage } from './message';

/** Maximum number of cameras in the shader. */
export const MAX_CAMERAS = 64;
/** Width of a texture with one vertex a texel; WebGL 2 supports twice this width. */
export const ROW = 1024;

export interface ViewingCamera {
  name: string;
  /** Unit vector of its optical axis, world: the paper's V_c. */
  axis: [number, number, number];
}

interface Head {
  pulse: number;
  vertices: number;
  cameras: ViewingCamera[];
}

export interface VertexViews extends Head {
  rows: number;
  /**
   * For each camera `rows` rows of ROW texels: red, green, blue, and the visibility of the vertex in the camera: 0 not,
   * 128 at the rim of the silhouette, where the colour may be the background's, 255 inside.
   */
  texels: Uint8Array;
}

const SIGHTS = [0, 128, 255, 0];

/** Null when the message is malformed or has too many cameras. */
export function parseVertexViews(message: ArrayBuffer): VertexViews | null {
  const split = splitMessage<Head>(message);
  if (!split || !(split.head.cameras?.length <= MAX_CAMERAS) || !(split.head.vertices >= 0)) return null;
  const { head, bytes } = split;
  const rows = Math.max(1, Math.ceil(head.vertices / ROW));
  const sightBytes = Math.ceil(head.vertices / 4);
  if (rows > 2 * ROW || head.cameras.length * sightBytes > bytes.length) return null;
  const texels = new Uint8Array(head.cameras.length * rows * ROW * 4);
  let from = 0;
  for (let camera = 0; camera < head.cameras.length; ++camera) {
    const sights = from;
    from += sightBytes;
    let to = camera * rows * ROW * 4;
    for (let vertex = 0; vertex < head.vertices; ++vertex, to += 4) {
      const sight = (bytes[sights + (vertex >> 2)] >> (2 * (vertex & 3))) & 3;
      if (sight === 0) continue;
      texels[to] = bytes[from];
      texels[to + 1] = bytes[from + 1];
      texels[to + 2] = bytes[from + 2];
      texels[to + 3] = SIGHTS[sight];
      from += 3;
    }
  }
  return from === bytes.length ? { ...head, rows, texels } : null;
}
