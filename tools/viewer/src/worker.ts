// Worker that fetches and decodes surfaces: those of a take in any order, or live meshes as they arrive.
import moduleUrl from 'v3d_decoder.wasm?url';
import { Decoder } from '../../../codec/v3d_decoder.mjs';
import { LiveQueue } from '../player/src/sequence';
import { postFrame, TakeWork, troubleOf } from '../player/src/take_work';
import type { FromWorker, ToWorker } from '../player/src/worker_messages';
import { type MeshHead, type Pong, ServerClock, splitMessage } from './message';

const RECONNECT_MS = 1000;
const PING_MS = 2000;

const wasm = WebAssembly.compileStreaming(fetch(moduleUrl));
const now = () => performance.timeOrigin + performance.now();
const post = (message: FromWorker, moved: Transferable[] = []) => self.postMessage(message, { transfer: moved });

/** Keeps the connection to the live stream and shows the newest mesh. */
class LiveWork {
  private socket: WebSocket | null = null;
  private readonly queue = new LiveQueue<MeshHead>();
  private readonly clock = new ServerClock();
  private readonly pings: number;
  private decoder: Decoder | null = null;
  private due = false;
  private ended = false;
  private last = -1;
  private skipped = 0;

  constructor(
    private readonly take: number,
    private readonly url: string,
  ) {
    this.pings = self.setInterval(() => this.ping(), PING_MS);
  }

  async open(): Promise<void> {
    this.decoder = new Decoder(await wasm);
    this.connect();
  }

  want(): void {}
  setMotion(): void {}
  setPoints(): void {}
  wantViews(): void {}

  end(): void {
    this.ended = true;
    clearInterval(this.pings);
    this.socket?.close();
  }

  private connect(): void {
    if (this.ended) return;
    post({ kind: 'link', take: this.take, link: 'connecting' });
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.last = -1;
      post({ kind: 'link', take: this.take, link: 'open' });
      this.ping();
    };
    socket.onmessage = (event) => this.onMessage(event.data as string | ArrayBuffer);
    socket.onclose = () => setTimeout(() => this.connect(), RECONNECT_MS);
    this.socket = socket;
  }

  private ping(): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(`ping ${Math.round(now())}`);
  }

  private onMessage(data: string | ArrayBuffer): void {
    if (typeof data === 'string') {
      const pong = JSON.parse(data) as Pong;
      if (pong.type === 'pong') this.clock.add(pong.ping, pong.now_ms, now());
      return;
    }
    const message = splitMessage<MeshHead>(data);
    if (!message) return;
    if (this.last >= 0) this.skipped += message.head.number - this.last - 1;
    this.last = message.head.number;
    this.queue.push(message);
    if (this.due) return;
    this.due = true;
    setTimeout(() => this.decode()); // after the messages that have already arrived
  }

  private decode(): void {
    this.due = false;
    if (!this.decoder || this.ended) return;
    const began = performance.now();
    const shown = this.queue.decode(this.decoder);
    const frame = shown && this.decoder.frame();
    if (!shown || !frame) return;
    const { head } = shown;
    const there = this.clock.at(now());
    const edgeMs = head.edge_ms === null || there === null ? null : head.edge_ms - there + now();
    const live = { take: head.take, missing: head.missing, edgeMs, skipped: this.skipped };
    const decodeMs = performance.now() - began;
    postFrame(post, this.take, frame, { number: head.number, bytes: shown.bytes.length, decodeMs, live });
  }
}

let work: TakeWork | LiveWork | null = null;
let viewsWanted = false;

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  if (message.kind === 'want') return work?.want(message.frame);
  if (message.kind === 'motion') return work?.setMotion(message.url);
  if (message.kind === 'points') return work?.setPoints(message.points);
  if (message.kind === 'views') {
    viewsWanted = message.wanted;
    return work?.wantViews(viewsWanted);
  }
  work?.end();
  work = null;
  if (message.kind === 'take') work = new TakeWork(wasm, post, message.take, message.url);
  else if (message.kind === 'live') work = new LiveWork(message.take, message.url);
  else return;
  work.wantViews(viewsWanted);
  work.open().catch((error) => post(troubleOf(message.take, error)));
};
