// Tracked surfaces of a take, motion.v3d (docs/motion-format.md), for the worker: surfaces of single pulses, and the paths of
// vertices over the last pulses.
import { Motion } from '../../../../codec/v3d_decoder.mjs';
import { HttpSource, repeated } from './byte_source';
import { vertexNormals } from './surface';
import type { SegmentShape, ShownFrame, TrackedSegment, Trail, TrailPoint } from './worker_messages';

/** The decoder needs the whole file in memory. */
const MAX_BYTES = 512 << 20;
const CHUNK = 4 << 20;
/** Number of pulses of a trail, with the shown one. */
export const TRAIL_PULSES = 25;

/**
 * Reads the whole file in parts; null after the end of `signal`. Without a deadline, requests that may succeed later are repeated, and `trouble`
 * gets their errors. Throws a message for the page.
 */
export async function fetchMotion(
  url: string, signal: AbortSignal, deadlineMs: number, trouble: (error: unknown) => void,
): Promise<Uint8Array | null> {
  const source = new HttpSource(url, deadlineMs, signal);
  const ended = () => signal.aborted;
  const again = <T>(request: () => Promise<T>) => (deadlineMs === Infinity ? repeated(request, ended, trouble) : request());
  const size = await again(() => source.size());
  if (size === null) return null;
  if (size > MAX_BYTES) throw new Error(`motion.v3d has ${size} bytes; a browser can play at most ${MAX_BYTES}.`);
  const bytes = new Uint8Array(size);
  for (let at = 0; at < size; at += CHUNK) {
    if (ended()) return null;
    const part = await again(() => source.read(at, Math.min(CHUNK, size - at)));
    if (!part) return null;
    if (part.length > size - at) throw new Error('motion.v3d was replaced during the download.');
    bytes.set(part, at);
  }
  return bytes;
}

export interface Place {
  segment: number;
  /** Index of the pulse in the segment. */
  index: number;
}

/** Position of a pulse in the segments, of a shared pulse in the later one; null: it has no tracked surface. */
export function placeOf(segments: readonly { pulses: readonly number[] }[], pulse: number): Place | null {
  const segment = segments.findLastIndex(({ pulses }) => pulses[0] <= pulse && pulse <= pulses[pulses.length - 1]);
  const index = segment < 0 ? -1 : segments[segment].pulses.indexOf(pulse);
  return index < 0 ? null : { segment, index };
}

/** Ascending, a shared pulse once. */
export function pulsesOf(segments: readonly { pulses: readonly number[] }[]): number[] {
  return [...new Set(segments.flatMap(({ pulses }) => pulses))];
}

export class TrackedTake {
  private readonly motion: Motion;
  /** Positions of the pulses that trails need, by index; all of one segment. */
  private readonly held = new Map<number, Float32Array>();
  private heldSegment = -1;

  /** Throws an error for bytes that are no valid motion file. */
  constructor(module: WebAssembly.Module, bytes: Uint8Array) {
    this.motion = new Motion(module, bytes);
  }

  get segments(): number {
    return this.motion.segments.length;
  }

  get shapes(): SegmentShape[] {
    return this.motion.segments.map(({ pulses, vertices, triangles }) => ({ pulses, vertices, triangles }));
  }

  /** All pulses that have a tracked surface. */
  get pulses(): number[] {
    return pulsesOf(this.motion.segments);
  }

  placeOf(pulse: number): Place | null {
    return placeOf(this.motion.segments, pulse);
  }

  /** The triangles and template colours of a segment; null: damaged. */
  segment(number: number): TrackedSegment | null {
    const surface = this.motion.surface(number);
    return surface && { number, indices: surface.indices.slice(), colours: surface.colours?.slice() ?? null };
  }

  /** The surface of a pulse without its triangles, which `segment` has; null: damaged. */
  frame(number: number, { segment: at, index }: Place, segment: TrackedSegment): ShownFrame | null {
    const began = performance.now();
    const pulse = this.motion.decode(at, index);
    if (!pulse) return null;
    const positions = pulse.positions.slice();
    const colours = pulse.colours?.slice() ?? null;
    return {
      number, pulse: pulse.pulse, positions, normals: vertexNormals(positions, segment.indices), colours,
      indices: new Uint32Array(), performers: null,
      tracked: { segment: at, segments: this.segments, colours },
      bytes: 0, decodeMs: performance.now() - began, cameras: 0, quality: NaN, live: null,
    };
  }

  /** Keeps the positions of a pulse for trails(), and drops those that its trails do not need. */
  keep({ segment, index }: Place, positions: Float32Array): void {
    if (segment !== this.heldSegment) this.held.clear();
    this.heldSegment = segment;
    for (const known of [...this.held.keys()]) if (known <= index - TRAIL_PULSES || known > index) this.held.delete(known);
    this.held.set(index, positions);
  }

  /**
   * Paths of the vertices to the pulse of the last keep(). A path begins at the start of the segment, or after a damaged pulse. Decodes what is
   * missing; when `obsolete` becomes true, it returns the paths over the pulses that are known.
   */
  async trails({ segment, index }: Place, points: readonly TrailPoint[], obsolete: () => boolean): Promise<Trail[]> {
    const own = points.filter((point) => point.segment === segment);
    if (own.length === 0) return [];
    const first = Math.max(0, index - TRAIL_PULSES + 1);
    for (let i = first; i < index && !obsolete(); ++i) {
      if (this.held.has(i)) continue;
      const pulse = this.motion.decode(segment, i);
      if (pulse) this.held.set(i, pulse.positions.slice());
      await new Promise((done) => setTimeout(done)); // lets messages arrive
    }
    let from = index + 1;
    while (this.held.has(from - 1)) --from;
    return own.map((point) => ({ point, path: this.path(point.vertex, from, index) }));
  }

  private path(vertex: number, from: number, to: number): Float32Array {
    const path = new Float32Array(3 * Math.max(0, to - from + 1));
    for (let i = from; i <= to; ++i) path.set(this.held.get(i)!.subarray(3 * vertex, 3 * vertex + 3), 3 * (i - from));
    return path;
  }
}
