import { expect, test } from 'vitest';
import { indicesOf, indicesOfOne, performersOf, type Surface } from '../player/src/surface';

/** Four triangles in a strip over six vertices. The first two belong to performer 3, the last to performer 1. */
const strip: Surface = {
  positions: Float32Array.from({ length: 18 }, (_, n) => n),
  normals: new Float32Array(18),
  colours: null,
  indices: Uint32Array.of(0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4),
  performers: Uint8Array.of(3, 3, 3, 3, 0, 1),
};

test('performers of a surface are listed once, without unknown vertices', () => {
  expect(performersOf(strip)).toEqual([1, 3]);
  expect(performersOf({ ...strip, performers: null })).toEqual([]);
});

test('one performer of a surface without performers has no triangle', () => {
  expect([...indicesOfOne(strip, 3)]).toEqual([0, 1, 2, 1, 3, 2]);
  expect(indicesOfOne({ ...strip, performers: null }, 3)).toHaveLength(0);
});

test('a hidden performer takes along the triangles at his border', () => {
  expect([...indicesOf(strip, (performer) => performer === 3)]).toEqual([0, 1, 2, 1, 3, 2]);
  expect([...indicesOf(strip, (performer) => performer !== 3)]).toEqual([]);
  expect(indicesOf({ ...strip, performers: null }, () => false)).toBe(strip.indices);
});
