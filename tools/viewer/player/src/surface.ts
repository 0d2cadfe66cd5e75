import type { ShownFrame, TrackedSegment } from './worker_messages';

/** A mesh for the screen, sent by the worker. */
export interface Surface {
  positions: Float32Array;
  normals: Float32Array;
  colours: Uint8Array | null;
  indices: Uint32Array;
  /** Performer of each vertex, 0: unknown; null: not stated. */
  performers: Uint8Array | null;
}

/** A tracked surface with the triangles of its segment and the colours of its pulse. */
export const completed = (frame: ShownFrame, segment: TrackedSegment): ShownFrame =>
  ({ ...frame, indices: segment.indices, colours: frame.tracked?.colours ?? null });

/** The performers of a surface, ascending. */
export function performersOf(surface: Surface): number[] {
  return [...new Set(surface.performers ?? [])].filter((performer) => performer > 0).sort((a, b) => a - b);
}

/** Indices of the triangles of one performer; none where performers are not stated. */
export function indicesOfOne(surface: Surface, performer: number): Uint32Array {
  return surface.performers ? indicesOf(surface, (one) => one === performer) : new Uint32Array();
}

/** Indices of the triangles whose three vertices belong to shown performers; all where performers are not stated. */
export function indicesOf(surface: Surface, isShown: (performer: number) => boolean): Uint32Array {
  const { indices, performers } = surface;
  if (!performers) return indices;
  const shown = Array.from({ length: 256 }, (_, performer) => isShown(performer));
  const kept = new Uint32Array(indices.length);
  let count = 0;
  for (let t = 0; t < indices.length; t += 3) {
    if (!shown[performers[indices[t]]] || !shown[performers[indices[t + 1]]] || !shown[performers[indices[t + 2]]]) continue;
    for (let corner = 0; corner < 3; ++corner) kept[count++] = indices[t + corner];
  }
  return kept.slice(0, count);
}

/** Vertex normals: area-weighted means of the triangle normals; (0, 0, 1) without a triangle. */
export function vertexNormals(positions: Float32Array, indices: Uint32Array): Float32Array {
  const n = new Float32Array(positions.length);
  for (let t = 0; t < indices.length; t += 3) {
    const a = 3 * indices[t], b = 3 * indices[t + 1], c = 3 * indices[t + 2];
    const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1], uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1], vz = positions[c + 2] - positions[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    n[a] += x; n[a + 1] += y; n[a + 2] += z;
    n[b] += x; n[b + 1] += y; n[b + 2] += z;
    n[c] += x; n[c + 1] += y; n[c + 2] += z;
  }
  for (let v = 0; v < n.length; v += 3) {
    const length = Math.sqrt(n[v] * n[v] + n[v + 1] * n[v + 1] + n[v + 2] * n[v + 2]);
    if (length > 0) {
      n[v] /= length; n[v + 1] /= length; n[v + 2] /= length;
    } else {
      n[v + 2] = 1;
    }
  }
  return n;
}
