import { describe, expect, it } from 'vitest';
import { bodyOf } from '../player/src/byte_source';
import { fileNameOf, lineOf } from '../player/src/clip';
import { parseManifest } from '../player/src/manifest';
import { type MeshoptDecoder, readSegment } from '../player/src/segment_file';
import { SurfaceGeometry } from '../player/src/surface_geometry';
import { SurfaceQueue } from '../player/src/surface_queue';
import type { SurfaceWorker } from '../player/src/surface_worker';
import { chooseVideo, pictureAt } from '../player/src/video_frames';
import { matchSegments, spread } from '../player/src/volume_clip';
import { resolveSource } from '../player/src/volume_player';
import type { ShownFrame } from '../player/src/worker_messages';

const messageOf = (act: () => unknown) => {
  try {
    act();
    return '';
  } catch (error) {
    return (error as Error).message;
  }
};
/** Random numbers from 0 to 1 that are the same in every run. */
function random(seed: number) {
  return () => {
    seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
    return seed / 2 ** 32;
  };
}

type Json = Record<string, unknown>;
const file = (): Json => ({
  format: 'v3d-volume', version: 1, take: 'kendo-07', rate_hz: 25, first_pulse: 37, pulses: 26, motion: 'motion.v3d',
  texture: { side: 2048, videos: [{ file: 'a.mp4', type: 'video/mp4; codecs="av01"' }, { file: 'h.mp4', type: 'video/mp4' }] },
  sound: { codec: 'mp4a.40.2', rate_hz: 48000, channels: 2 },
  segments: [{ first_pulse: 37, last_pulse: 40, surface: 'segment-000.glb' }, { first_pulse: 43, last_pulse: 62, surface: 'segment-001.glb' }],
});
const rejection = (changes: Json) => messageOf(() => parseManifest(JSON.stringify({ ...file(), ...changes })));

describe('the manifest of a delivery', () => {
  it('has segments, videos and whether they have sound', () => {
    const manifest = parseManifest(JSON.stringify(file()));
    expect(manifest).toMatchObject({ take: 'kendo-07', rate: 25, firstPulse: 37, pulses: 26, motion: 'motion.v3d', side: 2048, hasSound: true });
    expect(manifest.segments[1]).toEqual({ firstPulse: 43, lastPulse: 62, surface: 'segment-001.glb', vertices: null, triangles: null });
    expect(parseManifest(JSON.stringify({ ...file(), sound: undefined })).hasSound).toBe(false);
  });

  it('may have keys of later programs', () => {
    expect(rejection({ camera: { name: 'cam01' } })).toBe('');
  });

  const segments = (changes: Json) => ({ segments: [{ ...(file().segments as Json[])[0], ...changes }] });
  const texture = (changes: Json) => ({ texture: { ...(file().texture as Json), ...changes } });
  it.each<[Json, string]>([
    [{ format: 'glTF' }, 'format: expected "v3d-volume"'],
    [{ version: '1' }, 'version: expected 1'],
    [{ version: 2 }, 'version: expected 1'],
    [{ rate_hz: 0 }, 'rate_hz: expected a number above 0'],
    [{ rate_hz: null }, 'rate_hz: expected a number'],
    [{ first_pulse: -1 }, 'first_pulse: expected a whole number from 0'],
    [{ first_pulse: 2 ** 53 }, 'first_pulse: expected a whole number'],
    [{ pulses: 1.5 }, 'pulses: expected a whole number from 1'],
    [{ pulses: 1e12 }, 'pulses: expected a whole number from 1 to 10000000'],
    [{ pulses: 20 }, 'segments[1].last_pulse: expected a whole number from 43 to 56'],
    [{ motion: undefined }, "'motion' is missing"],
    [{ motion: 7 }, 'motion: expected a text'],
    ...['../motion.v3d', '/motion.v3d', 'a/motion.v3d', 'https://example.org/motion.v3d', '..', '.hidden', 'a%2fb', 'motion.v3d?x', 'a\\b', '', 'x'.repeat(200)]
      .map((motion): [Json, string] => [{ motion }, 'motion: expected the name of a file in the same folder']),
    [{ texture: [] }, 'texture: expected an object'],
    [texture({ side: 2e9 }), 'texture.side: expected a whole number from 2 to 16384'],
    [texture({ videos: [] }), 'texture.videos: expected a list of 1 to 16 entries'],
    [texture({ videos: [7] }), 'texture.videos[0]: expected an object'],
    [texture({ videos: [{ file: '../a.mp4', type: '' }] }), 'texture.videos[0].file: expected the name of a file'],
    [{ sound: true }, 'sound: expected an object'],
    [{ segments: {} }, 'segments: expected a list'],
    [{ segments: Array.from({ length: 5000 }, () => (file().segments as Json[])[0]) }, 'segments: expected a list of 1 to 4096'],
    [{ segments: [...(file().segments as Json[])].reverse() }, 'segments[1].first_pulse: expected a whole number from 63'],
    [segments({ first_pulse: 36 }), 'segments[0].first_pulse: expected a whole number from 37 to 62'],
    [segments({ last_pulse: 36 }), 'segments[0].last_pulse: expected a whole number from 37 to 62'],
    [segments({ vertices: 1e9 }), 'segments[0].vertices: expected a whole number from 1 to 524288'],
    [segments({ triangles: 0 }), 'segments[0].triangles: expected a whole number from 1'],
  ])('is rejected with what would be right: %j', (changes, says) => {
    expect(rejection(changes)).toContain(says);
  });

  it('is read or rejected with one line, whatever its bytes', () => {
    const text = JSON.stringify(file());
    const next = random(3);
    for (let n = 0; n < 2000; ++n) {
      const at = Math.floor(next() * text.length);
      const damaged = text.slice(0, at) + String.fromCharCode(32 + Math.floor(next() * 95)) + text.slice(at + 1 + Math.floor(next() * 3));
      expect(messageOf(() => parseManifest(damaged))).not.toMatch(/\n|undefined|not a function|Cannot read/);
    }
  });
});

