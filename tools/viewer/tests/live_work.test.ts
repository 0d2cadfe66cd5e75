import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { MALFORMED, NEEDS_REFERENCE, OK, OUT_OF_MEMORY, type Frame } from '../../../codec/v3d_decoder.mjs';
import { Unavailable } from '../player/src/byte_source';
import type { FromWorker } from '../player/src/worker_messages';
import { LiveWork } from '../src/live_work';

/** The socket that the work has opened. */
class FakeSocket {
  static last: FakeSocket;
  static readonly OPEN = 1;
  readyState = FakeSocket.OPEN;
  sent: string[] = [];
  onopen = () => {};
  onmessage = (_: { data: ArrayBuffer | string }) => {};
  onclose = () => {};
  closed = false;
  constructor() {
    FakeSocket.last = this;
  }
  send(text: string): void {
    this.sent.push(text);
  }
  close(): void {
    this.closed = true;
  }
}

/** Decodes a frame to a point at x = its pulse. */
class FakeDecoder {
  decoded: number[] = [];
  /** Pulses of frames whose reference was lost. */
  withoutReference: number[] = [];
  /** Statuses of frames that cannot be decoded, by pulse. */
  failures = new Map<number, number>();
  labels: Uint8Array | null = null;
  decode(bytes: Uint8Array): number {
    const failure = this.failures.get(bytes[0]);
    if (failure !== undefined) return failure;
    if (this.withoutReference.includes(bytes[0])) return NEEDS_REFERENCE;
    this.decoded.push(bytes[0]);
    return OK;
  }
  frame(): Frame {
    const pulse = this.decoded.at(-1)!;
    const positions = new Float32Array([pulse, 0, 0]);
    return { pulse, cameras: [], quality: NaN, positions, colours: null, labels: this.labels, indices: new Uint32Array() } as unknown as Frame;
  }
}

/** A message of v3d-viewd with a frame that is no key frame. */
function meshMessage(pulse: number, edgeMs: number | null): ArrayBuffer {
  const head = new TextEncoder().encode(JSON.stringify({ type: 'mesh', number: pulse, take: 'fight', pulse, edge_ms: edgeMs, missing: [] }));
  const message = new Uint8Array(4 + head.length + 1);
  new DataView(message.buffer).setUint32(0, head.length, true);
  message.set(head, 4);
  message[4 + head.length] = pulse;
  return message.buffer;
}

