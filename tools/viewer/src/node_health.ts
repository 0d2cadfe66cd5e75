// Texts and grades for the health of nodes and cameras. Pure functions.
import type { NodeState } from './message';

export type Grade = 'good' | 'warning' | 'alarm';
export interface CameraHealth {
  grade: Grade;
  text: string;
}

const ALARM_DISK_S = 60;
const WARNING_DISK_S = 600;
const DISPLACED_PX = 1.5;
const DEEP_QUEUE = 8;

const plural = (n: number, one: string) => `${n.toLocaleString('en')} ${one}${n === 1 ? '' : 's'}`;

/** A value of a node's health; undefined if the node does not report it. */
export function valueOf(node: NodeState | undefined, name: string): number | undefined {
  return node?.values?.[name] ?? undefined;
}

/** Grades a camera by the health of its node and of the reconstruction. Returns the worst fault. */
export function gradeCamera(camera: string, node: NodeState, recon: NodeState | undefined): CameraHealth {
  if (!node.heard) return { grade: 'alarm', text: `${node.name} is silent` };
  const of = (name: string) => valueOf(node, `${camera}.${name}`) ?? 0;
  const running = node.state === 'recording' || node.state === 'armed';
  const drift = valueOf(recon, `${camera}.drift_px`) ?? 0;
  const found: [boolean, Grade, string][] = [
    [running && of('streaming_flag') === 0, 'alarm', 'does not stream'],
    [of('frames_missing') > 0, 'alarm', `${plural(of('frames_missing'), 'frame')} missing`],
    [of('losses') > 0, 'alarm', `was lost ${plural(of('losses'), 'time')}`],
    [of('frames_suspect') > 0, 'warning', `${plural(of('frames_suspect'), 'label')} in doubt`],
    [drift >= DISPLACED_PX, 'warning', `silhouettes shifted by ${drift.toFixed(1)} px: displaced since the calibration?`],
    [of('frames_damaged') > 0, 'warning', `${plural(of('frames_damaged'), 'frame')} damaged on the network`],
    [of('queue_frames') > DEEP_QUEUE, 'warning', `${plural(of('queue_frames'), 'frame')} behind`],
  ];
  const worst = found.find(([is, grade]) => is && grade === 'alarm') ?? found.find(([is]) => is);
  if (worst) return { grade: worst[1], text: worst[2] };
  return { grade: 'good', text: running && of('frames') > 0 ? 'follows every pulse' : '' };
}

export interface Fact {
  name: string;
  value: string;
  grade: Grade;
}

const percent = (v: number) => `${v.toFixed(0)} %`;
const size = (v: number) => (v >= 1e12 ? `${(v / 1e12).toFixed(1)} TB` : `${(v / 1e9).toFixed(v < 1e10 ? 1 : 0)} GB`);
const duration = (s: number) => (s >= 36_000 ? `${(s / 3600).toFixed(0)} h` : s >= 600 ? `${(s / 60).toFixed(0)} min` : `${s.toFixed(0)} s`);

/** Peaks of all channels of an open sound device, dB of full scale. */
function peaksOf(node: NodeState): number[] {
  const peaks: number[] = [];
  for (let channel = 1; ; ++channel) {
    const peak = valueOf(node, `sound_peak_${channel}_db`);
    if (peak === undefined) return peaks;
    peaks.push(peak);
  }
}

const NOT_OPEN = 'the device is not open';

/** Levels, lost samples and jumps of the timecode of the sound input. Channels of pulses and timecode have any level. */
function soundOf(node: NodeState): Fact[] {
  const open = valueOf(node, 'sound_open_flag');
  if (open === undefined) return [];
  if (open === 0) return [{ name: 'sound', value: NOT_OPEN, grade: 'warning' }];
  const peaks = peaksOf(node);
  const count = (name: string) => valueOf(node, name) ?? 0;
  const clipping = count('sound_channels_clipping');
  const silent = count('sound_channels_silent');
  const xruns = count('sound_xruns');
  const jumps = count('sound_timecode_jumps');
  const facts: Fact[] = [];
  if (peaks.length > 0) {
    const value = peaks.map((peak) => peak.toFixed(0)).join(', ') + ' dB';
    facts.push({ name: 'sound', value, grade: 'good' });
  }
  if (clipping > 0) facts.push({ name: 'sound clips', value: plural(clipping, 'channel'), grade: 'warning' });
  if (silent > 0) facts.push({ name: 'sound silent', value: plural(silent, 'channel'), grade: 'warning' });
  if (xruns > 0) facts.push({ name: 'sound lost', value: plural(xruns, 'xrun'), grade: 'warning' });
  if (jumps > 0) facts.push({ name: 'timecode in', value: plural(jumps, 'jump'), grade: 'warning' });
  return facts;
}

/** State of the timecode output. */
function timecodeOutputOf(node: NodeState): Fact[] {
  const open = valueOf(node, 'timecode_output_open_flag');
  if (open === undefined) return [];
  const underruns = valueOf(node, 'timecode_output_underruns') ?? 0;
  const value = open === 0 ? NOT_OPEN : underruns > 0 ? plural(underruns, 'underrun') : 'plays';
  return [{ name: 'timecode', value, grade: value === 'plays' ? 'good' : 'warning' }];
}

/** The scene of the lamps. */
function lightsOf(node: NodeState): Fact[] {
  const connected = valueOf(node, 'lights_connected_flag');
  if (connected === undefined) return [];
  if (connected === 0) return [{ name: 'lights', value: 'not connected', grade: 'warning' }];
  return [{ name: 'lights', value: valueOf(node, 'take_light_flag') ? 'take' : 'work', grade: 'good' }];
}

/** The most important values of a node; unreported ones are omitted. */
export function factsOf(node: NodeState): Fact[] {
  const facts: Fact[] = [];
  const add = (name: string, key: string, text: (v: number) => string, grade: (v: number) => Grade = () => 'good') => {
    const value = valueOf(node, key);
    if (value !== undefined) facts.push({ name, value: text(value), grade: grade(value) });
  };
  const any = (grade: Grade) => (v: number): Grade => (v > 0 ? grade : 'good');
  const whole = (v: number) => v.toLocaleString('en', { maximumFractionDigits: 0 });
  add('frames', 'frames_written', whole);
  add('missing', 'frames_missing', whole, any('alarm'));
  add('pulses', 'pulses_sensed', whole);
  add('suspect', 'frames_suspect', whole, any('warning'));
  add('meshes', 'meshes', whole);
  add('live', 'live_fps', (v) => `${v.toFixed(1)}/s`);
  add('latency', 'latency_p50_ms', (v) => `${v.toFixed(0)} ms`);
  add('dropped', 'dropped', whole, any('warning'));
  add('incomplete', 'incomplete_sets', whole, any('warning'));
  add('trigger late', 'trigger_late', whole, any('warning'));
  add('disk for', 'disk_seconds_left', duration, (v) => (v < ALARM_DISK_S ? 'alarm' : v < WARNING_DISK_S ? 'warning' : 'good'));
  add('disk free', 'disk_free_bytes', size);
  add('processor', 'cpu_machine_percent', percent, (v) => (v > 95 ? 'warning' : 'good'));
  add('hottest', 'temperature_max_celsius', (v) => `${v.toFixed(0)} °C`, (v) => (v > 85 ? 'warning' : 'good'));
  return [...facts, ...soundOf(node), ...timecodeOutputOf(node), ...lightsOf(node)];
}
