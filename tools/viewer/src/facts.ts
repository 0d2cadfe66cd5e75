// The facts about the shown picture, in the bar on top: pulse, triangles, rate, latency.
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