describe('live meshes', () => {
  let decoder: FakeDecoder;
  let work: LiveWork;
  let sent: number[];
  let edges: (number | null | undefined)[];
  let performers: (Uint8Array | null)[];
  let links: string[];
  let troubles: string[];
  let post: (message: FromWorker) => void;

  beforeEach(async () => {
    vi.useFakeTimers();
    vi.stubGlobal('WebSocket', FakeSocket);
    decoder = new FakeDecoder();
    sent = [];
    edges = [];
    performers = [];
    links = [];
    troubles = [];
    post = (message: FromWorker) => {
      if (message.kind === 'link') links.push(message.link);
      if (message.kind === 'trouble') troubles.push(message.text);
      if (message.kind !== 'frame') return;
      sent.push(message.frame.pulse);
      edges.push(message.frame.live?.edgeMs);
      performers.push(message.frame.performers);
    };
    work = new LiveWork(async () => decoder, post, 1, 'ws://studio/live');
    await work.open();
  });
  afterEach(() => {
    work.end();
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const receive = (pulse: number, edgeMs: number | null = null) => {
    FakeSocket.last.onmessage({ data: meshMessage(pulse, edgeMs) });
    vi.advanceTimersByTime(40);
  };

  it('are all decoded, and the page gets the newest one after it has drawn the last', () => {
    for (let pulse = 1; pulse <= 5; ++pulse) receive(pulse);
    expect(decoder.decoded).toEqual([1, 2, 3, 4, 5]);
    expect(sent).toEqual([1]);
    work.drawn();
    expect(sent).toEqual([1, 5]);
    work.drawn();
    expect(sent).toEqual([1, 5]); // nothing is sent twice
    receive(6);
    expect(sent).toEqual([1, 5, 6]);
  });

  it('all reach a page that draws each before the next arrives', () => {
    for (let pulse = 1; pulse <= 3; ++pulse) {
      receive(pulse);
      work.drawn();
    }
    expect(sent).toEqual([1, 2, 3]);
  });

  it('keep their labels of performers', () => {
    decoder.labels = Uint8Array.of(2);
    receive(1);
    expect(performers).toEqual([Uint8Array.of(2)]);
  });

  it('are shown again after frames without their reference', () => {
    decoder.withoutReference = [2, 3];
    for (let pulse = 1; pulse <= 5; ++pulse) {
      receive(pulse);
      work.drawn();
    }
    expect(sent).toEqual([1, 4, 5]);
  });

  it('that cannot be decoded are reported once, and again after another mesh or another connection', () => {
    for (const pulse of [1, 2, 4]) decoder.failures.set(pulse, MALFORMED);
    decoder.withoutReference = [3];
    for (const pulse of [1, 2, 3]) receive(pulse);
    expect(troubles).toEqual(['The live meshes are damaged, or newer than this page: reload the page.']);
    FakeSocket.last.onopen();
    receive(4);
    expect(troubles).toHaveLength(2);
    receive(5);
    expect(sent).toEqual([5]);
    decoder.failures.set(6, OUT_OF_MEMORY);
    receive(6);
    expect(troubles[2]).toBe('The browser has too little memory for the live meshes.');
    expect(troubles).toHaveLength(3);
    receive(7);
    decoder.failures.set(8, MALFORMED);
    receive(8); // the page still draws pulse 5
    work.drawn();
    expect(sent).toEqual([5, 7]);
    expect(troubles).toHaveLength(5); // pulse 7 removed the text of pulse 8
  });

  it('have the edge of their pulse in the time of the page, whose clock differs from that of the server', () => {
    const now = () => performance.timeOrigin + performance.now();
    const AHEAD_MS = 5000; // the clock of the server
    FakeSocket.last.onopen();
    const ping = /^ping (\d+)$/.exec(FakeSocket.last.sent.at(-1)!);
    FakeSocket.last.onmessage({ data: JSON.stringify({ type: 'pong', ping: Number(ping![1]), now_ms: now() + AHEAD_MS }) });
    const edge = now() - 120;
    receive(1, edge + AHEAD_MS);
    expect(Math.abs(edges[0]! - edge)).toBeLessThan(1); // the ping has whole milliseconds
    work.drawn();
    receive(2);
    expect(edges[1]).toBeNull();
  });

  it('have the edge of their pulse in the time of the page also after it has slept, in which its clock stood still', () => {
    const now = () => performance.timeOrigin + performance.now();
    /** A ping that takes `took` ms to a server whose clock is `ahead`. */
    const ping = (ahead: number, took: number) =>
      FakeSocket.last.onmessage({ data: JSON.stringify({ type: 'pong', ping: now() - took, now_ms: now() - took / 2 + ahead }) });
    const SLEPT_MS = 3_600_000;
    FakeSocket.last.onopen();
    for (let n = 0; n < 10; ++n) ping(5000, 4);
    FakeSocket.last.onclose();
    vi.advanceTimersByTime(1000);
    FakeSocket.last.onopen();
    ping(5000 + SLEPT_MS, 40);
    const edge = now() - 120;
    receive(1, edge + 5000 + SLEPT_MS);
    expect(Math.abs(edges[0]! - edge)).toBeLessThanOrEqual(20);
  });

  it('are connected again when the server answers no ping, without an end of the connection', () => {
    const silent = FakeSocket.last;
    silent.onopen();
    expect(links).toEqual(['connecting', 'open']);
    vi.advanceTimersByTime(10_000);
    expect(links).toEqual(['connecting', 'open', 'connecting']);
    expect(silent.closed).toBe(true);
    expect(FakeSocket.last).not.toBe(silent);
    FakeSocket.last.onopen();
    expect(links.at(-1)).toBe('open');
  });

  it('stay connected while pings are answered and nothing is recorded', () => {
    const socket = FakeSocket.last;
    socket.onopen();
    for (let second = 0; second < 60; second += 2) {
      socket.onmessage({ data: JSON.stringify({ type: 'pong', ping: 0, now_ms: 0 }) });
      vi.advanceTimersByTime(2000);
    }
    expect(FakeSocket.last).toBe(socket);
    expect(links).toEqual(['connecting', 'open']);
  });

  it('are connected again when no answer comes to the connection', () => {
    const first = FakeSocket.last;
    vi.advanceTimersByTime(10_000);
    expect(FakeSocket.last).not.toBe(first);
  });

  it('are connected when the decoder can be fetched', async () => {
    work.end();
    troubles = [];
    let calls = 0;
    work = new LiveWork(async () => {
      if (++calls < 2) throw new Unavailable('The server is busy (503).');
      return decoder;
    }, post, 1, 'ws://studio/live');
    const before = FakeSocket.last;
    void work.open();
    await vi.advanceTimersByTimeAsync(10);
    expect(troubles).toEqual(['The server is busy (503).']);
    await vi.advanceTimersByTimeAsync(1000);
    expect(FakeSocket.last).not.toBe(before);
  });

  it('have no edge before the clock of the server is known', () => {
    receive(1, 1000);
    expect(edges).toEqual([null]);
  });
});
