// Reader of mesh files, mesh.v3d (docs/compact-frame.md). It fetches frames in chunks, some seconds in advance.
import type { ByteSource } from './byte_source';
import { crc32 } from './crc32';

export interface FrameEntry {
  pulse: number;
  /** Offset of the compact frame in the file. */
  offset: number;
  length: number;
}

const HEADER = 16;
const RECORD = 24;
const FOOTER = 24;
const VERSION = 1;
const MAX_FRAME_BYTES = 268_435_456;
const MAX_INDEX_BYTES = 67_108_864;
const CHUNK = 1 << 20;
const CHUNKS_KEPT = 8;

const view = (bytes: Uint8Array) => new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
const number64 = (data: DataView, at: number) => Number(data.getBigUint64(at, true));
const magic = (bytes: Uint8Array, at: number) => String.fromCharCode(...bytes.subarray(at, at + 4));

/**
 * Called before each request of a scan, which reads the whole file. `part`: 0 to 1, of the file before it. False ends the scan.
 */
export type OnScan = (part: number) => boolean;

/** A pulse is not negative. JavaScript has exact integers below 2^53. */
const isPulse = (pulse: number) => Number.isSafeInteger(pulse);

/** Reads the index at the end; scans the file if it was not closed. A scan that `onScan` ends returns the frames so far. */
export async function readEntries(source: ByteSource, onScan: OnScan = () => true): Promise<FrameEntry[]> {
  const size = await source.size();
  if (size < HEADER) throw new Error('This is not a mesh file.');
  const head = await source.read(0, HEADER);
  if (magic(head, 0) !== 'V3DM') throw new Error('This is not a mesh file.');
  if (view(head).getUint32(8, true) !== VERSION || view(head).getUint32(12, true) !== 0) {
    throw new Error('This mesh file is of a version that this page does not support; update V3D.');
  }
  return (await indexed(source, size)) ?? scanned(source, size, onScan);
}

async function indexed(source: ByteSource, size: number): Promise<FrameEntry[] | null> {
  if (size < HEADER + 8 + FOOTER) return null;
  const footer = await source.read(size - FOOTER, FOOTER);
  if (magic(footer, 16) !== 'V3DE') return null;
  const offset = number64(view(footer), 0);
  const length = view(footer).getUint32(8, true);
  if (offset + length !== size - FOOTER || length < 8 || length > MAX_INDEX_BYTES) return null;
  const index = await source.read(offset, length);
  if (magic(index, 0) !== 'V3DI' || crc32(index) !== view(footer).getUint32(12, true)) return null;
  const data = view(index);
  const count = data.getUint32(4, true);
  if (length !== 8 + 24 * count) return null;
  const entries = Array.from({ length: count }, (_, n) => ({
    pulse: number64(data, 8 + 24 * n),
    offset: number64(data, 16 + 24 * n) + RECORD,
    length: data.getUint32(24 + 24 * n, true),
  }));
  return entries.every((_, n) => isValidEntry(entries, n, offset)) ? entries : null;
}

/** The rules of docs/compact-frame.md for entry `n`. `end`: where the index begins. */
function isValidEntry(entries: FrameEntry[], n: number, end: number): boolean {
  const { pulse, offset, length } = entries[n];
  const first = HEADER + RECORD;
  // Records follow each other, so entries of increasing pulses have increasing offsets.
  const follows = n === 0 || (pulse > entries[n - 1].pulse && offset >= entries[n - 1].offset + entries[n - 1].length + RECORD);
  return isPulse(pulse) && follows && offset >= first && length <= MAX_FRAME_BYTES && offset + length <= end;
}

interface FileRecord extends FrameEntry {
  /** Offset of the record in the file. */
  at: number;
  crc: number;
}

class ScanEnded extends Error {}

/** Finds records by their heads. It keeps the last chunk that was read. */
class RecordScan {
  private held = new Uint8Array();
  private from = 0;

  constructor(
    private readonly source: ByteSource,
    readonly size: number,
    private readonly onScan: OnScan,
  ) {}

  /** Reads `length` bytes at `at`; fewer only at the end of the file. Throws ScanEnded. */
  private async bytes(at: number, length: number): Promise<Uint8Array> {
    if (at < this.from || at + length > this.from + this.held.length) {
      if (!this.onScan(at / this.size)) throw new ScanEnded();
      this.from = at;
      this.held = new Uint8Array(await this.source.read(at, Math.min(Math.max(CHUNK, length), this.size - at)));
    }
    return this.held.subarray(at - this.from, at - this.from + length);
  }

  async recordAt(at: number): Promise<FileRecord | null> {
    if (at + RECORD > this.size) return null;
    const head = await this.bytes(at, RECORD);
    if (head.length < RECORD || magic(head, 0) !== 'V3DR') return null;
    const data = view(head);
    const length = data.getUint32(4, true);
    const right = crc32(head.subarray(0, 20)) === data.getUint32(20, true) && length <= MAX_FRAME_BYTES;
    const pulse = number64(data, 8);
    if (!right || !isPulse(pulse) || at + RECORD + length > this.size) return null;
    return { at, pulse, offset: at + RECORD, length, crc: data.getUint32(16, true) };
  }

