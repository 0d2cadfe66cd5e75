// The facts about the shown picture, in the bar on top (pulse, triangles, rate, latency), and texts over the stage.
import { formatBytes } from './take_list';
import type { ShownFrame } from '../player/src/worker_messages';

/** Seconds without a live mesh after which the shown one is called old. */
const MAX_SILENCE_S = 2;

const count = (number: number) => number.toLocaleString('en');

/** HTML of numbers only, without text from outside. */
export const factsHtml = (facts: string[]) => facts.join(' &nbsp; ');

export const sceneFacts = (seconds: number, takes: number, triangles: number) =>
  [`<b>${seconds.toFixed(2)} s</b>`, `${takes} takes`, `${count(triangles)} triangles`];

/** `perSecond`: shown frames. Of a live frame: `latencyMs`, null if it is unknown, and `shownS`, for how long it has been shown. */
export function frameFacts(frame: ShownFrame, perSecond: number, latencyMs: number | null, shownS: number): string[] {
  const facts = [`pulse <b>${frame.pulse}</b>`, `${count(frame.indices.length / 3)} triangles`, ...trackedFacts(frame)];
  if (frame.bytes) facts.push(formatBytes(frame.bytes));
  if (perSecond > 0) facts.push(`<b>${perSecond.toFixed(0)}</b>/s`);
  if (!Number.isNaN(frame.quality)) facts.push(`quality ${(100 * frame.quality).toFixed(0)} %`);
  if (!frame.live) return facts;
  if (shownS > MAX_SILENCE_S) facts.push(`no mesh for <b>${shownS.toFixed(0)} s</b>`);
  else if (latencyMs !== null) facts.push(`<b>${latencyMs.toFixed(0)} ms</b> behind the pulse`);
  if (frame.live.missing.length) facts.push(`without ${frame.live.missing.length} cameras`);
  if (frame.live.skipped) facts.push(`${frame.live.skipped} skipped`);
  return facts;
}

function trackedFacts(frame: ShownFrame): string[] {
  if (!frame.tracked) return [];
  const { segment, segments } = frame.tracked;
  return ['<b>tracked</b>', `segment ${segment + 1} of ${segments}`, `${count(frame.positions.length / 3)} vertices`];
}

/** Rate and latency of the shown frames. */
export class FrameMeter {
  /** Of the last live frame; null: unknown. */
  latencyMs: number | null = null;
  private times: number[] = [];
  private last = 0;

  /** A frame is shown; times of the page, ms. */
  add(now: number): void {
    this.times.push(now);
    this.last = now;
  }

  /** Time since the last frame. */
  ageMs = (now: number) => now - this.last;

  facts(frame: ShownFrame, now: number): string[] {
    while (this.times.length && this.times[0] < now - 2000) this.times.shift();
    return frameFacts(frame, this.times.length / 2, this.latencyMs, this.ageMs(now) / 1000);
  }
}

/** `part` of a mesh file without an index was read. */
export const scanText = (file: string, part: number) =>
  `${file} was not closed, or the take is being recorded: reading the whole file, ${10 * Math.floor(10 * part)} % …`;

/** The state of the live picture; `isShown`: a mesh is on the stage. */
export function linkText(link: 'connecting' | 'open', isShown: boolean): string {
  if (link === 'connecting') return 'The studio does not answer. Trying again every second.';
  return isShown ? '' : 'Nothing is recorded at the moment. Meshes show here as soon as pulses run.';
}

/** After this time without a mesh, the picture is not live. The same as LiveFeed::kMaxAge (daemon/viewd/web_streams.h). */
export const MAX_LIVE_AGE_MS = 5000;

/** `ageMs`: time since the last mesh was shown. `trouble` is empty while the picture is live. */
export function liveTexts(take: string, ageMs: number): { title: string; trouble: string } {
  if (ageMs <= MAX_LIVE_AGE_MS) return { title: `Live: ${take}`, trouble: '' };
  return {
    title: `Last live mesh: ${take}`,
    trouble: `No mesh of ${take} for more than 5 s: the take has ended, or its meshes are delayed. The last one is shown.`,
  };
}
