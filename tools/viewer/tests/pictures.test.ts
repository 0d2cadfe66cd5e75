import { Vector4 } from 'three';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Unavailable } from '../player/src/byte_source';
import { ROW, type VertexViews } from '../player/src/camera_views';
import { codedViews, hasCodedViews } from '../player/src/coded_views';
import { distort, maxRadius2 } from '../src/lens';
import { Playback } from '../player/src/playback';
import { PulseStore } from '../player/src/pulse_store';
import type { Performer } from '../src/performer';
import { PerformerViews } from '../src/performer_views';
import { projectionOf, type RigCamera, worldFromCamera } from '../src/rig';
import { parseVertexViews } from '../src/vertex_views';

const camera = (distortion: number[], skew = 0): RigCamera => ({
  name: 'cam07', width: 1024, height: 768, matrix: [[900, skew, 500], [0, 910, 390], [0, 0, 1]], distortion,
  rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], translation: [0, 0, 0],
});

describe('a lens', () => {
  it('without distortion leaves everything where it is', () => {
    expect(distort(camera([]), 0.3, -0.2)).toEqual([0.3, -0.2]);
    expect(maxRadius2(camera([]))).toBeGreaterThan(1000);
  });

  // By hand, term by term of OpenCV's formula.
  const CASES: [string, number[], [number, number], [number, number]][] = [
    ['bends rays to its centre', [-0.28, 0.09, 0.0012, -0.0007], [0.35, -0.25], [0.3324370875, -0.2373255625]],
    ['divides by its second polynomial', [0, 0, 0, 0, 0, 0.1, 0, 0], [0.5, 0], [0.487804878, 0]],
    ['is a thin prism', [0, 0, 0, 0, 0, 0, 0, 0, 0.01, 0, 0, 0.02], [0.6, 0.8], [0.61, 0.82]],
  ];
  for (const [does, distortion, [x, y], wanted] of CASES) {
    it(does, () => {
      const [u, v] = distort(camera(distortion), x, y);
      expect(u).toBeCloseTo(wanted[0], 4);
      expect(v).toBeCloseTo(wanted[1], 4);
    });
  }

  it('follows the tilt of its sensor', () => {
    // tau_x rotates the sensor about x: the middle is unchanged, points above and below are scaled by another z.
    const [tau] = [0.1];
    const leaning = camera([0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, tau, 0]);
    expect(distort(leaning, 0, 0)).toEqual([0, 0]);
    const [u, v] = distort(leaning, 0.2, 0.3);
    const depth = Math.cos(tau) - 0.3 * Math.sin(tau);
    expect(u).toBeCloseTo((0.2 * Math.cos(tau)) / depth, 9);
    expect(v).toBeCloseTo((0.3 * (Math.cos(tau) ** 2 + Math.sin(tau) ** 2)) / depth, 9);
  });

  it('is not used beyond the radius where it folds back', () => {
    const max = maxRadius2(camera([-0.3, 0, 0, 0]));
    expect(max).toBeCloseTo(1 / 0.9, 1); // the derivative 1 - 0.9 r^2 is 0 there
  });

  it('with skew projects points as its image does', () => {
    const leaning = camera([], 12);
    const clip = new Vector4(0.3, -0.2, 1.5, 1).applyMatrix4(worldFromCamera(leaning).invert())
      .applyMatrix4(projectionOf(leaning, 1024, 768, 0.02, 200));
    expect((0.5 + clip.x / clip.w / 2) * 1024).toBeCloseTo(900 * 0.2 + 12 * (-0.2 / 1.5) + 500 + 0.5, 3);
  });
});

