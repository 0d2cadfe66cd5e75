import { describe, expect, it } from 'vitest';
import { ALL_TAKES, passes, scenesOf } from '../src/take_filter';
import type { Take } from '../src/take_list';

const take = (name: string, slate: Partial<Take['slate']> = {}, state: Take['state'] = 'complete'): Take => ({
  name, studio: 'dojo', started_ns: 0, state, verified: false, rate_hz: 25, pulses: 9, seconds: 1, bytes: 1, mesh_bytes: 1, proxy_bytes: 0,
  cameras: ['cam01'], meshes: 9, slate: { scene: '', take: '', note: '', mark: '', ...slate },
});
const duel = take('kendo-07', { scene: '12', take: '3', note: 'The sword slips', mark: 'circled' });
const rest = take('kendo-08', { scene: '2', mark: 'rejected' }, 'incomplete');
const plain = take('kendo-09');
const names = (filter: Partial<typeof ALL_TAKES>) =>
  [duel, rest, plain].filter((t) => passes(t, { ...ALL_TAKES, ...filter })).map((t) => t.name.slice(-1)).join('');

describe('a filter of takes', () => {
  it('lets all takes pass at first', () => {
    expect(names({})).toBe('789');
  });

  it('finds takes whose name, studio or slate has each word', () => {
    expect(names({ words: 'SWORD kendo' })).toBe('7');
    expect(names({ words: ' dojo ' })).toBe('789');
    expect(names({ words: 'sword 08' })).toBe('');
  });

  it('finds takes by their timecode', () => {
    const timed: Take = { ...plain, timecode: '10:00:03:00 to 10:01:02:24' };
    expect(passes(timed, { ...ALL_TAKES, words: '10:00:03' })).toBe(true);
    expect(passes(plain, { ...ALL_TAKES, words: '10:00:03' })).toBe(false);
  });

  it('finds takes of a scene, with a mark, and in a state', () => {
    expect(names({ scene: '12' })).toBe('7');
    expect(names({ scene: '1' })).toBe('');
    expect(names({ mark: 'circled' })).toBe('7');
    expect(names({ mark: 'not rejected' })).toBe('79');
    expect(names({ state: 'incomplete' })).toBe('8');
  });

  it('offers each scene once, in the order of their numbers', () => {
    expect(scenesOf([duel, rest, plain, duel])).toEqual(['2', '12']);
  });
});
