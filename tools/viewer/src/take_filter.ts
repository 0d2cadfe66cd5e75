// Choice of takes by words, scene, mark and state. Pure.
import type { Take } from './take_list';

export interface TakeFilter {
  /** Each word must occur in the name, the studio, the slate or the timecode of a take; letters of either case. */
  words: string;
  /** Scene of the slate; empty: all. */
  scene: string;
  mark: 'all' | 'circled' | 'not rejected';
  /** State of the take; empty: all. */
  state: Take['state'] | '';
}

export const ALL_TAKES: TakeFilter = { words: '', scene: '', mark: 'all', state: '' };

function hasMark(take: Take, mark: TakeFilter['mark']): boolean {
  if (mark === 'circled') return take.slate.mark === 'circled';
  return mark === 'all' || take.slate.mark !== 'rejected';
}

/** Does the filter let this take pass? */
export function passes(take: Take, filter: TakeFilter): boolean {
  const { scene, take: number, note } = take.slate;
  const text = [take.name, take.studio, scene, number, note, take.timecode ?? ''].join(' ').toLowerCase();
  const words = filter.words.toLowerCase().split(/\s+/).filter(Boolean);
  return words.every((word) => text.includes(word)) && (filter.scene === '' || scene === filter.scene)
    && hasMark(take, filter.mark) && (filter.state === '' || take.state === filter.state);
}

/** All scenes of the takes' slates, without an empty one, in the order of their numbers. */
export function scenesOf(takes: readonly Take[]): string[] {
  const scenes = new Set(takes.map((take) => take.slate.scene).filter(Boolean));
  return [...scenes].sort((a, b) => a.localeCompare(b, undefined, { numeric: true }));
}
