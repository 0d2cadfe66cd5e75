// Sound files of a take: their pulses, and their samples, read by ranges. Pure, apart from the requests.
import { type ByteSource, HttpSource } from '../player/src/byte_source';
import { fetchJson } from './request';

/** A sound file of a take that has a map of pulses (sound_json of v3d-viewd). */
export interface SoundFile {
  /** Relative to the folder of the take. */
  file: string;
  rate_hz: number;
  channels: number;
  samples: number;
  /** Channels with neither pulses nor timecode, from 1. */
  audible: number[];
  /** Knots of a piecewise linear map: pulse and sample, both ascending. At least two. */
  map: [number, number][];
}

/** Position of a pulse in the sound, samples: linear between knots and beyond the first and the last. */
export function sampleOf(map: readonly [number, number][], pulse: number): number {
  let low = 1;
  let high = map.length - 1;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (map[middle][0] > pulse) high = middle;
    else low = middle + 1;
  }
  const [[p0, s0], [p1, s1]] = [map[low - 1], map[low]];
  return s0 + ((pulse - p0) * (s1 - s0)) / (p1 - p0);
}

/** Samples of two sides, of full scale. */
export interface Stereo {
  left: Float32Array<ArrayBuffer>;
  right: Float32Array<ArrayBuffer>;
}

const BYTES = 3; // of a sample: the recorder writes 24-bit PCM

/** The audible channels of 24-bit PCM: odd ones are on the left, even ones on the right, a single one is on both sides. */
export function stereoOf(bytes: Uint8Array, channels: number, audible: readonly number[]): Stereo {
  const count = Math.floor(bytes.length / (BYTES * channels));
  const left = new Float32Array(count);
  const right = new Float32Array(count);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  audible.forEach((channel, n) => {
    const sides = audible.length === 1 ? [left, right] : [n % 2 === 0 ? left : right];
    for (let i = 0; i < count; ++i) {
      const at = BYTES * (i * channels + channel - 1);
      const value = (view.getUint16(at, true) + view.getInt8(at + 2) * 65536) / 8388608;
      for (const side of sides) side[i] += value;
    }
  });
  return { left, right };
}

/** Offset of the samples in a Broadcast Wave file (RIFF or RF64). Throws for another file, and for other samples than 24-bit PCM. */
export function dataOffset(head: Uint8Array, channels: number): number {
  const view = new DataView(head.buffer, head.byteOffset, head.byteLength);
  const name = (at: number) => String.fromCharCode(...head.subarray(at, at + 4));
  if (head.length < 12 || !['RIFF', 'RF64'].includes(name(0)) || name(8) !== 'WAVE') throw new Error('is no WAV file');
  for (let at = 12; at + 8 <= head.length; ) {
    if (name(at) === 'data') return at + 8;
    const size = view.getUint32(at + 4, true);
    if (name(at) === 'fmt ' && at + 24 <= head.length) {
      if (view.getUint16(at + 10, true) !== channels) throw new Error('has other channels than the ledger');
      if (view.getUint16(at + 22, true) !== 8 * BYTES) throw new Error('is no 24-bit PCM');
    }
    at += 8 + size + (size % 2);
  }
  throw new Error('has no samples in its first bytes');
}

const HEAD_BYTES = 8192;

/** Reads the samples of one sound file. */
export class SoundSource {
  private offset: Promise<number> | null = null;

  constructor(
    readonly file: SoundFile,
    private readonly source: ByteSource,
  ) {}

  /** Samples [first, end), silent before and after the file. */
  async read(first: number, end: number): Promise<Stereo> {
    const { channels, audible, samples } = this.file;
    const offset = (this.offset ??= this.readOffset());
    const size = BYTES * channels;
    const stereo = { left: new Float32Array(end - first), right: new Float32Array(end - first) };
    const begin = Math.max(0, first);
    const count = Math.min(end, samples) - begin;
    if (count <= 0) return stereo;
    const inside = stereoOf(await this.source.read((await offset) + begin * size, count * size), channels, audible);
    stereo.left.set(inside.left, begin - first);
    stereo.right.set(inside.right, begin - first);
    return stereo;
  }

  private readOffset(): Promise<number> {
    const offset = this.source.read(0, HEAD_BYTES).then((head) => dataOffset(head, this.file.channels));
    offset.catch(() => (this.offset = null)); // the next call reads it again
    return offset;
  }
}

/** The sound of a take; empty for a take without. Throws a message for the user. */
export async function fetchSound(take: string): Promise<SoundSource[]> {
  const sound = await fetchJson<{ files: SoundFile[] }>(`api/takes/${encodeURIComponent(take)}/sound`);
  return (sound?.files ?? []).map((file) => new SoundSource(file, new HttpSource(`takes/${encodeURIComponent(take)}/${file.file}`)));
}
