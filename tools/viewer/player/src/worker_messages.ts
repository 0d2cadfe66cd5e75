import type { CodedViews } from './camera_views';
import type { Surface } from './surface';

export type ToWorker =
  /** Address of v3d_decoder.wasm, first. Bundlers find addresses in the module of the page, not in that of a worker. */
  | { kind: 'decoder'; url: string }
  /** `deadlineMs`: the longest time that a response of the server may take; default: any. */
  | { kind: 'take'; take: number; url: string; deadlineMs?: number }
  /** A single motion file. */
  | { kind: 'tracked'; take: number; url: string; deadlineMs?: number }
  | { kind: 'want'; frame: number }
  | { kind: 'live'; take: number; url: string }
  /** The last live mesh is drawn. The worker sends the next one after this message. */
  | { kind: 'drawn' }
  /** Shows tracked surfaces of the open take; null: meshes. */
  | { kind: 'motion'; url: string | null }
  | { kind: 'points'; points: TrailPoint[] }
  /** Whether the next frames are sent with the views of cameras that they have. At first they are not. */
  | { kind: 'views'; wanted: boolean }
  | { kind: 'nothing' };

/** `take`: the number of the opening. Messages of an earlier opening may still arrive. */
export type FromWorker =
  /** `tracked`: the take has no meshes, as an edited one; its frames are tracked surfaces. */
  | { kind: 'opened'; take: number; pulses: number[]; tracked: boolean; segments: SegmentShape[] }
  /** A mesh file without an index is read whole to open it; `part` of it was read, 0 to 1. */
  | { kind: 'scan'; take: number; part: number }
  | { kind: 'trouble'; take: number; text: string }
  | { kind: 'link'; take: number; link: 'connecting' | 'open' }
  | { kind: 'frame'; take: number; frame: ShownFrame }
  /** Answers a request in place of a frame: the surface is damaged, and there is no mesh. */
  | { kind: 'no-surface'; take: number; number: number }
  | MotionMessage;

/** Sends a message from the worker. `moved`: the buffers that go with it without a copy. */
export type Post = (message: FromWorker, moved?: Transferable[]) => void;

/** A segment of a motion file, without its surfaces. */
export interface SegmentShape {
  pulses: number[];
  vertices: number;
  triangles: number;
}

export type MotionMessage =
  /** The file was read. */
  | { kind: 'motion-opened'; take: number }
  /** Sent before the first frame of another segment; completed() joins both. */
  | { kind: 'segment'; take: number; segment: TrackedSegment }
  /** Trails of the last frame. */
  | { kind: 'trails'; take: number; trails: Trail[] }
  /** `fatal`: no tracked surface can be shown. */
  | { kind: 'motion-trouble'; take: number; text: string; fatal: boolean };

export interface ShownFrame extends Surface {
  /** Number in the mesh file; live: number of received meshes. */
  number: number;
  pulse: number;
  /** Null: a mesh. A tracked surface is sent without its triangles. */
  tracked: Tracked | null;
  bytes: number;
  decodeMs: number;
  cameras: number;
  quality: number;
  /** Views of cameras in the compact frame; absent: none. */
  views?: CodedViews;
  live: LiveFacts | null;
}

export interface Tracked {
  /** Number of the segment, and of all segments of the file. */
  segment: number;
  segments: number;
  /** Colours of this pulse. */
  colours: Uint8Array | null;
}

export interface TrackedSegment {
  number: number;
  indices: Uint32Array;
  /** Colours of the template. */
  colours: Uint8Array | null;
}

/** A vertex whose path is drawn. */
export interface TrailPoint {
  segment: number;
  vertex: number;
}

export interface Trail {
  point: TrailPoint;
  /** x, y, z of the vertex at each of the last pulses, the shown one last: metres. */
  path: Float32Array;
}

export interface LiveFacts {
  take: string;
  missing: string[];
  /** Time of the pulse by our clock (performance.timeOrigin + performance.now()); null: unknown. */
  edgeMs: number | null;
  /** Meshes skipped since the connection began. */
  skipped: number;
}
