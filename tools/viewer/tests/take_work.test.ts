import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Unavailable } from '../player/src/byte_source';
import { TakeWork } from '../player/src/take_work';
import type { FromWorker } from '../player/src/worker_messages';
import { keyFrame, meshFile } from './mesh_bytes';

vi.mock('../../../codec/v3d_decoder.mjs', () => ({
  OK: 0,
  NEEDS_REFERENCE: 2,
  OUT_OF_MEMORY: 3,
  Motion: class {
    segments = [{ pulses: [5, 6], vertices: 3, triangles: 1 }];
  },
  Decoder: class {
    private pulse = 0;
    wantViews = () => undefined;
    decode(bytes: Uint8Array): number {
      this.pulse = bytes[40];
      return 0;
    }
    frame = () => ({
      pulse: this.pulse, cameras: [], quality: NaN, positions: new Float32Array(), colours: null, labels: null, indices: new Uint32Array(),
    });
  },
}));

/** Frames of more than a megabyte, so that each is a request of its own. */
const SIZE = 1_100_000;
const FILE = meshFile([0, 1, 2].map((pulse) => [pulse, keyFrame(pulse, SIZE)]));
const frameAt = (first: number) => Math.floor(first / SIZE);

type Answer = (signal: AbortSignal) => Response | Promise<Response>;

