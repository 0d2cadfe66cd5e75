// Decoding of the requested frames of a sequence, with as few other frames as possible.
import { Decoder, NEEDS_REFERENCE, OK, OUT_OF_MEMORY, type Frame } from '../../../../codec/v3d_decoder.mjs';
import type { CodedViews } from './camera_views';
import { codedViews, hasCodedViews } from './coded_views';
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

  /** Whether show() decodes the views of cameras. */
  wantViews(wanted: boolean): void {
    if (wanted && !this.views) this.last = -1; // they begin at a key frame
    this.views = wanted;
    this.decoder.wantViews(wanted);
  }
  private views = false;

  get length(): number {
    return this.store.entries.length;
  }

  /**
   * Decodes frame n and the frames it depends on. Returns null when `obsolete()`, called between frames, is true.
   * Throws when a frame is missing or damaged.
   */
  async show(n: number, obsolete: () => boolean): Promise<{ frame: Frame; bytes: number; views: CodedViews } | null> {
    const bytes = await this.store.frame(n);
    const key = this.keyOf(bytes);
    if (key > n) throw new Error(`Mesh ${n} of this take is damaged.`);
    const from = this.last >= key && this.last < n ? this.last + 1 : key;
    for (let i = from; i <= n; ++i) {
      const status = this.decoder.decode(await this.store.frame(i));
      this.last = status === OK ? i : -1;
      if (status === OUT_OF_MEMORY) throw new Error('The browser has too little memory for this take.');
      if (status !== OK) throw new Error(`Mesh ${i} of this take is damaged.`);
      if (obsolete()) return null;
    }
    this.store.lookAhead(n);
    const frame = this.decoder.frame()!;
    return { frame, bytes: bytes.length, views: !hasCodedViews(bytes) ? null : this.views ? codedViews(frame) : 'unread' };
  }

  private keyOf(bytes: Uint8Array): number {
    return entryAt(this.store.entries, keyPulseOf(bytes));
  }
}

export interface LiveFrame<Head> {
  head: Head;
  bytes: Uint8Array;
}

/** Queue of live frames before decoding. A key frame drops all before it. */
export class LiveQueue<Head> {
  private waiting: LiveFrame<Head>[] = [];
  /** Why the last frame with its reference could not be decoded: a status of the decoder; OK: it was decoded. */
  failure = OK;

  push(frame: LiveFrame<Head>): void {
    const data = new DataView(frame.bytes.buffer, frame.bytes.byteOffset, frame.bytes.byteLength);
    const isKey = frame.bytes.length >= 128 && (data.getUint16(16, true) & 4) === 0;
    if (isKey) this.waiting = [];
    this.waiting.push(frame);
  }

  /** Decodes all queued frames; returns the last decoded one, or null. */
  decode(decoder: Pick<Decoder, 'decode'>): LiveFrame<Head> | null {
    let shown: LiveFrame<Head> | null = null;
    for (const frame of this.waiting) {
      const status = decoder.decode(frame.bytes);
      if (status === NEEDS_REFERENCE) continue;
      this.failure = status;
      shown = status === OK ? frame : null;
    }
    this.waiting = [];
    return shown;
  }
}

/** Copies a decoded frame for the screen. */
export function shownFrame(
  frame: Frame,
  of: { number: number; bytes: number; decodeMs: number; live: LiveFacts | null; views?: CodedViews },
): ShownFrame {
  return {
    ...of,
    pulse: frame.pulse,
    tracked: null,
    cameras: frame.cameras.length,
    quality: frame.quality,
    positions: frame.positions.slice(),
    normals: vertexNormals(frame.positions, frame.indices),
    colours: frame.colours?.slice() ?? null,
    indices: frame.indices.slice(),
    performers: frame.labels?.slice() ?? null,
  };
}
