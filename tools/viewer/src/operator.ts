// What an operator may do now, and what came of what he did. Pure.
import { valueOf } from './judge';
import type { NodeState, OrderReport } from './message';

export type Phase = 'silent' | 'idle' | 'armed' | 'recording' | 'draining';
export type Action = 'arm' | 'start' | 'stop' | 'abort' | 'verdict';

export interface Doing {
  phase: Phase;
  take: string;
}

/** What all nodes together are at: who is farthest into a take says it. */
export function doingOf(nodes: readonly NodeState[]): Doing {
  for (const phase of ['recording', 'draining', 'armed'] as const) {
    const at = nodes.filter((node) => node.heard && node.state === phase);
    if (at.length) return { phase, take: at.find((node) => node.take)?.take ?? '' };
  }
  return { phase: nodes.some((node) => node.heard) ? 'idle' : 'silent', take: '' };
}

/** A take that ended by itself was started here and not stopped: its verdict was told to nobody. */
const endedByItself = (last: OrderReport | null) => last?.do === 'start' && last.status === 0;

/** The answer to an order may come later than what the socket tells of it, and then says that it is still under way. */
export const isNews = (answer: OrderReport, last: OrderReport | null) => !last || answer.number > last.number;

/** What makes sense now; nothing while an order is under way. */
export function actionsIn(phase: Phase, last: OrderReport | null): Action[] {
  if (last?.under_way) return [];
  switch (phase) {
    case 'idle':
      return endedByItself(last) ? ['verdict', 'arm'] : ['arm'];
    case 'armed':
      return ['start', 'abort'];
    case 'recording':
      return ['stop', 'abort'];
    default:
      return [];
  }
}

/** "300 pulses · 15/15 cameras · 0 missing · live 25.0/s": of what is known. */
export function recordingFacts(nodes: readonly NodeState[]): string {
  const all = (name: string) => nodes.map((node) => valueOf(node, name)).filter((value) => value !== undefined);
  const sum = (name: string) => (all(name).length ? all(name).reduce((a, b) => a + b, 0) : undefined);
  const most = (name: string) => (all(name).length ? Math.max(...all(name)) : undefined);
  const count = (value: number) => value.toLocaleString('en', { maximumFractionDigits: 0 });
  const facts: string[] = [];
  const pulses = most('pulses_sensed') ?? most('pulses_commanded');
  if (pulses !== undefined) facts.push(`${count(pulses)} pulses`);
  const streaming = sum('cameras_streaming');
  if (streaming !== undefined) facts.push(`${count(streaming)}/${count(sum('cameras') ?? streaming)} cameras`);
  const missing = sum('frames_missing');
  if (missing !== undefined) facts.push(`${count(missing)} missing`);
  const live = sum('live_fps');
  if (live !== undefined) facts.push(`live ${live.toFixed(1)}/s`);
  return facts.join(' · ');
}

/** "kendo-07" is followed by "kendo-08"; a name without a number by itself and "-02". */
export function nextName(name: string): string {
  const [, stem, digits] = /^(.*?)(\d*)$/.exec(name)!;
  if (!name) return '';
  if (!digits) return `${stem}-02`;
  return stem + String(BigInt(digits) + 1n).padStart(digits.length, '0');
}

/** As base/core/name.h has it. */
export const isTakeName = (name: string) => /^[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}$/.test(name);

export const NAME_RULE = 'A take has a name of letters, digits, - _ and . , 64 at most.';

/** The cameras that the lines name, for which the studio would not be armed. */
export function camerasNamed(lines: readonly string[], cameras: readonly string[]): string[] {
  const words = new Set(lines.flatMap((line) => line.split(/[^A-Za-z0-9_.-]+/)));
  return cameras.filter((camera) => words.has(camera));
}

export type Grade = 'good' | 'warning' | 'alarm';

/** By v3dctl's exit status. */
export function gradeOf(report: OrderReport): Grade {
  if (report.under_way || report.status === 0) return 'good';
  return report.status === 3 ? 'warning' : 'alarm';
}

/** What is shown of an order that printed nothing. */
export function linesOf(report: OrderReport): string[] {
  if (report.under_way) return ['under way'];
  if (report.lines.length) return report.lines;
  return [report.status === 0 ? 'done' : `v3dctl ended with status ${report.status}, and said nothing`];
}
