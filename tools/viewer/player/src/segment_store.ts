// The segments of a delivery, fetched when they are needed.
import { MeshoptDecoder } from 'three/addons/libs/meshopt_decoder.module.js';
import { fetchFile } from './byte_source';
import { lineOf } from './clip';
import type { ManifestSegment } from './manifest';
import { PulseStore } from './pulse_store';
import { MAX_SEGMENT_BYTES, readSegment, type SegmentSurface } from './segment_file';
import type { SegmentShape } from './worker_messages';

const SEGMENTS_KEPT = 3;

/** Fetches segments and keeps the last ones. */
export class SegmentStore {
  private readonly store: PulseStore<SegmentSurface>;

  constructor(
    private readonly base: string,
    private readonly segments: readonly ManifestSegment[],
    private readonly shapes: readonly SegmentShape[],
    private readonly deadlineMs: number,
    ready: () => void,
    failed: (text: string) => void,
  ) {
    const fetch = (n: number) => this.fetch(n).catch((error: unknown) => {
      failed(lineOf(segments[n].surface, error, 'the file of the delivery'));
      return null;
    });
    this.store = new PulseStore({ fetch, ready, keep: SEGMENTS_KEPT });
  }

  /** The surface of a segment, and with it the next one; null: not there yet. */
  get(n: number): SegmentSurface | null {
    this.store.want(n, n + 1 < this.segments.length ? [n + 1] : []);
    return this.store.get(n) ?? null;
  }

  end(): void {
    this.store.end();
  }

  private async fetch(n: number): Promise<SegmentSurface> {
    const bytes = await fetchFile(new URL(this.segments[n].surface, this.base).href, MAX_SEGMENT_BYTES, this.deadlineMs);
    await MeshoptDecoder.ready;
    return readSegment(bytes, MeshoptDecoder, this.shapes[n]);
  }
}
