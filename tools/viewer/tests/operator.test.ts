import { describe, expect, it } from 'vitest';
import type { NodeState, OrderReport } from '../src/message';
import {
  actionsIn, activityOf, armOrder, camerasNamed, endsSelection, gradeOf, isTakeName, labelOf, leavableCameras, linesOf, nextName,
  nodeActivity, nodesAtFault, proposedName, recordingFacts,
} from '../src/operator';
import { takesText } from '../src/page';

const node = (name: string, state: string, take = '', values: Record<string, number> = {}): NodeState =>
  ({ name, heard: true, cameras: [], state, take, values });
const silent: NodeState = { name: 'cap09', heard: false, cameras: [] };
const report = (more: Partial<OrderReport>): OrderReport =>
  ({ type: 'order', number: 1, by: '127.0.0.1', at_ms: 0, do: 'arm', take: '', text: '', under_way: false, status: 0, lines: [], ...more });

describe('an operator', () => {
  it('gets the phase of the node that is farthest in a take', () => {
    expect(activityOf([silent])).toEqual({ phase: 'silent', take: '' });
    expect(activityOf([silent, node('recon01', 'idle')])).toEqual({ phase: 'idle', take: '' });
    expect(activityOf([node('cap01', 'armed', 'kendo-07'), node('recon01', 'recording', 'kendo-07')]))
      .toEqual({ phase: 'recording', take: 'kendo-07' });
    expect(activityOf([node('cap01', 'draining', 'kendo-07'), node('recon01', 'armed', 'x')]).phase).toBe('draining');
    expect(activityOf([node('cap01', 'fault'), node('recon01', 'armed', 'kendo-07')]).take).toBe('kendo-07');
  });

  it('shows no recording during a check or background', () => {
    for (const take of ['check', 'background']) {
      for (const state of ['idle', 'armed', 'recording', 'draining']) {
        const nodes = [node('cap01', state, take, { unrecorded_flag: 1 }), node('recon01', 'idle')];
        expect(activityOf(nodes)).toEqual({ phase: 'unrecorded', take });
        expect(nodeActivity(nodes[0])).toBe(`${take}: nothing is recorded`);
      }
    }
    expect(actionsIn('unrecorded', null)).toEqual(['abort']);
    const recording = node('cap02', 'recording', 'kendo-07');
    expect(activityOf([node('cap01', 'recording', 'check', { unrecorded_flag: 1 }), recording])).toEqual({ phase: 'recording', take: 'kendo-07' });
    expect(nodeActivity(recording)).toBe('recording  kendo-07');
  });

  it('gets only the possible actions', () => {
    expect(actionsIn('idle', null)).toEqual(['arm']);
    expect(actionsIn('armed', null)).toEqual(['start', 'abort']);
    expect(actionsIn('recording', null)).toEqual(['stop', 'abort']);
    expect(actionsIn('draining', null)).toEqual([]);
    expect(actionsIn('silent', null)).toEqual([]);
  });

  it('can clear the fault of a node, which refuses every arm until then', () => {
    const nodes = [node('cap01', 'fault'), node('recon01', 'idle'), silent];
    expect(nodesAtFault(nodes)).toEqual(['cap01']);
    expect(activityOf(nodes)).toEqual({ phase: 'fault', take: '' });
    expect(actionsIn(activityOf(nodes).phase, null)).toEqual(['abort']);
    expect(labelOf('abort', 'fault')).toBe('Clear the fault…');
    expect(labelOf('abort', 'armed')).toBe('Abort…');
    expect(actionsIn('fault', report({ do: 'start' }))).toEqual(['verdict', 'abort']);
    expect(activityOf([node('cap01', 'fault'), node('recon01', 'recording', 'kendo-07')]).phase).toBe('recording');
  });

  it('gets no action while an order is under way', () => {
    for (const phase of ['idle', 'armed', 'recording'] as const) {
      expect(actionsIn(phase, report({ under_way: true }))).toEqual([]);
    }
  });

  it('may request the verdict of a take that ended without a stop', () => {
    expect(actionsIn('idle', report({ do: 'start' }))).toEqual(['verdict', 'arm']);
    expect(actionsIn('idle', report({ do: 'start', status: 1 }))).toEqual(['arm']);
    expect(actionsIn('idle', report({ do: 'stop' }))).toEqual(['arm']);
  });

  it('gets a proposed name for the next take', () => {
    expect(nextName('kendo-07')).toBe('kendo-08');
    expect(nextName('kendo-99')).toBe('kendo-100');
    expect(nextName('7')).toBe('8');
    expect(nextName('dance')).toBe('dance-02');
    expect(nextName('')).toBe('');
    expect(nextName('take-99999999999999999999')).toBe('take-100000000000000000000');
  });

  it('gets the free name after the newest recording, not after an edited or unreadable take', () => {
    const take = (name: string, more: Partial<Parameters<typeof proposedName>[0][number]> = {}) =>
      ({ name, state: 'complete' as const, rate_hz: 25, ...more });
    const edited = take('kendo-07-edit', { state: 'edited' });
    expect(proposedName([edited, take('kendo-07')])).toBe('kendo-08');
    expect(proposedName([take('kendo-02', { rate_hz: 0 }), take('kendo-07'), take('kendo-06')])).toBe('kendo-08');
    expect(proposedName([take('kendo-08', { state: 'edited' }), take('kendo-07')])).toBe('kendo-09');
    expect(proposedName([edited])).toBeNull();
    expect(proposedName([])).toBeNull();
  });

  it('must use a take name that is a valid folder name', () => {
    for (const name of ['kendo-07', '_x', 'A.b_c-9', 'a'.repeat(64)]) expect(isTakeName(name), name).toBe(true);
    for (const name of ['', '.x', '-x', '../x', 'a b', 'a/b', 'ä', 'a'.repeat(65), 'a\n']) expect(isTakeName(name), name).toBe(false);
  });

  it('gets no order for a duration that is no number, instead of a take without an end', () => {
    const form = { take: ' kendo-07 ', seconds: '', secondsAreValid: true, without: [] };
    expect(armOrder(form)).toEqual({ order: { do: 'arm', take: 'kendo-07' } });
    expect(armOrder({ ...form, seconds: '2.5', without: ['cam07'] }))
      .toEqual({ order: { do: 'arm', take: 'kendo-07', seconds: 2.5, without: ['cam07'] } });
    expect(armOrder({ ...form, secondsAreValid: false })).toMatchObject({ field: 'seconds', rule: expect.stringContaining('1 to 86400') });
    expect(armOrder({ ...form, take: '../x' })).toMatchObject({ field: 'take' });
  });

  it('types letters into fields, which are no shortcuts there', () => {
    for (const tagName of ['INPUT', 'TEXTAREA', 'SELECT']) expect(takesText({ tagName } as unknown as EventTarget)).toBe(true);
    expect(takesText({ tagName: 'BUTTON' } as unknown as EventTarget)).toBe(false);
    expect(takesText(null)).toBe(false);
  });

  it('may leave out the cameras that a rejection names', () => {
    const lines = ['cap01         not ready: cam07 (GV-4103) silent since 14:03:11. Try: v3dctl doctor cap01'];
    expect(camerasNamed(lines, ['cam01', 'cam07', 'cam070'])).toEqual(['cam07']);
    expect(camerasNamed([], ['cam01'])).toEqual([]);
  });

  it('keeps the cameras that he leaves out until a take is armed', () => {
    expect(endsSelection(report({ under_way: true }))).toBe(false);
    expect(endsSelection(report({ status: 1 }))).toBe(false);
    expect(endsSelection(report({ status: 0 }))).toBe(true);
    expect(endsSelection(report({ do: 'stop', status: 1 }))).toBe(true);
    expect(endsSelection(report({ do: 'stop', under_way: true }))).toBe(false);
  });

  it('may leave out cameras that nodes reject one after another', () => {
    const cameras = ['cam06', 'cam07', 'cam08'];
    const rejected = report({ status: 1, lines: ['cap01  not ready: cam08 has no background model'] });
    expect(leavableCameras(rejected, cameras, new Set(['cam07']))).toEqual(['cam07', 'cam08']);
    expect(leavableCameras(rejected, cameras, new Set())).toEqual(['cam08']);
    expect(leavableCameras(report({ do: 'stop', status: 1, lines: rejected.lines }), cameras, new Set())).toEqual([]);
    expect(leavableCameras(null, cameras, new Set(['cam06']))).toEqual(['cam06']);
  });

  it('gets the facts of a recording', () => {
    const nodes = [
      node('cap01', 'recording', 'k', { pulses_sensed: 1300, cameras_streaming: 8, cameras: 8, frames_missing: 1 }),
      node('cap02', 'recording', 'k', { cameras_streaming: 6, cameras: 7, frames_missing: 2 }),
      node('recon01', 'recording', 'k', { live_fps: 24.96 }),
      node('recon02', 'recording', 'k', { live_fps: 24.9 }), // counts the meshes of all nodes, too
    ];
    expect(recordingFacts(nodes)).toBe('1,300 pulses · 14/15 cameras · 3 missing · live 25.0/s');
    expect(recordingFacts([silent])).toBe('');
  });

  it('names a node that does not record the running take', () => {
    const cap01 = node('cap01', 'recording', 'k', { cameras_streaming: 10, cameras: 10 });
    const values = { cameras_streaming: 5, cameras: 5 };
    expect(recordingFacts([cap01, node('cap02', 'idle', '', values)])).toBe('10/15 cameras · cap02 does not record');
    expect(recordingFacts([cap01, node('cap02', 'armed', 'k', values)])).toBe('15/15 cameras');
    expect(recordingFacts([node('cap02', 'idle', '', values)])).toBe('5/5 cameras');
    expect(recordingFacts([cap01, node('recon01', 'idle', '', { meshes: 7 })])).toBe('10/10 cameras');
  });

  it('gets the grade of the result of an order', () => {
    expect(gradeOf(report({}))).toBe('good');
    expect(gradeOf(report({ status: 3 }))).toBe('warning');
    expect(gradeOf(report({ status: 1 }))).toBe('alarm');
    expect(linesOf(report({ lines: ['armed'] }))).toEqual(['armed']);
    expect(linesOf(report({ under_way: true, lines: ['old'] }))).toEqual(['under way']);
    expect(linesOf(report({ status: 143 }))).toEqual(['v3dctl exited with status 143 without a message']);
  });
});
