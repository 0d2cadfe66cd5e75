// A WebSocket that is opened again after its end, and after a silence: when a network fails, no end of the connection arrives.

const RECONNECT_MS = 1000;

export interface SocketEvents {
  opened(): void;
  message(data: string | ArrayBuffer): void;
  /** The connection has ended, or the server has been silent for too long. The socket connects again after a second. */
  lost(): void;
}

/** Address of a WebSocket of the page's server. */
export function socketUrl(path: string): string {
  const url = new URL(path, location.href);
  url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
  return url.href;
}

export class ReconnectingSocket {
  private socket: WebSocket | null = null;
  /** Ends the silence, or the pause before the next connection. */
  private timer: ReturnType<typeof setTimeout> | undefined;

  /** `maxSilenceMs`: the longest time without a message of the server. */
  constructor(
    private readonly url: string,
    private readonly maxSilenceMs: number,
    private readonly events: SocketEvents,
  ) {
    this.connect();
  }

  /** Sends nothing while the connection is not open. */
  send(text: string): void {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(text);
  }

  end(): void {
    clearTimeout(this.timer);
    this.drop();
  }

  private connect(): void {
    const socket = new WebSocket(this.url);
    socket.binaryType = 'arraybuffer';
    socket.onopen = () => {
      this.awaitMessage();
      this.events.opened();
    };
    socket.onmessage = (event) => {
      this.awaitMessage();
      this.events.message(event.data as string | ArrayBuffer);
    };
    socket.onclose = () => this.lose();
    this.socket = socket;
    this.awaitMessage();
  }

  private awaitMessage(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.lose(), this.maxSilenceMs);
  }

  private lose(): void {
    this.drop();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.connect(), RECONNECT_MS);
    this.events.lost();
  }

  /** Forgets the connection, whose end may arrive much later. */
  private drop(): void {
    const { socket } = this;
    this.socket = null;
    if (!socket) return;
    socket.onopen = socket.onmessage = socket.onclose = null;
    socket.close();
  }
}
