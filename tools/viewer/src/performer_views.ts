// Camera views for a performer, if the look needs them: those of its compact frame, otherwise those of the server.
import { bodyOf } from '../player/src/byte_source';
import type { CodedViews, VertexViews } from '../player/src/camera_views';
import type { Performer } from './performer';
import { PulseStore } from '../player/src/pulse_store';
import { fetchThere } from './request';
import { parseVertexViews } from './vertex_views';

/** Fetches the views of a take by its name, NAME in takes/NAME/mesh.v3d. */
export const takeOfMeshes = (url: string) => decodeURIComponent(new URL(url).pathname.split('/').slice(-2)[0]);

const MAX_VIEWS_BYTES = 1 << 30;

function fetchViews(take: string, pulse: number, signal: AbortSignal): Promise<VertexViews | 'too many' | null> {
  return fetchThere(`api/takes/${encodeURIComponent(take)}/views/${pulse}`, signal, async (response, progress) => {
    const views = parseVertexViews((await bodyOf(response, MAX_VIEWS_BYTES, progress)).buffer);
    if (!views) throw new Error('The answer of the server is malformed; reload the page.');
    return views;
  });
}

/** 'none': the shown pulse has no views; 'coming': they were requested; 'too many': the take has more cameras than the shader. */
export type ViewsState = 'here' | 'coming' | 'none' | 'too many';

export class PerformerViews {
  private readonly store: PulseStore<VertexViews>;
  private shown = -1;
  private ahead: number[] = [];
  private coded: CodedViews = null;
  /** The take has more cameras than the shader. Its views, which are expensive for the server, are not requested again. */
  private tooMany = false;

  constructor(
    take: string,
    private readonly performer: Performer,
    /** True when the look needs the views. */
    private readonly wanted: () => boolean,
    private readonly changed: () => void,
  ) {
    this.store = new PulseStore<VertexViews>({
      fetch: (pulse, signal) => this.fetch(take, pulse, signal),
      ready: (pulse) => {
        if (pulse === this.shown) this.apply();
      },
    });
  }

  private async fetch(take: string, pulse: number, signal: AbortSignal): Promise<VertexViews | null> {
    if (this.tooMany) return null;
    const views = await fetchViews(take, pulse, signal);
    if (views !== 'too many') return views;
    this.tooMany = true;
    return null;
  }

  /** To call when the performer shows this pulse; `ahead`: the next pulses, if known; `coded`: views of its frame. */
  show(pulse: number, ahead: number[] = [], coded: CodedViews = null): void {
    this.coded = coded;
    this.shown = pulse;
    this.ahead = ahead;
    this.apply();
  }

  /** To call after every show(), and when the look has changed. */
  apply(): void {
    if (this.shown < 0 || !this.wanted()) return;
    if (this.coded === null) this.store.want(this.shown, this.ahead);
    this.performer.setViews(this.coded === 'unread' ? null : (this.coded ?? this.store.get(this.shown) ?? null));
    this.changed();
  }

  get state(): ViewsState {
    if (this.performer.hasViews) return 'here';
    if (this.tooMany) return 'too many';
    if (this.coded !== null) return this.coded === 'unread' ? 'coming' : 'none';
    return this.store.get(this.shown) === undefined ? 'coming' : 'none';
  }

  /** Why the last request failed, which is repeated; '': it did not fail. */
  get trouble(): string {
    return this.store.trouble;
  }

  get tookMs(): number {
    return this.store.tookMs;
  }

  end(): void {
    this.store.end();
    this.performer.setViews(null);
  }
}