describe('views in a compact frame', () => {
  const frame = (vertices: number) => ({
    pulse: 7, cameras: ['a', 'b'], positions: new Float32Array(3 * vertices),
    views: [new Uint8Array(4 * vertices).fill(1), new Uint8Array(4 * vertices).fill(2)].map((colours) =>
      ({ axis: [0, 0, 1] as [number, number, number], colours })),
  });

  it('become a layer of texels for each camera', () => {
    const views = codedViews(frame(ROW + 1))!;
    expect(views.rows).toBe(2);
    expect(views.vertices).toBe(ROW + 1);
    expect(views.cameras.map(({ name }) => name)).toEqual(['a', 'b']);
    expect(views.texels.length).toBe(2 * 2 * ROW * 4);
    expect([...views.texels.subarray(4 * ROW, 4 * ROW + 5)]).toEqual([1, 1, 1, 1, 0]);
    expect(views.texels[2 * ROW * 4]).toBe(2);
  });

  it('are none where the frame has none', () => {
    expect(codedViews({ ...frame(3), views: null })).toBeNull();
    const head = new Uint8Array(128);
    expect(hasCodedViews(head)).toBe(false);
    head[16] = 32;
    expect(hasCodedViews(head)).toBe(true);
  });

  it('are not shown for more cameras than the shader has', () => {
    const { views } = frame(3);
    expect(codedViews({ ...frame(3), views: Array.from({ length: 65 }, () => views[0]) })).toBeNull();
  });
});