/** A GLB file of two triangles whose four corners have the vertices 0, 1, 2, 1. */
function glb(change: (gltf: any) => void = () => undefined): Uint8Array {
  const binary = new Uint8Array(16 + 16 + 24);
  new Float32Array(binary.buffer, 0, 4).set([0, 1, 2, 1]);
  new Uint16Array(binary.buffer, 16, 8).set([0, 0, 65535, 0, 0, 65535, 65535, 65535]);
  new Uint32Array(binary.buffer, 32, 6).set([0, 1, 2, 0, 2, 3]);
  const gltf = {
    accessors: [{ bufferView: 0, componentType: 5126, count: 4 }, { bufferView: 1, componentType: 5123, count: 4 }, { bufferView: 2, componentType: 5125, count: 6 }],
    bufferViews: [{ byteLength: 16 }, { byteOffset: 16, byteLength: 16 }, { byteOffset: 32, byteLength: 24 }],
    meshes: [{ primitives: [{ attributes: { _VERTEX: 0, TEXCOORD_0: 1 }, indices: 2 }] }],
  };
  change(gltf);
  let text = JSON.stringify(gltf);
  text += ' '.repeat((4 - (text.length % 4)) % 4);
  const file = new Uint8Array(12 + 8 + text.length + 8 + binary.length);
  const data = new DataView(file.buffer);
  [0x46546c67, 2, file.length, text.length, 0x4e4f534a].forEach((word, n) => data.setUint32(4 * n, word, true));
  file.set(new TextEncoder().encode(text), 20);
  data.setUint32(20 + text.length, binary.length, true);
  data.setUint32(24 + text.length, 0x004e4942, true);
  file.set(binary, 28 + text.length);
  return file;
}
/** A decoder that copies its source, or fails. */
const decoder: MeshoptDecoder = {
  ready: Promise.resolve(),
  decodeGltfBuffer(target, count, size, source, mode) {
    if (mode !== 'ATTRIBUTES' || source.length !== count * size) throw new Error('Malformed buffer data: -2');
    target.set(source);
  },
};
const shape = { vertices: 3, triangles: 2 };
const compressed = (changes: Json) => glb((gltf) => {
  gltf.bufferViews[0].extensions = { EXT_meshopt_compression: { byteLength: 16, byteStride: 4, count: 4, mode: 'ATTRIBUTES', ...changes } };
});

