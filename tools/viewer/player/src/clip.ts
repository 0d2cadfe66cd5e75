// The sources that the player plays: a file of surfaces, or a delivery with video.
import type { Mesh } from 'three';

/** Calls of a clip to its player. */
export interface ClipEvents {
  /** Another pulse is shown. */
  shown(): void;
  ended(): void;
  /** The clip cannot continue. `text`: one line with what, where, and what would be right. */
  failed(text: string): void;
}

/** One thread: that of the page. Times are seconds from the first pulse. */
export interface Clip {
  /** The surface in the world of its take: metres, z up. */
  readonly mesh: Mesh;
  readonly duration: number;
  readonly currentTime: number;
  /** The pulse on the screen; -1: none yet. */
  readonly pulse: number;
  readonly paused: boolean;
  readonly hasSound: boolean;
  loop: boolean;
  muted: boolean;
  volume: number;
  /** Rejects with a NotAllowedError when the browser requires a gesture first. At the end it starts again. */
  play(): Promise<void>;
  pause(): void;
  seek(seconds: number): void;
  /** To call for every picture of the screen. */
  update(seconds: number): void;
  dispose(): void;
}

/** Last part of the path of a URL, for messages. */
export const fileNameOf = (url: string) => new URL(url).pathname.split('/').pop() || url;

/** One line for an error of a file. Sentences lose their capital and full stop after the name. */
export function lineOf(file: string, error: unknown, right: string): string {
  const text = (error instanceof Error ? error.message : String(error)).replace(/\.$/, '').replace(/\s+/g, ' ');
  return `${file}: ${text.charAt(0).toLowerCase()}${text.slice(1)}${right && !text.includes('expected') ? `; expected ${right}` : ''}`;
}
