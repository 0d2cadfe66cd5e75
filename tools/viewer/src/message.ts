// Messages of v3d-viewd by WebSocket (daemon/viewd/view_json.h).

export interface MeshHead {
  type: 'mesh';
  number: number;
  take: string;
  pulse: number;
  edge_ms: number | null;
  sent_ms: number;
  silhouette_iou: number;
  coverage: number;
  cameras: number;
  missing: string[];
}

export interface PreviewHead {
  type: 'preview';
  camera: string;
  pulse: number;
  width: number;
  height: number;
  runs: number;
}

export interface NodeState {
  name: string;
  heard: boolean;
  cameras: string[];
  program?: string;
  version?: string;
  state?: string;
  take?: string;
  text?: string;
  values?: Record<string, number | null>;
}

export interface StudioState {
  type: 'state';
  studio: string;
  not_verified: string;
  watchers: number;
  control: boolean;
  /** When it was sent, by the server's clock. */
  sent_ms: number;
  nodes: NodeState[];
}

export interface StudioEvent {
  type: 'event';
  node: string;
  severity: 'info' | 'warning' | 'alarm';
  subject: string;
  text: string;
  sent_ms: number;
}

/** Report of the last order from any page of the studio. */
export interface OrderReport {
  type: 'order';
  number: number;
  by: string;
  at_ms: number;
  do: 'look' | 'arm' | 'start' | 'stop' | 'abort';
  take: string;
  text: string;
  under_way: boolean;
  status: number;
  lines: string[];
}

export interface Pong {
  type: 'pong';
  ping: number;
  now_ms: number;
}

/** Splits a binary message: length of the JSON, the JSON, bytes. Null when it is malformed. */
export function splitMessage<Head>(message: ArrayBuffer): { head: Head; bytes: Uint8Array } | null {
  if (message.byteLength < 4) return null;
  const length = new DataView(message).getUint32(0, true);
  if (length > message.byteLength - 4) return null;
  try {
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(message, 4, length))) as Head;
    return { head, bytes: new Uint8Array(message, 4 + length) };
  } catch {
    return null;
  }
}

/** Decodes a mask's runs (base/image/mask.h): LEB128 lengths, background first. Calls `run` for those of foreground. */
export function eachForegroundRun(runs: Uint8Array, run: (first: number, length: number) => void): void {
  let at = 0;
  let foreground = false;
  for (let n = 0; n < runs.length; foreground = !foreground) {
    let length = 0;
    for (let shift = 1; n < runs.length; shift *= 128) {
      const byte = runs[n++];
      length += (byte & 127) * shift;
      if (byte < 128) break;
    }
    if (foreground) run(at, length);
    at += length;
  }
}

/** The server's clock, estimated by the times in its messages: the message that took the shortest time counts. */
export class MessageClock {
  private offsets: number[] = [];

  /** Adds a message. Times in milliseconds: `sent` by the server's clock, `now` by ours. */
  add(sent: number, now: number): void {
    this.offsets.push(sent - now);
    if (this.offsets.length > 10) this.offsets.shift();
  }

  /** Converts our time to the server's, which is never ahead of it; null before the first message. */
  at(now: number): number | null {
    return this.offsets.length ? now + Math.max(...this.offsets) : null;
  }
}

/** The rounding of times in messages, and the drift of clocks over the last pings, ms. */
const CLOCK_SLACK_MS = 5;

/** Offset of the server's clock, estimated by pings: the fastest of the last ones is used. */
export class ServerClock {
  private samples: { took: number; offset: number }[] = [];

  /** Adds a ping. Times in milliseconds; `sent` and `now` by our clock, `server` by the server's. */
  add(sent: number, server: number, now: number): void {
    const sample = { took: now - sent, offset: server - (sent + now) / 2 };
    // Each offset is wrong by at most half of its time. Farther ones are from before a step of a clock: that of a page stands still
    // while a tablet sleeps.
    this.samples = this.samples.filter(({ took, offset }) => Math.abs(offset - sample.offset) <= (took + sample.took) / 2 + CLOCK_SLACK_MS);
    this.samples.push(sample);
    if (this.samples.length > 10) this.samples.shift();
  }

  /** Converts our time to the server's; null before the first ping. */
  at(now: number): number | null {
    if (this.samples.length === 0) return null;
    const best = this.samples.reduce((a, b) => (b.took < a.took ? b : a));
    return now + best.offset;
  }
}
