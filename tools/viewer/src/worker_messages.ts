import type { Surface } from './surface';

export type ToWorker =
  | { kind: 'take'; take: number; url: string }
  | { kind: 'want'; frame: number }
  | { kind: 'live'; take: number; url: string }
  | { kind: 'nothing' };

/** `take` is the number that it was opened with: what was opened before may still be on its way. */
export type FromWorker =
  | { kind: 'opened'; take: number; pulses: number[] }
  | { kind: 'trouble'; take: number; text: string }
  | { kind: 'link'; take: number; link: 'connecting' | 'open' }
  | { kind: 'frame'; take: number; frame: ShownFrame };

export interface ShownFrame extends Surface {
  /** Of the mesh file; live: counts those that came. */
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
  /** Of the pulse, by our clock: performance.timeOrigin + performance.now(). Null: not known. */
  edgeMs: number | null;
  /** Meshes that were not seen, since the connection began. */
  skipped: number;
}
