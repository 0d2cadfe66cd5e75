import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Refusal } from '../src/request';
import { MAX_SKELETON_BYTES } from '../src/skeleton_file';
import { fetchSkeletons } from '../src/skeleton_set';

const SKELETON = JSON.stringify({
  format: 'v3d-skeleton', version: 1, rate_hz: 25, stature_m: 1.7, joints: [{ name: 'pelvis', parent: null }],
  pulses: [{ pulse: 3, positions: [[0, 0, 1]], rotations: [[1, 0, 0, 0]], confidences: [1] }],
  skins: [{ pulses: [3], vertices: 1, weights: btoa(String.fromCharCode(0, 0, 0, 0, 255, 0, 0, 0)) }],
});
const EDIT = '{"format": "v3d-edit", "version": 1, "operations": [{"do": "mirror"}]}';

describe('the skeletons of a take', () => {
  /** By the name of the file. */
  let files: Map<string, () => Response | Promise<Response>>;

  beforeEach(() => {
    files = new Map([['skeleton.json', () => new Response(SKELETON)], ['edit.json', () => new Response(EDIT)]]);
    const performers = () => [...files.keys()].flatMap((file) => (file === 'skeleton.json' ? 1 : /performer(\d+)/.exec(file)?.[1] ?? []));
    files.set('skeletons', () => Response.json({ performers: performers().map(Number) }));
    vi.stubGlobal('fetch', async (url: string) => files.get(url.split('/').at(-1)!)?.() ?? new Response(null, { status: 404 }));
  });
  afterEach(() => vi.unstubAllGlobals());
  const fetched = () => fetchSkeletons('http://studio/takes/a/');

  it('are those of all performers, with the operations of an edited take', async () => {
    files.set('skeleton.performer2.json', () => new Response(SKELETON));
    const { skeletons, operations, troubles } = await fetched();
    expect(skeletons.map(({ performer, at }) => [performer, [...at.keys()]])).toEqual([[1, [3]], [2, [3]]]);
    expect(operations).toEqual([{ do: 'mirror' }]);
    expect(troubles).toEqual([]);
  });

  it('are those of all performers, although one between them has none', async () => {
    files.set('skeleton.performer3.json', () => new Response(SKELETON));
    expect((await fetched()).skeletons.map(({ performer }) => performer)).toEqual([1, 3]);
    files.delete('skeleton.json');
    expect((await fetched()).skeletons.map(({ performer }) => performer)).toEqual([3]);
  });

  it('are unknown while the server is busy or does not answer, for every file', async () => {
    for (const file of ['skeletons', 'skeleton.json', 'skeleton.performer2.json', 'edit.json']) {
      const there = files.get(file);
      files.set(file, () => new Response('too many open files; try again\n', { status: 503 }));
      await expect(fetched()).rejects.toThrow(Refusal);
      files.set(file, () => Promise.reject(new TypeError('Failed to fetch')));
      await expect(fetched()).rejects.toThrow('The studio does not answer.');
      if (there) files.set(file, there);
      else files.delete(file);
    }
  });

  it('without those that are invalid or too large, which are named', async () => {
    files.set('edit.json', () => new Response('{'));
    expect((await fetched()).troubles).toEqual([expect.stringMatching(/^edit\.json: /)]);
    files.set('skeleton.json', () => new Response('', { headers: { 'Content-Length': String(MAX_SKELETON_BYTES + 1) } }));
    expect(await fetched()).toEqual({ skeletons: [], operations: null, troubles: [expect.stringContaining('skeleton.json: has 134217729 bytes')] });
  });
});
