// Possible actions of an operator, and texts about the results of his orders. Pure functions.
import { valueOf } from './node_health';
import type { NodeState, OrderReport } from './message';
import type { Order } from './orders';
import type { Take } from './take_list';

/** 'unrecorded': v3dctl check or background runs. */
export type Phase = 'silent' | 'idle' | 'fault' | 'armed' | 'recording' | 'draining' | 'unrecorded';
export type Action = 'arm' | 'start' | 'stop' | 'abort' | 'verdict';

export interface Activity {
  phase: Phase;
  take: string;
}

export const recordsNothing = (node: NodeState) => node.heard && (valueOf(node, 'unrecorded_flag') ?? 0) > 0;
/** During the phase 'unrecorded'. */
export const nothingRecorded = (take: string) => `${take}: nothing is recorded`;

/** "recording  kendo-07"; "check: nothing is recorded". */
export function nodeActivity(node: NodeState): string {
  if (recordsNothing(node)) return nothingRecorded(node.take ?? '');
  return [node.heard ? (node.state ?? '') : 'silent', node.take].filter(Boolean).join('  ');
}

/** Names of the nodes at fault. A node at fault refuses every order but abort, which clears the fault. */
export const nodesAtFault = (nodes: readonly NodeState[]) =>
  nodes.filter((node) => node.heard && node.state === 'fault').map(({ name }) => name);

/** The phase of the studio: that of the node which is farthest in a take; without a take `fault`, if a node is at fault. */
export function activityOf(nodes: readonly NodeState[]): Activity {
  for (const phase of ['recording', 'draining', 'armed'] as const) {
    const at = nodes.filter((node) => node.heard && node.state === phase && !recordsNothing(node));
    if (at.length) return { phase, take: at.find((node) => node.take)?.take ?? '' };
  }
  const unrecorded = nodes.find(recordsNothing);
  if (unrecorded) return { phase: 'unrecorded', take: unrecorded.take ?? '' };
  if (nodesAtFault(nodes).length) return { phase: 'fault', take: '' };
  return { phase: nodes.some((node) => node.heard) ? 'idle' : 'silent', take: '' };
}

/** A take that was started here and ended without a stop: its verdict was not shown yet. */
const endedByItself = (last: OrderReport | null) => last?.do === 'start' && last.status === 0;

/** The response to an order may arrive after the socket's report of its end, and then still has the state "under way". */
export const isNews = (report: OrderReport, last: OrderReport | null) => !last || report.number > last.number;

/** The possible actions; none while an order is under way. */
export function actionsIn(phase: Phase, last: OrderReport | null): Action[] {
  if (last?.under_way) return [];
  switch (phase) {
    case 'idle':
      return endedByItself(last) ? ['verdict', 'arm'] : ['arm'];
    case 'fault':
      return endedByItself(last) ? ['verdict', 'abort'] : ['abort'];
    case 'armed':
      return ['start', 'abort'];
    case 'recording':
      return ['stop', 'abort'];
    case 'unrecorded':
      return ['abort'];
    default:
      return [];
  }
}

/** The text on the button of an action. */
export function labelOf(action: Action, phase: Phase): string {
  if (action === 'abort' && phase === 'fault') return 'Clear the fault…';
  return { arm: 'Arm', start: 'Start recording', stop: 'Stop', abort: 'Abort…', verdict: 'Tell the verdict' }[action];
}

/** The nodes with cameras that do not record the take which another node records, for example after a restart. */
export function absentNodes(nodes: readonly NodeState[]): string[] {
  if (!nodes.some((node) => node.heard && node.state === 'recording')) return [];
  const isOutside = (node: NodeState) => node.state === 'fault' || (node.state === 'idle' && !node.take);
  return nodes.filter((node) => node.heard && isOutside(node) && (valueOf(node, 'cameras') ?? 0) > 0).map((node) => node.name);
}

/**
 * "300 pulses · 15/15 cameras · 0 missing · live 25.0/s"; unknown values are omitted. Cameras of absent nodes do not count as
 * streaming, and "cap02 does not record" follows.
 */
