import { expect, test } from 'vitest';
import { placeOf, pulsesOf } from '../player/src/motion_file';

const segments = [{ pulses: [5, 6, 8] }, { pulses: [9] }, { pulses: [20, 21] }];

test('a pulse is found in its segment', () => {
  expect(placeOf(segments, 5)).toEqual({ segment: 0, index: 0 });
  expect(placeOf(segments, 8)).toEqual({ segment: 0, index: 2 });
  expect(placeOf(segments, 9)).toEqual({ segment: 1, index: 0 });
  expect(placeOf(segments, 21)).toEqual({ segment: 2, index: 1 });
});

test('a pulse that two segments share is found in the later one', () => {
  expect(placeOf([{ pulses: [5, 6] }, { pulses: [6, 7] }], 6)).toEqual({ segment: 1, index: 0 });
});

test('pulses before, between, in a gap of and after segments have no tracked surface', () => {
  for (const pulse of [4, 7, 10, 19, 22]) expect(placeOf(segments, pulse)).toBeNull();
  expect(placeOf([], 5)).toBeNull();
});

test('the pulses of a take without meshes are those of all segments, a shared one once', () => {
  expect(pulsesOf([{ pulses: [5, 6] }, { pulses: [6, 7, 9] }])).toEqual([5, 6, 7, 9]);
});
