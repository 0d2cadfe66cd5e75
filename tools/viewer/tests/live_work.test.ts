import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { OK, type Frame } from '../../../codec/v3d_decoder.mjs';
import type { FromWorker } from '../player/src/worker_messages';
import { LiveWork } from '../src/live_work';

/** The socket that the work has opened. */
class FakeSocket {
  static last: FakeSocket;
  static readonly OPEN = 1;
  readyState = FakeSocket.OPEN;
  onopen = () => {};
  onmessage = (_: { data: ArrayBuffer }) => {};
  onclose = () => {};
  constructor() {
    FakeSocket.last = this;
  }
  send(): void {}
  close(): void {}
}

/** Decodes a frame to a point at x = its pulse. */
class FakeDecoder {
  decoded: number[] = [];
  decode(bytes: Uint8Array): number {
    this.decoded.push(bytes[0]);
    return OK;
  }
  frame(): Frame {
    const pulse = this.decoded.at(-1)!;
    const positions = new Float32Array([pulse, 0, 0]);
    return { pulse, cameras: [], quality: NaN, positions, colours: null, labels: null, indices: new Uint32Array() } as unknown as Frame;
  }
}

/** A message of v3d-viewd with a frame that is no key frame. */
function meshMessage(pulse: number): ArrayBuffer {
  const head = new TextEncoder().encode(JSON.stringify({ type: 'mesh', number: pulse, take: 'fight', pulse, edge_ms: null, missing: [] }));
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

  beforeEach(async () => {
    vi.useFakeTimers();
    vi.stubGlobal('WebSocket', FakeSocket);
    decoder = new FakeDecoder();
    sent = [];
    const post = (message: FromWorker) => {
      if (message.kind === 'frame') sent.push(message.frame.pulse);
    };
    work = new LiveWork(async () => decoder, post, 1, 'ws://studio/live');
    await work.open();
  });
  afterEach(() => {
    work.end();
    vi.useRealTimers();
    vi.unstubAllGlobals();
  });

  const receive = (pulse: number) => {
    FakeSocket.last.onmessage({ data: meshMessage(pulse) });
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
});
