import { describe, expect, it, vi } from 'vitest';
import { type ByteSource, HttpSource } from '../player/src/byte_source';
import { crc32 } from '../player/src/crc32';
import { entryAt, FrameStore, keyPulseOf, readEntries } from '../player/src/mesh_file';
import { TakeSequence } from '../player/src/sequence';
import { fields, frame, join, keyFrame, meshFile, record, text } from './mesh_bytes';

class Bytes implements ByteSource {
  reads = 0;
  constructor(readonly bytes: Uint8Array) {}
  async size() {
    return this.bytes.length;
  }
  async read(first: number, size: number) {
    ++this.reads;
    return this.bytes.slice(first, first + size);
  }
}

const frames: [number, Uint8Array][] = [[0, frame(1, 300)], [1, frame(2, 200)], [4, frame(3, 100)]];

describe('a mesh file', () => {
  it('checksums as PNG does', () => expect(crc32(text('123456789'))).toBe(0xcbf43926));

  it('lists its frames by the index, in three reads', async () => {
    const source = new Bytes(meshFile(frames));
    const entries = await readEntries(source);
    expect(entries.map((e) => e.pulse)).toEqual([0, 1, 4]);
    expect(entries.map((e) => e.length)).toEqual([300, 200, 100]);
    expect(source.reads).toBe(3);
  });

  it('is scanned when it was not closed', async () => {
    const whole = await readEntries(new Bytes(meshFile(frames)));
    expect(await readEntries(new Bytes(meshFile(frames, false)))).toEqual(whole);
  });

  it('is scanned no further when the scan is ended', async () => {
    const source = new Bytes(meshFile(Array.from({ length: 500 }, (_, n) => [n, frame(n, 100_000)]), false));
    const parts: number[] = [];
    const entries = await readEntries(source, (part) => parts.push(part) < 4);
    expect(source.reads).toBe(5); // two to look for the index, three of the scan
    expect(parts.every((part, n) => n === 0 || part > parts[n - 1])).toBe(true);
    expect(entries.length).toBeGreaterThan(20);
    expect(entries.length).toBeLessThan(40);
  });

  it('lists the complete frames after a power cut', async () => {
    const torn = meshFile(frames, false).slice(0, -1);
    expect((await readEntries(new Bytes(torn))).map((e) => e.pulse)).toEqual([0, 1]);
  });

  it('lists frames that a restarted daemon appended after an unfinished mesh or an index', async () => {
    const later = record(7, frame(4, 400));
    const pulses = async (bytes: Uint8Array) => (await readEntries(new Bytes(bytes))).map((e) => e.pulse);
    expect(await pulses(join(meshFile(frames, false).slice(0, -1), later))).toEqual([0, 1, 7]);
    expect(await pulses(join(meshFile(frames), later))).toEqual([0, 1, 4, 7]);
  });

  it('ignores a damaged index', async () => {
    const bytes = meshFile(frames);
    const whole = await readEntries(new Bytes(bytes));
    bytes[bytes.length - 64] ^= 1; // in the last record but one
    expect(await readEntries(new Bytes(bytes))).toEqual(whole);
  });

  /** Changes the index of a closed file, and makes its checksum right again. */
  function changeIndex(bytes: Uint8Array, change: (index: Uint8Array) => void) {
    const footer = new DataView(bytes.buffer, bytes.length - 24);
    const index = bytes.subarray(Number(footer.getBigUint64(0, true)), bytes.length - 24);
    change(index);
    footer.setUint32(12, crc32(index), true);
    return bytes;
  }

  it('is scanned when its index breaks a rule of the format', async () => {
    const whole = await readEntries(new Bytes(meshFile(frames)));
    const entry = (index: Uint8Array, n: number) => new DataView(index.buffer, index.byteOffset + 8 + 24 * n, 24);
    const changes: ((index: Uint8Array) => void)[] = [
      (index) => index.set(join(index.slice(32, 56), index.slice(8, 32)), 8), // two entries are exchanged
      (index) => entry(index, 1).setBigInt64(0, 0n, true), // the pulse does not increase
      (index) => entry(index, 0).setBigInt64(0, -1n, true),
      (index) => entry(index, 0).setBigUint64(8, 0n, true), // in the header
      (index) => entry(index, 2).setBigUint64(8, 16n, true), // before the entry before
    ];
    for (const change of changes) expect(await readEntries(new Bytes(changeIndex(meshFile(frames), change)))).toEqual(whole);
  });

  it('is scanned past a record with a negative pulse', async () => {
    const head = join(text('V3DR'), fields(300, BigInt.asUintN(64, -5n), crc32(frame(9, 300))));
    const bytes = meshFile(frames, false);
    const negative = join(head, fields(crc32(head)), frame(9, 300));
    const entries = await readEntries(new Bytes(join(bytes.slice(0, 16), negative, bytes.slice(16))));
    expect(entries.map((e) => e.pulse)).toEqual([0, 1, 4]);
  });

  it('of another version is rejected with a text of its own', async () => {
    for (const at of [8, 12]) {
      const bytes = meshFile(frames);
      bytes[at] = 2;
      await expect(readEntries(new Bytes(bytes))).rejects.toThrow('of a version that this page does not support');
    }
  });

  it('is rejected when it is not a mesh file', async () => {
    await expect(readEntries(new Bytes(text('a page that says 404, not a mesh file')))).rejects.toThrow('not a mesh file');
  });
});