describe('a take that is played', () => {
  let posted: FromWorker[];
  /** Answers in place of those of the file: for a frame, or for 'size'. */
  let faults: Map<number | 'size', Answer>;
  let requests: number;
  let afterRequest: () => unknown;
  let file: Uint8Array;
  /** Of motion.v3d; null: there is none. */
  let motion: Uint8Array | null;
  /** Offsets of the parts of motion.v3d that were requested; answers of the next requests in place of those of the file. */
  let motionParts: number[];
  let motionFaults: Answer[];
  let wasm: () => Promise<WebAssembly.Module>;
  let work: TakeWork;

  beforeEach(() => {
    vi.useFakeTimers();
    posted = [];
    faults = new Map();
    requests = 0;
    afterRequest = () => undefined;
    file = FILE;
    motion = null;
    motionParts = [];
    motionFaults = [];
    wasm = async () => ({}) as WebAssembly.Module;
    vi.stubGlobal('fetch', async (url: string, { method, headers, signal }: { method?: string; headers: { Range: string }; signal: AbortSignal }) => {
      ++requests;
      afterRequest();
      if (url.endsWith('motion.v3d')) return motionAnswer(method, headers, signal);
      if (method === 'HEAD') return faults.get('size')?.(signal) ?? new Response(null, { headers: { 'Content-Length': String(file.length) } });
      const [first, last] = headers.Range.slice('bytes='.length).split('-').map(Number);
      const isFrame = last - first > SIZE / 2;
      return (isFrame && faults.get(frameAt(first))?.(signal)) || new Response(file.slice(first, last + 1), { status: 206 });
    });
    work = takeWork();
  });
  afterEach(() => {
    work.end();
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const motionAnswer = (method: string | undefined, headers: { Range: string }, signal: AbortSignal) => {
    const fault = motionFaults.shift();
    if (fault) return fault(signal);
    if (!motion) return new Response(null, { status: 404 });
    if (method === 'HEAD') return new Response(null, { headers: { 'Content-Length': String(motion.length) } });
    const [first, last] = headers.Range.slice('bytes='.length).split('-').map(Number);
    motionParts.push(first);
    return new Response(motion.slice(first, last + 1), { status: 206 });
  };
  const takeWork = (deadlineMs?: number) =>
    new TakeWork(wasm, (message) => posted.push(message), 1, 'http://studio/takes/a/mesh.v3d', deadlineMs);
  const shown = () => posted.flatMap((message) => (message.kind === 'frame' ? [message.frame.number] : []));
  const troubles = () => posted.flatMap((message) => (message.kind === 'trouble' ? [message.text] : []));
  const pass = (ms: number) => vi.advanceTimersByTimeAsync(ms);
  const status = (code: number) => () => new Response(null, { status: code });

  it('shows the frame that is requested while another one fails', async () => {
    await work.open();
    let fail = (_: Response) => {};
    faults.set(1, () => new Promise((done) => (fail = done)));
    work.want(1);
    await pass(10);
    work.want(2);
    fail(new Response(null, { status: 416 }));
    await pass(10);
    expect(troubles()).toEqual([expect.stringContaining('shorter than before')]);
    expect(shown()).toEqual([2]);
  });

  it('shows a frame of a busy server when it answers, and reports the failure once', async () => {
    await work.open();
    faults.set(1, status(503));
    work.want(1);
    await pass(3500);
    expect(troubles()).toEqual(['The server is busy (503).']);
    faults.clear();
    await pass(1000);
    expect(shown()).toEqual([1]);
    const before = requests;
    await pass(60_000);
    expect(requests).toBe(before);
  });

  it('shows a frame when the network is there again', async () => {
    await work.open();
    faults.set(1, () => Promise.reject(new TypeError('Failed to fetch')));
    work.want(1);
    await pass(10);
    faults.clear();
    await pass(1000);
    expect(shown()).toEqual([1]);
  });

  it('repeats no request for a frame that is no longer requested, and none after a permanent error', async () => {
    await work.open();
    faults.set(1, status(503)).set(2, status(416));
    work.want(1);
    await pass(10);
    work.want(2);
    await pass(10);
    const before = requests;
    await pass(60_000);
    expect(requests).toBe(before);
    expect(shown()).toEqual([]);
  });

  it('is opened when the server is busy no more', async () => {
    faults.set('size', status(503));
    void work.open();
    work.want(2);
    await pass(5000);
    expect(troubles()[0]).toBe('The server is busy (503).');
    faults.clear();
    await pass(1000);
    expect(shown()).toEqual([2]);
  });

  it('is opened when the decoder can be fetched, with meshes and without', async () => {
    for (const sizeFault of [undefined, status(404)]) {
      if (sizeFault) faults.set('size', sizeFault);
      motion = new Uint8Array(10);
      let calls = 0;
      wasm = async () => {
        if (++calls < 3) throw new Unavailable('The server is busy (503).');
        return {} as WebAssembly.Module;
      };
      posted = [];
      work = takeWork();
      void work.open();
      await pass(10);
      expect(troubles()).toEqual(['The server is busy (503).']);
      await pass(3000);
      expect(posted.at(-1)).toMatchObject({ kind: 'opened', tracked: sizeFault !== undefined });
      work.end();
    }
    expect(motionParts).toEqual([0]);
  });

  it('without an index is read with reports, and not after another take was opened', async () => {
    const unclosed = meshFile(Array.from({ length: 10 }, (_, n) => [n, keyFrame(n, SIZE)]), false);
    file = unclosed;
    await work.open();
    expect(posted.filter(({ kind }) => kind === 'scan').length).toBeGreaterThan(5);
    expect(posted.at(-1)).toMatchObject({ kind: 'opened', pulses: [0, 1, 2, 3, 4, 5, 6, 7, 8, 9] });
    const all = requests;
    requests = 0;
    posted = [];
    work = takeWork();
    afterRequest = () => requests === all - 5 && work.end();
    await work.open();
    expect(requests).toBe(all - 5);
    expect(posted.every(({ kind }) => kind === 'scan')).toBe(true);
  });

  /** The bytes of frame 1 that a slow server sends, `size` at a time. It stops after `pieces`. */
  const slow = (size: number, pieces: number, everyMs: number) => (signal: AbortSignal) => {
    const bytes = keyFrame(1, SIZE);
    const body = new ReadableStream({
      start(stream) {
        signal.addEventListener('abort', () => stream.error(signal.reason));
        for (let n = 0; n < pieces; ++n) {
          setTimeout(() => {
            stream.enqueue(bytes.slice(n * size, (n + 1) * size));
            if ((n + 1) * size >= bytes.length) stream.close();
          }, n * everyMs);
        }
      },
    });
    return new Response(body, { status: 206 });
  };

  it('requests a frame again whose server stops in its middle', async () => {
    await work.open();
    faults.set(1, slow(10, 1, 0));
    work.want(1);
    await pass(14_000);
    expect(troubles()).toEqual([]);
    await pass(1500);
    expect(troubles()).toEqual(['The server sent nothing for 15 s.']);
    faults.clear();
    await pass(1000);
    expect(shown()).toEqual([1]);
  });

  it('waits for a frame of a slow server as long as bytes arrive', async () => {
    await work.open();
    faults.set(1, slow(SIZE / 5, 5, 10_000));
    work.want(1);
    await pass(60_000);
    expect(troubles()).toEqual([]);
    expect(shown()).toEqual([1]);
  });

  it('ends its requests when another take is opened', async () => {
    await work.open();
    const signals: AbortSignal[] = [];
    faults.set(1, (signal) => {
      signals.push(signal);
      return slow(10, 1, 0)(signal);
    });
    motionFaults = [(signal) => {
      signals.push(signal);
      return new Promise(() => undefined);
    }];
    work.want(1);
    work.setMotion('http://studio/takes/a/motion.v3d');
    await pass(10);
    expect(signals.map(({ aborted }) => aborted)).toEqual([false, false]);
    work.end();
    await pass(10);
    expect(signals.map(({ aborted }) => aborted)).toEqual([true, true]);
    expect(troubles()).toEqual([]);
  });

  const OFFLINE = () => Promise.reject(new TypeError('Failed to fetch'));
  const PART = 4 << 20;

  it('without meshes is opened when the server is busy no more, and no part is fetched twice', async () => {
    faults.set('size', status(404));
    motion = new Uint8Array(PART + 10);
    motionFaults = [status(503), OFFLINE];
    void work.open();
    await pass(10);
    expect(troubles()).toEqual(['The server is busy (503).']);
    await pass(1500);
    motionFaults = [OFFLINE];
    await pass(5000);
    expect(posted.at(-1)).toMatchObject({ kind: 'opened', pulses: [5, 6], tracked: true });
    expect(motionParts).toEqual([0, PART]);
  });

  it('without meshes is opened also when its tracked surface is requested meanwhile', async () => {
    faults.set('size', status(404));
    motion = new Uint8Array(PART + 10);
    let answer = (_: Response) => {};
    motionFaults = [() => new Response(null, { headers: { 'Content-Length': String(PART + 10) } }), () => new Promise((done) => (answer = done))];
    const opened = work.open();
    await pass(10);
    work.setMotion('http://studio/takes/a/motion.v3d'); // the user presses M
    answer(new Response(motion.slice(0, PART), { status: 206 }));
    await pass(10);
    await opened;
    expect(posted.at(-1)).toMatchObject({ kind: 'opened', pulses: [5, 6], tracked: true });
  });

  it('without meshes and without a motion file says so', async () => {
    faults.set('size', status(404));
    await expect(work.open()).rejects.toThrow('This take has no meshes yet.');
  });

  it('shows its tracked surface when the network is there again, and says what is missing until then', async () => {
    await work.open();
    motion = new Uint8Array(PART + 10);
    afterRequest = () => {
      if (motionParts.length === 1) motionFaults.push(OFFLINE);
      afterRequest = () => undefined;
    };
    motionFaults = [OFFLINE];
    work.setMotion('http://studio/takes/a/motion.v3d');
    await pass(10);
    expect(posted.at(-1)).toMatchObject({ kind: 'motion-trouble', fatal: false, text: expect.stringContaining('does not answer') });
    await pass(5000);
    expect(posted.at(-1)).toMatchObject({ kind: 'motion-opened' });
    expect(motionParts).toEqual([0, PART]);
  });

  it('fails with a deadline, for a player', async () => {
    work = takeWork(10_000);
    faults.set('size', status(503));
    await expect(work.open()).rejects.toThrow('busy');
  });
});