describe('the surface of a segment', () => {
  it('has the vertex of each corner, texture coordinates and triangles', () => {
    for (const file of [glb(), compressed({})]) {
      const { numbers, coordinates, indices } = readSegment(file, decoder, shape);
      expect([...numbers]).toEqual([0, 1, 2, 1]);
      expect([...coordinates]).toEqual([0, 0, 65535, 0, 0, 65535, 65535, 65535]);
      expect([...indices]).toEqual([0, 1, 2, 0, 2, 3]);
    }
  });

  it.each<[string, Uint8Array, string]>([
    ['text', new TextEncoder().encode('<html>'), 'expected a GLB file of version 2'],
    ['nothing', new Uint8Array(), 'expected a GLB file of version 2'],
    ['a truncated file', glb().subarray(0, 200), 'is incomplete: has 200 bytes of'],
    ['no mesh', glb((gltf) => { gltf.meshes = []; }), 'is no segment of a delivery'],
    ['no number of vertices', glb((gltf) => { delete gltf.meshes[0].primitives[0].attributes._VERTEX; }), '_VERTEX: is missing'],
    ['another type', glb((gltf) => { gltf.accessors[0].componentType = 5121; }), '_VERTEX: has the type 5121; expected 5126'],
    ['a huge count', glb((gltf) => { gltf.accessors[0].count = 1e9; }), '_VERTEX: has 1000000000 elements; expected at most'],
    ['a negative count', glb((gltf) => { gltf.accessors[2].count = -3; }), 'indices: has -3 elements'],
    ['a part outside', glb((gltf) => { gltf.bufferViews[2].byteOffset = 40; }), 'a part lies outside of the file'],
    ['a part before', glb((gltf) => { gltf.bufferViews[2].byteOffset = -4; }), 'a part lies outside of the file'],
    ['a stride', glb((gltf) => { gltf.bufferViews[0].byteStride = 8; }), '_VERTEX: expected 4 bytes an element'],
    ['a compressed count', compressed({ count: 9 }), '_VERTEX: expected 4 elements of 4 bytes'],
    ['damaged compression', compressed({ byteLength: 8 }), '_VERTEX: its compressed data are damaged'],
    ['an unknown mode', compressed({ mode: 'toString' }), '_VERTEX: its compressed data are damaged'],
    ['fewer coordinates', glb((gltf) => { gltf.accessors[1].count = 3; }), 'has 4 vertices and 3 texture coordinates'],
    ['fewer triangles', glb((gltf) => { gltf.accessors[2].count = 3; }), 'has 1 triangles; expected 2, those of the motion file'],
    ['fewer corners', glb((gltf) => { gltf.accessors[0].count = gltf.accessors[1].count = 3; }), 'has an index beyond its 3 vertices'],
  ])('is rejected with what would be right: %s', (_, bytes, says) => {
    expect(messageOf(() => readSegment(bytes, decoder, shape))).toContain(says);
  });

  it('has no vertex beyond those of the motion file', () => {
    expect(messageOf(() => readSegment(glb(), decoder, { vertices: 2, triangles: 2 }))).toBe('has a vertex beyond the 2 of the motion file');
  });

  it('is read or rejected with one line, whatever its bytes', () => {
    const whole = compressed({});
    const next = random(7);
    for (let n = 0; n < 3000; ++n) {
      const damaged = whole.slice(0, n % 7 === 0 ? Math.floor(next() * whole.length) : whole.length);
      for (let k = 0; k < 3; ++k) damaged[Math.floor(next() * damaged.length)] = Math.floor(next() * 256);
      expect(messageOf(() => readSegment(damaged, decoder, shape))).not.toMatch(/\n|not a function|Cannot read|Invalid/);
    }
  });
});

describe('a delivery', () => {
  const manifest = parseManifest(JSON.stringify(file()));
  const shapeOf = (first: number, last: number) => ({ pulses: [first, last], vertices: 3, triangles: 2 });

  it('has the segments of its motion file', () => {
    expect(matchSegments(manifest, [shapeOf(37, 40), shapeOf(43, 62)])).toHaveLength(2);
    expect(messageOf(() => matchSegments(manifest, [shapeOf(37, 40)]))).toContain('has 1 segments; expected 2');
    expect(messageOf(() => matchSegments(manifest, [shapeOf(37, 40), shapeOf(43, 61)]))).toContain('has pulses 43 to 61; expected 43 to 62');
    const counted = parseManifest(JSON.stringify({ ...file(), segments: [{ ...(file().segments as Json[])[0], vertices: 4, triangles: 2 }] }));
    expect(messageOf(() => matchSegments(counted, [shapeOf(37, 40)]))).toContain('has 3 vertices and 2 triangles; expected 4 and 2');
  });

  it('moves every corner with its vertex', () => {
    expect([...spread(Float32Array.of(0, 1, 2, 3, 4, 5), Uint32Array.of(1, 0, 1))]).toEqual([3, 4, 5, 0, 1, 2, 3, 4, 5]);
  });

  it('uses the video that the browser plays best, in the order of the manifest', () => {
    const { videos } = manifest;
    expect(chooseVideo(videos, () => 'probably')?.file).toBe('a.mp4');
    expect(chooseVideo(videos, (type) => (type.includes('av01') ? 'maybe' : 'probably'))?.file).toBe('h.mp4');
    expect(chooseVideo(videos, (type) => (type.includes('av01') ? '' : 'maybe'))?.file).toBe('h.mp4');
    expect(chooseVideo(videos, () => '')).toBeNull();
  });

  it('has for every media time the picture that a video shows then', () => {
    for (const rate of [12, 24, 25, 29.97, 30, 50, 60]) {
      for (let picture = 0; picture < 500; ++picture) {
        const written = Math.round((picture / rate) * 12800) / 12800; // the time scale of ffmpeg
        const microseconds = Math.floor(1e6 * written) / 1e6; // that of a VideoFrame
        for (const seconds of [written, microseconds, picture / rate + 0.001]) expect(pictureAt(seconds, rate, 500)).toBe(picture);
      }
    }
    expect(pictureAt(-0.02, 25, 500)).toBe(0);
    expect(pictureAt(99, 25, 500)).toBe(499);
  });
});

