// Bytes of mesh files.
import { crc32 } from '../player/src/crc32';

export const text = (s: string) => Uint8Array.from(s, (c) => c.charCodeAt(0));
export function join(...parts: Uint8Array[]): Uint8Array {
  const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  parts.reduce((at, part) => (all.set(part, at), at + part.length), 0);
  return all;
}
/** Fields of four and eight bytes, little-endian. */
export function fields(...values: (number | bigint)[]): Uint8Array {
  return join(...values.map((value) => {
    const bytes = new Uint8Array(typeof value === 'bigint' ? 8 : 4);
    const data = new DataView(bytes.buffer);
    if (typeof value === 'bigint') data.setBigUint64(0, value, true);
    else data.setUint32(0, value, true);
    return bytes;
  }));
}

export function frame(n: number, size: number): Uint8Array {
  return new Uint8Array(size).fill(n);
}
export function record(pulse: number, payload: Uint8Array): Uint8Array {
  const head = join(text('V3DR'), fields(payload.length, BigInt(pulse), crc32(payload)));
  return join(head, fields(crc32(head)), payload);
}
const header = join(text('V3DM\r\n\x1a\n'), fields(1, 0));

export function meshFile(frames: [number, Uint8Array][], closed = true): Uint8Array {
  let at = 16;
  const entries: Uint8Array[] = [];
  const records = frames.map(([pulse, payload]) => {
    entries.push(fields(BigInt(pulse), BigInt(at), payload.length, crc32(payload)));
    at += 24 + payload.length;
    return record(pulse, payload);
  });
  if (!closed) return join(header, ...records);
  const index = join(text('V3DI'), fields(frames.length), ...entries);
  const footer = join(fields(BigInt(at), index.length, crc32(index)), text('V3DE\r\n\x1a\n'));
  return join(header, ...records, index, footer);
}

/** A compact frame that is a key frame, as far as the page reads it: `size` bytes, 128 at least. */
export function keyFrame(pulse: number, size: number): Uint8Array {
  const compact = join(text('V3DF\r\n\x1a\n'), fields(2), new Uint8Array(size - 12));
  new DataView(compact.buffer).setBigInt64(40, BigInt(pulse), true);
  return compact;
}