describe('the store of frames', () => {
  const large: [number, Uint8Array][] = Array.from({ length: 40 }, (_, n) => [n, frame(n, 100_000)]);

  it('returns every frame, and fetches a megabyte at a time', async () => {
    const source = new Bytes(meshFile(large));
    const store = new FrameStore(source, await readEntries(source));
    const before = source.reads;
    for (let n = 0; n < 40; ++n) expect((await store.frame(n))[0]).toBe(n);
    expect(source.reads - before).toBe(4);
  });

  it('repeats a failed request', async () => {
    const source = new Bytes(meshFile(frames));
    const store = new FrameStore(source, await readEntries(source));
    const read = source.read.bind(source);
    source.read = () => Promise.reject(new Error('offline'));
    await expect(store.frame(0)).rejects.toThrow('offline');
    source.read = read;
    expect((await store.frame(0)).length).toBe(300);
  });

  it('keeps a limited number of chunks during playback', async () => {
    const source = new Bytes(meshFile(large));
    const store = new FrameStore(source, (await readEntries(source)).flatMap((e) => Array(40).fill(e)));
    const held = (store as unknown as { held: Map<number, unknown> }).held;
    for (let n = 0; n < 1600; n += 5) await store.frame(n);
    expect(held.size).toBeLessThanOrEqual(8);
  });
});

describe('frames and pulses', () => {
  it('show the previous mesh for a pulse without a mesh', () => {
    const entries = [0, 1, 4].map((pulse) => ({ pulse }));
    expect([-1, 0, 1, 3, 4, 9].map((pulse) => entryAt(entries, pulse))).toEqual([0, 0, 1, 1, 2, 2]);
  });

  it('of another version are rejected with a remedy', () => {
    const ofVersion = (version: number) => {
      const compact = join(text('V3DF\r\n\x1a\n'), fields(version), new Uint8Array(116));
      new DataView(compact.buffer).setBigInt64(40, 25n, true);
      return compact;
    };
    expect(() => keyPulseOf(ofVersion(1))).toThrow('v3dctl reconstruct');
    expect(keyPulseOf(ofVersion(2))).toBe(25);
    expect(keyPulseOf(ofVersion(5))).toBe(25);
    expect(() => keyPulseOf(ofVersion(6))).toThrow('update V3D');
  });

  it('that are none are reported as a damaged file or a replaced one', () => {
    expect(() => keyPulseOf(frame(0, 200))).toThrow('damaged, or the file was replaced on the server');
    expect(() => keyPulseOf(new Uint8Array(100))).toThrow('damaged, or the file was replaced on the server');
  });

  it('beyond the end of a file that became shorter are reported as those of a replaced file', async () => {
    vi.stubGlobal('fetch', async () => new Response(null, { status: 416 }));
    await expect(new HttpSource('mesh.v3d').read(9000, 10)).rejects.toThrow('shorter than before');
    vi.unstubAllGlobals();
  });
});

describe('a damaged mesh', () => {
  it('whose key frame would be later than itself is reported', async () => {
    const damaged = keyFrame(5, 200);
    new DataView(damaged.buffer).setBigInt64(40, 7n, true);
    const bytes = meshFile([[4, keyFrame(4, 200)], [5, damaged], [7, keyFrame(7, 200)]]);
    let pulse = -1;
    const decoder = { wantViews: () => undefined, decode: (record: Uint8Array) => ((pulse = record[40]), 0), frame: () => ({ pulse }) };
    const source = new Bytes(bytes);
    const sequence = new TakeSequence(decoder as never, new FrameStore(source, await readEntries(source)));
    await sequence.show(0, () => false);
    await expect(sequence.show(1, () => false)).rejects.toThrow('Mesh 1 of this take is damaged.');
  });
});
