// The surface of a segment of a delivery, segment-000.glb (docs/export.md): its triangles, their texture coordinates, and the
// number of each vertex in the motion file. Positions and the still picture of the file are not read.

export const MAX_SEGMENT_BYTES = 128 << 20;
/** Seams divide vertices: a vertex of the motion file may occur several times. */
const MAX_CORNERS = 2_097_152;
const MAX_INDICES = 3 * 1_048_576;
const FLOAT = 5126, UINT16 = 5123, UINT32 = 5125;
const JSON_CHUNK = 0x4e4f534a, BINARY_CHUNK = 0x004e4942;

/** The part of three/addons/libs/meshopt_decoder.module.js that is used. */
export interface MeshoptDecoder {
  ready: Promise<void>;
  decodeGltfBuffer(target: Uint8Array, count: number, size: number, source: Uint8Array, mode: string, filter?: string): void;
}

export interface SegmentSurface {
  /** Number of each vertex in the motion file. */
  numbers: Uint32Array;
  /** u and v of each vertex, normalised to 65535; the origin is the upper left corner. */
  coordinates: Uint16Array;
  /** Three for each triangle. */
  indices: Uint32Array;
}

/** What the motion file has for the segment. */
export interface ExpectedShape {
  vertices: number;
  triangles: number;
}

interface Compressed {
  byteOffset?: number;
  byteLength: number;
  byteStride: number;
  count: number;
  mode: string;
  filter?: string;
}
interface Gltf {
  accessors: { bufferView: number; byteOffset?: number; componentType: number; count: number; normalized?: boolean }[];
  bufferViews: { byteOffset?: number; byteLength: number; byteStride?: number; extensions?: { EXT_meshopt_compression?: Compressed } }[];
  meshes: { primitives: { attributes: Record<string, number>; indices: number }[] }[];
}

const isCount = (value: unknown, max: number): value is number => Number.isInteger(value) && (value as number) >= 0 && (value as number) <= max;

/** JSON and binary chunk of a GLB file. */
function chunksOf(file: Uint8Array): { gltf: Gltf; binary: Uint8Array } {
  const data = new DataView(file.buffer, file.byteOffset, file.byteLength);
  const word = (at: number) => data.getUint32(at, true);
  if (file.length < 20 || word(0) !== 0x46546c67 || word(4) !== 2) throw new Error('expected a GLB file of version 2');
  const end = 20 + word(12);
  if (word(8) !== file.length || word(16) !== JSON_CHUNK || end + 8 > file.length || word(end + 4) !== BINARY_CHUNK || end + 8 + word(end) > file.length) {
    throw new Error(`is incomplete: has ${file.length} bytes of ${word(8)}; copy it again`);
  }
  const gltf = JSON.parse(new TextDecoder().decode(file.subarray(20, end))) as Gltf;
  return { gltf, binary: file.subarray(end + 8, end + 8 + word(end)) };
}

/** Bytes [offset, offset + length). */
function part(bytes: Uint8Array, offset: unknown, length: unknown): Uint8Array {
  if (!isCount(offset, bytes.length) || !isCount(length, bytes.length - offset)) throw new Error('a part lies outside of the file');
  return bytes.subarray(offset, offset + length);
}

class SegmentReader {
  private readonly gltf: Gltf;
  private readonly binary: Uint8Array;

  constructor(
    file: Uint8Array,
    private readonly decoder: MeshoptDecoder,
  ) {
    ({ gltf: this.gltf, binary: this.binary } = chunksOf(file));
  }

  /** Tightly packed bytes of an accessor of `width` bytes an element, in a buffer of their own. */
  private packed(name: string, accessor: Gltf['accessors'][0], width: number): ArrayBuffer {
    const view = this.gltf.bufferViews[accessor.bufferView];
    const compressed = view.extensions?.EXT_meshopt_compression;
    const bytes = new Uint8Array(accessor.count * width);
    if (compressed) {
      if (compressed.byteStride !== width || compressed.count !== accessor.count || (accessor.byteOffset ?? 0) !== 0) {
        throw new Error(`${name}: expected ${accessor.count} elements of ${width} bytes`);
      }
      const source = part(this.binary, compressed.byteOffset ?? 0, compressed.byteLength);
      this.decompress(name, bytes, source, compressed);
    } else {
      if ((view.byteStride ?? width) !== width) throw new Error(`${name}: expected ${width} bytes an element`);
      bytes.set(part(part(this.binary, view.byteOffset ?? 0, view.byteLength), accessor.byteOffset ?? 0, bytes.length));
    }
    return bytes.buffer;
  }

  private decompress(name: string, target: Uint8Array, source: Uint8Array, { count, byteStride, mode, filter }: Compressed): void {
    try {
      this.decoder.decodeGltfBuffer(target, count, byteStride, source, mode, filter);
    } catch {
      throw new Error(`${name}: its compressed data are damaged; copy the file again`);
    }
  }

  private accessor(name: string, number: number, types: number[], max: number): Gltf['accessors'][0] {
    const accessor = this.gltf.accessors[number];
    if (!accessor) throw new Error(`${name}: is missing`);
    if (!types.includes(accessor.componentType)) throw new Error(`${name}: has the type ${accessor.componentType}; expected ${types.join(' or ')}`);
    if (!isCount(accessor.count, max)) throw new Error(`${name}: has ${accessor.count} elements; expected at most ${max}`);
    return accessor;
  }

  private indices(number: number): Uint32Array {
    const accessor = this.accessor('indices', number, [UINT16, UINT32], MAX_INDICES);
    const isShort = accessor.componentType === UINT16;
    const bytes = this.packed('indices', accessor, isShort ? 2 : 4);
    return isShort ? Uint32Array.from(new Uint16Array(bytes)) : new Uint32Array(bytes);
  }

  read(): SegmentSurface {
    const primitive = this.gltf.meshes[0].primitives[0];
    const { _VERTEX: vertex, TEXCOORD_0: texel } = primitive.attributes;
    const numbers = new Float32Array(this.packed('_VERTEX', this.accessor('_VERTEX', vertex, [FLOAT], MAX_CORNERS), 4));
    const coordinates = new Uint16Array(this.packed('TEXCOORD_0', this.accessor('TEXCOORD_0', texel, [UINT16], MAX_CORNERS), 4));
    return { numbers: Uint32Array.from(numbers), coordinates, indices: this.indices(primitive.indices) };
  }
}

function check({ numbers, coordinates, indices }: SegmentSurface, expected: ExpectedShape): void {
  if (coordinates.length !== 2 * numbers.length) throw new Error(`has ${numbers.length} vertices and ${coordinates.length / 2} texture coordinates; expected as many`);
  if (indices.length !== 3 * expected.triangles) throw new Error(`has ${indices.length / 3} triangles; expected ${expected.triangles}, those of the motion file`);
  if (numbers.some((number) => number >= expected.vertices)) throw new Error(`has a vertex beyond the ${expected.vertices} of the motion file`);
  if (indices.some((index) => index >= numbers.length)) throw new Error(`has an index beyond its ${numbers.length} vertices`);
}

/** Throws one line, without the name of the file: what is wrong, and what would be right. */
export function readSegment(file: Uint8Array, decoder: MeshoptDecoder, expected: ExpectedShape): SegmentSurface {
  let surface: SegmentSurface;
  try {
    surface = new SegmentReader(file, decoder).read();
  } catch (error) {
    if (error instanceof SyntaxError || error instanceof TypeError) throw new Error('is no segment of a delivery; expected one mesh with _VERTEX and TEXCOORD_0');
    throw error;
  }
  check(surface, expected);
  return surface;
}