  /** The same rule as in MeshFileReader: an unfinished record may contain the head of an appended one. */
  async isWhole(record: FileRecord): Promise<boolean> {
    const end = record.offset + record.length;
    if (end === this.size || (await this.recordAt(end))) return true;
    const next = await this.bytes(end, Math.min(4, this.size - end));
    if (next.length === 4 && magic(next, 0) === 'V3DI') return true;
    return crc32(await this.bytes(record.offset, record.length)) === record.crc;
  }

  /** Offset of the next record from `from` on; the end of the file if there is none. */
  async next(from: number): Promise<number> {
    for (let at = from; at + RECORD <= this.size; ) {
      const chunk = await this.bytes(at, Math.min(CHUNK, this.size - at));
      for (let i = chunk.indexOf(0x56); i >= 0; i = chunk.indexOf(0x56, i + 1)) {
        const possible = i + 4 > chunk.length || magic(chunk, i) === 'V3DR';
        if (possible && (await this.recordAt(at + i))) return at + i;
      }
      at += chunk.length;
    }
    return this.size;
  }
}

/** Scans a file that was not closed or was continued after a restart. Other bytes than records are skipped. */
async function scanned(source: ByteSource, size: number, onScan: OnScan): Promise<FrameEntry[]> {
  const entries: FrameEntry[] = [];
  try {
    await addEntries(entries, new RecordScan(source, size, onScan));
  } catch (error) {
    if (!(error instanceof ScanEnded)) throw error;
  }
  return entries;
}

async function addEntries(entries: FrameEntry[], scan: RecordScan): Promise<void> {
  let last = -1;
  for (let at = HEADER; at + RECORD <= scan.size; ) {
    const record = await scan.recordAt(at);
    if (!record || !(await scan.isWhole(record))) {
      at = await scan.next(at + 1);
      continue;
    }
    const { pulse, offset, length } = record;
    if (pulse > last) entries.push({ pulse, offset, length });
    last = Math.max(last, pulse);
    at = offset + length;
  }
}

/** Pulse of the key frame at which decoding of a compact frame must start. */
export function keyPulseOf(frame: Uint8Array): number {
  if (frame.length < 128 || magic(frame, 0) !== 'V3DF') {
    throw new Error('This mesh is damaged, or the file was replaced on the server since it was opened; open it again.');
  }
  const version = view(frame).getUint16(8, true);
  if (version < 2) throw new Error('These meshes are of an older version; run v3dctl reconstruct again.');
  if (version > 5) throw new Error('These meshes are of a newer version than this page; update V3D.');
  return number64(view(frame), 40);
}

/** Index of the last entry whose pulse is not greater; 0 if there is none. */
export function entryAt(entries: readonly { pulse: number }[], pulse: number): number {
  let low = 0;
  let high = entries.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (entries[middle].pulse <= pulse) low = middle + 1;
    else high = middle;
  }
  return Math.max(0, low - 1);
}

/** The compact frames of a mesh file, with the last chunks kept. */
export class FrameStore {
  /** Frames [first, end) of each chunk, in order. */
  private readonly chunks: { first: number; end: number }[] = [];
  private readonly chunkOf: number[] = [];
  private readonly held = new Map<number, Promise<Uint8Array>>();

  constructor(
    private readonly source: ByteSource,
    readonly entries: readonly FrameEntry[],
  ) {
    let bytes = Infinity;
    entries.forEach((entry, n) => {
      if (bytes + entry.length > CHUNK) {
        this.chunks.push({ first: n, end: n });
        bytes = 0;
      }
      bytes += entry.length + RECORD;
      this.chunks[this.chunks.length - 1].end = n + 1;
      this.chunkOf.push(this.chunks.length - 1);
    });
  }

  async frame(n: number): Promise<Uint8Array> {
    const { offset, length } = this.entries[n];
    const bytes = await this.chunk(this.chunkOf[n]);
    const at = offset - this.entries[this.chunks[this.chunkOf[n]].first].offset;
    return bytes.subarray(at, at + length);
  }

  /** Starts to fetch the chunk after that of a frame. */
  lookAhead(n: number): void {
    const next = this.chunkOf[n] + 1;
    if (next < this.chunks.length) this.chunk(next).catch(() => undefined);
  }

  private chunk(c: number): Promise<Uint8Array> {
    const known = this.held.get(c);
    if (known) {
      this.held.delete(c); // moves it to the end: the last used chunks are kept
      this.held.set(c, known);
      return known;
    }
    const first = this.entries[this.chunks[c].first];
    const last = this.entries[this.chunks[c].end - 1];
    const fetched = this.source.read(first.offset, last.offset + last.length - first.offset);
    fetched.catch(() => this.held.delete(c)); // the next call fetches it again
    this.held.set(c, fetched);
    if (this.held.size > CHUNKS_KEPT) this.held.delete(this.held.keys().next().value!);
    return fetched;
  }
}
