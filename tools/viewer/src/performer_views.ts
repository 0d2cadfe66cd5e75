// Keeps a performer told of what the cameras of its take see, as far as anybody wants to know and the server can tell.
import type { Performer } from './performer';
import { fetchThere, PulseStore } from './pulse_store';
import { parseVertexViews, type VertexViews } from './vertex_views';

/** Of a scene's take or a take of the studio: its name, as its meshes are fetched from takes/NAME/mesh.v3d. */
export const takeOfMeshes = (url: string) => decodeURIComponent(new URL(url).pathname.split('/').slice(-2)[0]);

async function fetchViews(take: string, pulse: number): Promise<VertexViews | null> {
  const answer = await fetchThere(`api/takes/${encodeURIComponent(take)}/views/${pulse}`);
  if (!answer) return null;
  const views = parseVertexViews(await answer.arrayBuffer());
  if (!views) throw new Error('The server answers what this page does not understand.');
  return views;
}

/** 'none': of the pulse that is shown there are none; 'coming': they are asked for. */
export type ViewsState = 'here' | 'coming' | 'none';

export class PerformerViews {
  private readonly store: PulseStore<VertexViews>;
  private shown = -1;
  private ahead: number[] = [];

  constructor(
    take: string,
    private readonly performer: Performer,
    /** Whether anybody looks at it in a way that wants them. */
    private readonly wanted: () => boolean,
    private readonly changed: () => void,
  ) {
    this.store = new PulseStore<VertexViews>({
      fetch: (pulse) => fetchViews(take, pulse),
      ready: (pulse) => {
        if (pulse === this.shown) this.apply();
      },
    });
  }

  /** The performer shows this pulse now; `ahead` are the next ones, where they are known. */
  show(pulse: number, ahead: number[] = []): void {
    this.shown = pulse;
    this.ahead = ahead;
    this.apply();
  }

  /** After every show(), and when the look has changed. */
  apply(): void {
    if (this.shown < 0 || !this.wanted()) return;
    this.store.want(this.shown, this.ahead);
    this.performer.setViews(this.store.get(this.shown) ?? null);
    this.changed();
  }

  get state(): ViewsState {
    if (this.performer.hasViews) return 'here';
    return this.store.get(this.shown) === undefined ? 'coming' : 'none';
  }

  get tookMs(): number {
    return this.store.tookMs;
  }

  end(): void {
    this.store.end();
    this.performer.setViews(null);
  }
}
