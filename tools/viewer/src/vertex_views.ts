// Colour and visibility of the vertices of a mesh in every camera (daemon/viewd/view_json.h, vertex_views_message()).
import { MAX_CAMERAS, ROW, type VertexViews } from '../player/src/camera_views';
import { splitMessage } from './message';

type Head = Pick<VertexViews, 'pulse' | 'vertices' | 'cameras'>;

const VISIBILITY_ALPHA = [0, 128, 255, 0];

/** Null: the message is malformed; 'too many': it has more cameras than the shader. */
export function parseVertexViews(message: ArrayBuffer): VertexViews | 'too many' | null {
  const split = splitMessage<Head>(message);
  if (!split || !(split.head.cameras?.length >= 0) || !(split.head.vertices >= 0)) return null;
  if (split.head.cameras.length > MAX_CAMERAS) return 'too many';
  const { head, bytes } = split;
  const rows = Math.max(1, Math.ceil(head.vertices / ROW));
  const visibilityBytes = Math.ceil(head.vertices / 4);
  if (rows > 2 * ROW || head.cameras.length * visibilityBytes > bytes.length) return null;
  const texels = new Uint8Array(head.cameras.length * rows * ROW * 4);
  let from = 0;
  for (let camera = 0; camera < head.cameras.length; ++camera) {
    const visibilityBegin = from;
    from += visibilityBytes;
    let to = camera * rows * ROW * 4;
    for (let vertex = 0; vertex < head.vertices; ++vertex, to += 4) {
      const visibility = (bytes[visibilityBegin + (vertex >> 2)] >> (2 * (vertex & 3))) & 3;
      if (visibility === 0) continue;
      texels[to] = bytes[from];
      texels[to + 1] = bytes[from + 1];
      texels[to + 2] = bytes[from + 2];
      texels[to + 3] = VISIBILITY_ALPHA[visibility];
      from += 3;
    }
  }
  return from === bytes.length ? { ...head, rows, texels } : null;
}