describe('a pulse store', () => {
  /** A store whose requests the test answers. */
  function storeByHand(more: { keep?: number; atOnce?: number } = {}) {
    const asked = new Map<number, { resolve(thing: string | null): void; reject(error: Error): void }>();
    const ready: number[] = [];
    const disposed: string[] = [];
    const store = new PulseStore<string>({
      fetch: (pulse) => new Promise((resolve, reject) => asked.set(pulse, { resolve, reject })),
      ready: (pulse) => ready.push(pulse),
      dispose: (thing) => disposed.push(thing),
      ...more,
    });
    const answer = async (pulse: number, thing: string | null = `of ${pulse}`) => {
      asked.get(pulse)!.resolve(thing);
      asked.delete(pulse);
      await new Promise((done) => setTimeout(done));
    };
    return { store, asked, ready, disposed, answer };
  }

  it('fetches each pulse once, the shown one first', async () => {
    const { store, asked, ready, answer } = storeByHand({ atOnce: 1 });
    store.want(5, [6]);
    store.want(5, [6]);
    expect([...asked.keys()]).toEqual([5]);
    await answer(5);
    expect([...asked.keys()]).toEqual([6]);
    expect(store.get(5)).toBe('of 5');
    expect(store.get(6)).toBeUndefined();
    expect(ready).toEqual([5]);
  });

  it('ends its requests when it ends', () => {
    const signals: AbortSignal[] = [];
    const store = new PulseStore<string>({
      fetch: (_, signal) => {
        signals.push(signal);
        return new Promise(() => undefined);
      },
      ready: () => undefined,
    });
    store.want(5, [6]);
    store.end();
    expect(signals.map(({ aborted }) => aborted)).toEqual([true, true]);
  });

  it('drops data that arrives too late', async () => {
    const { store, asked, ready, disposed, answer } = storeByHand({ atOnce: 1 });
    store.want(5);
    store.want(9);
    await answer(5);
    expect([ready, disposed, [...asked.keys()]]).toEqual([[], ['of 5'], [9]]);
  });

  it('has the reason why a request failed, until one succeeds', async () => {
    vi.useFakeTimers();
    try {
      const { store, asked } = storeByHand();
      store.want(5);
      asked.get(5)!.reject(new Error('a file cannot be read'));
      asked.delete(5);
      await vi.advanceTimersByTimeAsync(0);
      expect(store.trouble).toBe('a file cannot be read');
      await vi.advanceTimersByTimeAsync(1000);
      asked.get(5)!.resolve('of 5');
      await vi.advanceTimersByTimeAsync(0);
      expect([store.trouble, store.get(5)]).toEqual(['', 'of 5']);
    } finally {
      vi.useRealTimers();
    }
  });

  describe('whose requests fail', () => {
    beforeEach(() => void vi.useFakeTimers());
    afterEach(() => void vi.useRealTimers());
    const SECOND_MS = 1000;
    /** A store whose requests of the pulses in `faults` fail. `requests`: the pulse and the second of each request. */
    function failing(faults: Map<number, Error>) {
      const requests: [number, number][] = [];
      const began = Date.now();
      const store = new PulseStore<string>({
        fetch: async (pulse) => {
          requests.push([pulse, Math.round((Date.now() - began) / SECOND_MS)]);
          const fault = faults.get(pulse);
          if (fault) throw fault;
          return `of ${pulse}`;
        },
        ready: () => undefined,
      });
      return { store, requests };
    }
    const damaged = new Error('a file cannot be read');

    it('requests a damaged pulse again after 1, 2, 4, 8 and 16 s, then every 30 s', async () => {
      const { store, requests } = failing(new Map([[5, damaged]]));
      store.want(5);
      await vi.advanceTimersByTimeAsync(100 * SECOND_MS);
      expect(requests.map(([, second]) => second)).toEqual([0, 1, 3, 7, 15, 31, 61, 91]);
      store.end();
    });

    it('requests a pulse of a busy server again every second', async () => {
      const { store, requests } = failing(new Map([[5, new Unavailable('too many requests; try again')]]));
      store.want(5);
      await vi.advanceTimersByTimeAsync(4 * SECOND_MS);
      expect(requests.map(([, second]) => second)).toEqual([0, 1, 2, 3, 4]);
      store.end();
    });

    it('requests another pulse a second after it is wanted, whatever failed before', async () => {
      const { store, requests } = failing(new Map([[5, damaged]]));
      store.want(5);
      await vi.advanceTimersByTimeAsync(40 * SECOND_MS); // the next request is due at 61 s
      store.want(6);
      await vi.advanceTimersByTimeAsync(SECOND_MS);
      expect(requests.at(-1)).toEqual([6, 41]);
      expect(store.get(6)).toBe('of 6');
      store.end();
    });

    it('requests pulses at most once a second in playback of a damaged file', async () => {
      const pulses = Array.from({ length: 250 }, (_, n) => n);
      const { store, requests } = failing(new Map(pulses.map((pulse) => [pulse, damaged])));
      for (const pulse of pulses) {
        store.want(pulse);
        await vi.advanceTimersByTimeAsync(40);
      }
      expect(requests.length).toBeGreaterThan(5);
      expect(requests.length).toBeLessThan(12);
      store.end();
    });
  });

  it('does not repeat a request for a pulse without data', async () => {
    const { store, asked, answer } = storeByHand();
    store.want(5);
    await answer(5, null);
    store.want(5);
    expect(store.get(5)).toBeNull();
    expect(asked.size).toBe(0);
  });

  it('keeps a limited number of pulses, and frees them at its end', async () => {
    const { store, disposed, answer } = storeByHand({ keep: 2, atOnce: 1 });
    for (const pulse of [1, 2, 3]) {
      store.want(pulse);
      await answer(pulse);
    }
    expect(disposed).toEqual(['of 1']);
    store.end();
    expect(disposed).toEqual(['of 1', 'of 2', 'of 3']);
  });

  it('pauses after a failed request', async () => {
    const { store, asked } = storeByHand();
    store.want(5);
    asked.get(5)!.reject(new Error('The server answered 503.'));
    asked.delete(5);
    await new Promise((done) => setTimeout(done));
    store.want(5);
    expect(asked.size).toBe(0);
  });
});