describe('the player', () => {
  it('finds the manifest of a folder', () => {
    const base = 'http://localhost/page/index.html';
    expect(resolveSource('kendo/', base)).toEqual({ url: 'http://localhost/page/kendo/manifest.json', isDelivery: true });
    expect(resolveSource('kendo/manifest.json?v=2', base)).toEqual({ url: 'http://localhost/page/kendo/manifest.json?v=2', isDelivery: true });
    expect(resolveSource('/takes/kendo/mesh.v3d', base)).toEqual({ url: 'http://localhost/takes/kendo/mesh.v3d', isDelivery: false });
    for (const src of ['file:///etc/passwd', 'javascript:alert(1)', 'data:application/json,{}']) {
      expect(messageOf(() => resolveSource(src, base))).toContain('expected an address that begins with http: or https:');
    }
  });

  it('reports errors in one line with the file and what would be right', () => {
    expect(lineOf('motion.v3d', new Error('The server answered 404.'), 'the file')).toBe('motion.v3d: the server answered 404; expected the file');
    expect(lineOf('a.glb', 'is\nlong; expected less', 'the file')).toBe('a.glb: is long; expected less');
    expect(fileNameOf('http://localhost/takes/a%20b.v3d?x=1')).toBe('a b.v3d');
    expect(fileNameOf('http://localhost/takes/100%.v3d')).toBe('100%.v3d');
  });

  it('reads at most the bytes that it asks for', async () => {
    expect(await bodyOf(new Response('abcd'), 4)).toHaveLength(4);
    await expect(bodyOf(new Response('abcde'), 4)).rejects.toThrow('The server sent more than 4 bytes.');
  });
});

describe('a surface on the graphics card', () => {
  it('uploads triangles once for all pulses of a segment', () => {
    const surface = new SurfaceGeometry();
    const indices = Uint32Array.of(0, 1, 2);
    const show = (of: Uint32Array) => surface.show(of, { position: { values: new Float32Array(9), size: 3 } });
    show(indices);
    const { version } = surface.geometry.getIndex()!;
    show(indices);
    expect(surface.indexUploads).toBe(1);
    expect(surface.geometry.getIndex()!.version).toBe(version);
    expect((surface.geometry.getAttribute('position') as { version: number }).version).toBe(1);
    show(Uint32Array.of(2, 1, 0));
    expect(surface.indexUploads).toBe(2);
  });
});

describe('a queue of surfaces', () => {
  it('shows a surface that arrived too late for an earlier request', async () => {
    const settle = () => new Promise((done) => setTimeout(done));
    const asked: number[] = [];
    let ready = 0;
    // A worker that sends no surface twice in succession, as the real one.
    const worker = { want: (number: number) => { if (asked.at(-1) !== number) asked.push(number); } } as unknown as SurfaceWorker;
    const numberOf = new Map(Array.from({ length: 26 }, (_, n) => [n, n]));
    const queue = new SurfaceQueue(() => worker, numberOf, parseManifest(JSON.stringify(file())), () => ++ready);
    const frame = (number: number) => ({ number }) as ShownFrame;
    queue.want(4, false, false);
    queue.answer(4, frame(4));
    await settle();
    queue.want(5, false, false);
    queue.want(4, false, false); // 4 is kept: nothing else is requested
    queue.answer(5, frame(5)); // too late
    await settle();
    expect([queue.get(5), ready]).toEqual([undefined, 1]);
    queue.want(5, false, false);
    await settle();
    expect([queue.get(5)?.number, ready, asked]).toEqual([5, 2, [4, 5]]);
    queue.end();
  });
});
