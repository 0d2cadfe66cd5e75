// What every camera says about the vertices of a mesh: daemon/viewd/view_json.h, vertex_views_message().
import { splitMessage } from './message';

/** More the shader has no room for. */
export const MOST_CAMERAS = 64;
/** Of a texture that holds a vertex in each place: every WebGL 2 has textures twice as wide. */
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
   * Of each camera `rows` rows of ROW places, of each place red, green, blue, and how the camera sees the vertex: 0 not,
   * 128 at the rim of the silhouette, where the colour may be the background's, 255 within it.
   */
  texels: Uint8Array;
}

const SIGHTS = [0, 128, 255, 0];

/** Null where it is no such message, or one of more than can be drawn. */
export function parseVertexViews(message: ArrayBuffer): VertexViews | null {
  const split = splitMessage<Head>(message);
  if (!split || !(split.head.cameras?.length <= MOST_CAMERAS) || !(split.head.vertices >= 0)) return null;
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