export function recordingFacts(nodes: readonly NodeState[]): string {
  const absent = absentNodes(nodes);
  const all = (name: string) => nodes.map((node) => valueOf(node, name)).filter((value) => value !== undefined);
  const sum = (name: string) => (all(name).length ? all(name).reduce((a, b) => a + b, 0) : undefined);
  const max = (name: string) => (all(name).length ? Math.max(...all(name)) : undefined);
  const count = (value: number) => value.toLocaleString('en', { maximumFractionDigits: 0 });
  const facts: string[] = [];
  const pulses = max('pulses_sensed') ?? max('pulses_commanded');
  if (pulses !== undefined) facts.push(`${count(pulses)} pulses`);
  const streaming = sum('cameras_streaming');
  const streamingIn = (node: NodeState) => (absent.includes(node.name) ? 0 : (valueOf(node, 'cameras_streaming') ?? 0));
  const recorded = nodes.map(streamingIn).reduce((a, b) => a + b, 0);
  if (streaming !== undefined) facts.push(`${count(recorded)}/${count(sum('cameras') ?? streaming)} cameras`);
  const missing = sum('frames_missing');
  if (missing !== undefined) facts.push(`${count(missing)} missing`);
  const live = max('live_fps'); // every node of a shared take reports the rate of the common stream
  if (live !== undefined) facts.push(`live ${live.toFixed(1)}/s`);
  if (absent.length) facts.push(`${absent.join(', ')} ${absent.length === 1 ? 'does' : 'do'} not record`);
  return facts.join(' · ');
}

/** The next name: "kendo-08" after "kendo-07"; "-02" is appended to a name without a number. */
export function nextName(name: string): string {
  const [, stem, digits] = /^(.*?)(\d*)$/.exec(name)!;
  if (!name) return '';
  if (!digits) return `${stem}-02`;
  return stem + String(BigInt(digits) + 1n).padStart(digits.length, '0');
}

/**
 * The proposed name of the next take: the first free name after that of the newest recording; null: there is none. `takes`: the newest
 * first. Edited takes are left out, as they start when their source did. So are takes whose take.toml cannot be read (their rate is 0),
 * as their start is unknown.
 */
export function proposedName(takes: readonly Pick<Take, 'name' | 'state' | 'rate_hz'>[]): string | null {
  const newest = takes.find((take) => take.state !== 'edited' && take.rate_hz > 0);
  if (!newest) return null;
  const used = new Set(takes.map(({ name }) => name));
  let name = nextName(newest.name);
  while (used.has(name)) name = nextName(name);
  return name;
}

/** The same rule as in base/core/text.h. */
export const isTakeName = (name: string) => /^[A-Za-z0-9_][A-Za-z0-9_.-]{0,63}$/.test(name);

export const NAME_RULE = 'The name of a take may have letters, digits, - _ and . , at most 64 characters.';
export const SECONDS_RULE = 'Seconds: expected a number from 1 to 86400, or an empty field for a take until Stop.';

export interface ArmForm {
  take: string;
  /** Empty for text that is no number, too: `secondsAreValid` is false then. */
  seconds: string;
  secondsAreValid: boolean;
  without: string[];
}

/** The order of a form, or the rule that a field of it breaks. */
export function armOrder(form: ArmForm): { order: Order } | { rule: string; field: 'take' | 'seconds' } {
  const take = form.take.trim();
  if (!isTakeName(take)) return { rule: NAME_RULE, field: 'take' };
  if (!form.secondsAreValid) return { rule: SECONDS_RULE, field: 'seconds' };
  const order: Order = { do: 'arm', take };
  if (form.seconds) order.seconds = Number(form.seconds);
  if (form.without.length) order.without = form.without;
  return { order };
}

/** The cameras that the lines of a rejected arm order name. */
export function camerasNamed(lines: readonly string[], cameras: readonly string[]): string[] {
  const words = new Set(lines.flatMap((line) => line.split(/[^A-Za-z0-9_.-]+/)));
  return cameras.filter((camera) => words.has(camera));
}

/** True when an order has ended after which the cameras that were left out are needed again: all but a rejected arm order. */
export const endsSelection = (report: OrderReport) => !report.under_way && (report.do !== 'arm' || report.status === 0);

/**
 * The cameras that the next arm order may leave out: those of `without`, and those that the last, rejected arm order names.
 * A node names one camera at a time.
 */
export function leavableCameras(last: OrderReport | null, cameras: readonly string[], without: ReadonlySet<string>): string[] {
  const isRejected = last?.do === 'arm' && !last.under_way && last.status !== 0;
  const named = isRejected ? camerasNamed(last.lines, cameras) : [];
  return cameras.filter((camera) => without.has(camera) || named.includes(camera));
}

export type Grade = 'good' | 'warning' | 'alarm';

/** Grade by v3dctl's exit status. */
export function gradeOf(report: OrderReport): Grade {
  if (report.under_way || report.status === 0) return 'good';
  return report.status === 3 ? 'warning' : 'alarm';
}

/** The lines of an order; a substitute if it printed nothing. */
export function linesOf(report: OrderReport): string[] {
  if (report.under_way) return ['under way'];
  if (report.lines.length) return report.lines;
  return [report.status === 0 ? 'done' : `v3dctl exited with status ${report.status} without a message`];
}
