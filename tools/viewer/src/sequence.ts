// Frames of one sequence, decoded: what is wanted, and as little as possible beside it.
import { Decoder, NEEDS_REFERENCE, OK, OUT_OF_MEMORY, type Frame } from '../../../codec/v3d_decoder.mjs';
import { entryAt, keyPulseOf, type FrameStore } from './mesh_file';
import { vertexNormals } from './surface';
import type { LiveFacts, ShownFrame } from './worker_messages';

/** Shows frames of a mesh file in any order. */
export class TakeSequence {
  private last = -1;

  constructor(
    private readonly decoder: Decoder,
    private readonly store: FrameStore,
  ) {}

  get length(): number {
    return this.store.entries.length;
  }

  /**
   * Decodes what frame n needs, and it. Stops and returns null when `obsolete()`, asked between frames, says so.
   * Throws where a frame is missing or damaged.
   */
  async show(n: number, obsolete: () => boolean): Promise<{ frame: Frame; bytes: number } | null> {
    const bytes = await this.store.frame(n);
    const key = this.keyOf(bytes);
    const from = this.last >= key && this.last < n ? this.last + 1 : key;
    for (let i = from; i <= n; ++i) {
      const status = this.decoder.decode(await this.store.frame(i));
      this.last = status === OK ? i : -1;
      if (status === OUT_OF_MEMORY) throw new Error('The browser has no memory left for this take.');
      if (status !== OK) throw new Error(`Mesh ${i} of this take is damaged.`);
      if (obsolete()) return null;
    }
    this.store.lookAhead(n);
    return { frame: this.decoder.frame()!, bytes: bytes.length };
  }

  private keyOf(bytes: Uint8Array): number {
    return entryAt(this.store.entries, keyPulseOf(bytes));
  }
}

export interface LiveFrame<Head> {
  head: Head;
  bytes: Uint8Array;
}

/** Live frames that wait to be decoded: a key frame makes all before it needless. */
export class LiveQueue<Head> {
  private waiting: LiveFrame<Head>[] = [];

  push(frame: LiveFrame<Head>): void {
    const data = new DataView(frame.bytes.buffer, frame.bytes.byteOffset, frame.bytes.byteLength);
    const isKey = frame.bytes.length >= 128 && (data.getUint16(16, true) & 4) === 0;
    if (isKey) this.waiting = [];
    this.waiting.push(frame);
  }

  /** Decodes all that waits; the last that could be decoded, or null. */
  decode(decoder: Decoder): LiveFrame<Head> | null {
    let shown: LiveFrame<Head> | null = null;
    for (const frame of this.waiting) {
      const status = decoder.decode(frame.bytes);
      if (status === OK) shown = frame;
      else if (status !== NEEDS_REFERENCE) shown = null;
    }
    this.waiting = [];
    return shown;
  }
}

/** What a frame is on the screen; its arrays are its own. */
export function shownFrame(
  frame: Frame,
  of: { number: number; bytes: number; decodeMs: number; live: LiveFacts | null },
): ShownFrame {
  return {
    ...of,
    pulse: frame.pulse,
    cameras: frame.cameras.length,
    quality: frame.quality,
    positions: frame.positions.slice(),
    normals: vertexNormals(frame.positions, frame.indices),
    colours: frame.colours?.slice() ?? null,
    indices: frame.indices.slice(),
  };
}
