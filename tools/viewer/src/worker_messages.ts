import type { Surface } from './surface';

export type ToWorker =
  | { kind: 'take'; take: number; url: string }
  | { kind: 'want'; frame: number }
  | { kind: 'live'; take: number; url: string }
  | { kind: 'nothing' };

/** `take`: the number of the opening. Messages of an earlier opening may still arrive. */
export type FromWorker =
  | { kind: 'opened'; take: number; pulses: number[] }
  | { kind: 'trouble'; take: number; text: string }
  | { kind: 'link'; take: number; link: 'connecting' | 'open' }
  | { kind: 'frame'; take: number; frame: ShownFrame };

export interface ShownFrame extends Surface {
  /** Number in the mesh file; live: number of received meshes. */
  number: number;
  pulse: number;
  bytes: number;
  decodeMs: number;
  cameras: number;
  quality: number;
  live: LiveFacts | null;
}

export interface LiveFacts {
  take: string;
  missing: string[];
  /** Time of the pulse by our clock (performance.timeOrigin + performance.now()); null: unknown. */
  edgeMs: number | null;
  /** Meshes skipped since the connection began. */
  skipped: number;
}
