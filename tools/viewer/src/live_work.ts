// Live meshes of v3d-viewd: the newest complete one for the page.
import { type Decoder, OK, OUT_OF_MEMORY } from '../../../codec/v3d_decoder.mjs';
import { repeated } from '../player/src/byte_source';
import { type LiveFrame, LiveQueue } from '../player/src/sequence';
import { errorMessage, postFrame } from '../player/src/take_work';
import type { Post } from '../player/src/worker_messages';
import { type MeshHead, type Pong, ServerClock, splitMessage } from './message';
import { ReconnectingSocket } from './reconnecting_socket';

const PING_MS = 2000;
/** The server answers every ping. */
const MAX_SILENCE_MS = 4 * PING_MS;

/** `status`: of a mesh that could not be decoded. */
const troubleText = (status: number) => (status === OUT_OF_MEMORY
  ? 'The browser has too little memory for the live meshes.'
  : 'The live meshes are damaged, or newer than this page: reload the page.');

const now = () => performance.timeOrigin + performance.now();

/**
 * Keeps the connection to the live stream and decodes every mesh, because later ones need it. Sends the page the newest mesh, and
 * the next one after the page has drawn it: a page that draws slowly misses meshes, and those it draws are not late.
 */
export class LiveWork {
  private socket: ReconnectingSocket | null = null;
  private readonly queue = new LiveQueue<MeshHead>();
  private clock = new ServerClock();
  private readonly pings: ReturnType<typeof setInterval>;
  private decoder: Pick<Decoder, 'decode' | 'frame'> | null = null;
  private due = false;
  private ended = false;
  private last = -1;
  private skipped = 0;
  /** The last decoded mesh, until it is sent. */
  private newest: { frame: LiveFrame<MeshHead>; decodeMs: number } | null = null;
  private isDrawn = true;
  /** The failure that the page shows; OK: none. */
  private reported = OK;

  constructor(
    private readonly makeDecoder: () => Promise<Pick<Decoder, 'decode' | 'frame'>>,
    private readonly post: Post,
    private readonly take: number,
    private readonly url: string,
  ) {
    this.pings = setInterval(() => this.ping(), PING_MS);
  }

  async open(): Promise<void> {
    const trouble = (error: unknown) => this.post(errorMessage(this.take, error));
    this.decoder = await repeated(this.makeDecoder, () => this.ended, trouble);
    this.connect();
  }

  want(): void {}
  setMotion(): void {}
  setPoints(): void {}
  wantViews(): void {}

  /** The page has drawn the mesh that it got. */
  drawn(): void {
    this.isDrawn = true;
    this.send();
  }

  end(): void {
    this.ended = true;
    clearInterval(this.pings);
    this.socket?.end();
  }

  private connect(): void {
    if (this.ended) return;
    const link = (state: 'connecting' | 'open') => this.post({ kind: 'link', take: this.take, link: state });
    link('connecting');
    this.socket = new ReconnectingSocket(this.url, MAX_SILENCE_MS, {
      opened: () => {
        this.last = -1;
        this.clock = new ServerClock();
        this.reported = OK; // the page shows the state of the link instead
        link('open');
        this.ping();
      },
      message: (data) => this.onMessage(data),
      lost: () => link('connecting'),
    });
  }

  private ping(): void {
    this.socket?.send(`ping ${Math.round(now())}`);
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
    const frame = this.queue.decode(this.decoder);
    if (frame) this.newest = { frame, decodeMs: performance.now() - began };
    this.report(this.queue.failure);
    this.send();
  }

  /** Reports once that meshes cannot be decoded. The page removes the text with the next mesh. */
  private report(failure: number): void {
    if (failure === this.reported) return;
    this.reported = failure;
    if (failure !== OK) this.post({ kind: 'trouble', take: this.take, text: troubleText(failure) });
  }

  private send(): void {
    if (!this.isDrawn || !this.newest || this.ended) return;
    const { frame, decodeMs } = this.newest;
    this.newest = null;
    const decoded = this.decoder?.frame();
    if (!decoded) return; // memory was exhausted
    this.isDrawn = false;
    const { head, bytes } = frame;
    const there = this.clock.at(now());
    const edgeMs = head.edge_ms === null || there === null ? null : head.edge_ms - there + now();
    const live = { take: head.take, missing: head.missing, edgeMs, skipped: this.skipped };
    postFrame(this.post, this.take, decoded, { number: head.number, bytes: bytes.length, decodeMs, live });
    this.reported = OK; // the page has removed the text, also if this mesh is older than the failure
    this.report(this.queue.failure);
  }
}