describe('playback', () => {
  const entries = Array.from({ length: 20 }, (_, n) => ({ pulse: 10 + n }));

  it('returns the next pulses without those that end before they could arrive', () => {
    const playback = new Playback(entries, 25);
    expect(playback.ahead(2, 0)).toEqual([]);
    playback.playing = true;
    expect(playback.ahead(2, 0)).toEqual([11, 12]);
    expect(playback.ahead(2, 0.1)).toEqual([13, 14]);
    playback.speed = 2;
    expect(playback.ahead(2, 0)).toEqual([12, 14]);
  });

  it('continues at the in point after the out point in a loop', () => {
    const playback = new Playback(entries, 25);
    playback.playing = true;
    playback.seek(29);
    expect(playback.ahead(2, 0)).toEqual([10, 11]);
    playback.loop = false;
    expect(playback.ahead(2, 0)).toEqual([29]);
  });
});

describe('views of vertices', () => {
  function message(head: object, bytes: number[]): ArrayBuffer {
    const text = new TextEncoder().encode(JSON.stringify(head));
    const all = new Uint8Array(4 + text.length + bytes.length);
    new DataView(all.buffer).setUint32(0, text.length, true);
    all.set(text, 4);
    all.set(bytes, 4 + text.length);
    return all.buffer;
  }
  const axis = [0, 0, 1];
  const two = { pulse: 7, vertices: 5, cameras: [{ name: 'a', axis }, { name: 'b', axis }] };
  const crowd = { ...two, vertices: 0, cameras: Array.from({ length: 65 }, () => ({ name: 'a', axis })) };
  // a sees the first and the fifth, b the second at the rim of its silhouette.
  const bytes = [0b00000010, 0b10, 1, 2, 3, 4, 5, 6, 0b00000100, 0, 7, 8, 9];

  it('are in one layer for each camera', () => {
    const views = parseVertexViews(message(two, bytes)) as VertexViews;
    const texel = (camera: number, vertex: number) => [...views.texels.subarray(4 * (camera * ROW + vertex), 4 * (camera * ROW + vertex) + 4)];
    expect(views.rows).toBe(1);
    expect([0, 1, 2, 3, 4].map((vertex) => texel(0, vertex))).toEqual(
      [[1, 2, 3, 255], [0, 0, 0, 0], [0, 0, 0, 0], [0, 0, 0, 0], [4, 5, 6, 255]]);
    expect(texel(1, 1)).toEqual([7, 8, 9, 128]);
    expect(texel(1, 0)).toEqual([0, 0, 0, 0]);
  });

  it('fill as many rows as they need', () => {
    const many = { pulse: 0, vertices: ROW + 1, cameras: [{ name: 'a', axis }] };
    const views = parseVertexViews(message(many, new Array<number>(Math.ceil((ROW + 1) / 4)).fill(0))) as VertexViews;
    expect(views.rows).toBe(2);
    expect(views.texels.length).toBe(2 * ROW * 4);
  });

  it('are rejected when they are truncated, too long, or too many', () => {
    expect(parseVertexViews(message(two, bytes.slice(0, -1)))).toBeNull();
    expect(parseVertexViews(message(two, [...bytes, 0]))).toBeNull();
    expect(parseVertexViews(message({ ...two, vertices: 1e9 }, bytes))).toBeNull();
    expect(parseVertexViews(message({ ...two, vertices: -1 }, bytes))).toBeNull();
    expect(parseVertexViews(message({}, bytes))).toBeNull();
    expect(parseVertexViews(new ArrayBuffer(3))).toBeNull();
    expect(parseVertexViews(message(crowd, []))).toBe('too many');
  });

  it('are requested once of a take with more cameras than the shader has', async () => {
    const request = vi.fn(async () => new Response(message(crowd, [])));
    vi.stubGlobal('fetch', request);
    const performer = { hasViews: false, setViews: () => undefined } as unknown as Performer;
    const views = new PerformerViews('dome', performer, () => true, () => undefined);
    for (const pulse of [7, 8]) {
      views.show(pulse);
      await new Promise((done) => setTimeout(done));
      expect(views.state).toBe('too many');
    }
    expect(request).toHaveBeenCalledTimes(1);
    vi.unstubAllGlobals();
    views.end();
  });
});
