import { afterEach, beforeEach, expect, test, vi } from 'vitest';
import type { Surface } from '../player/src/surface';
import { PerformerList } from '../src/performer_list';

/** An element, as far as the list uses it. */
class FakeElement {
  hidden = false;
  textContent = '';
  title = '';
  ariaPressed: string | null = null;
  dataset: Record<string, string> = {};
  children: FakeElement[] = [];
  click = () => {};
  append(...children: FakeElement[]): void {
    this.children.push(...children);
  }
  replaceChildren(...children: FakeElement[]): void {
    this.children = children;
  }
  querySelector = () => this.children[0];
  addEventListener(_: string, click: () => void): void {
    this.click = click;
  }
}

/** A triangle of each performer. */
const surfaceOf = (...performers: number[]): Surface => ({
  positions: new Float32Array(9 * performers.length),
  normals: new Float32Array(9 * performers.length),
  colours: null,
  indices: Uint32Array.from({ length: 3 * performers.length }, (_, n) => n),
  performers: Uint8Array.from(performers.flatMap((performer) => [performer, performer, performer])),
});

let section: FakeElement;
let list: PerformerList;
const rows = () => section.children[0].children;
const hide = (performer: number) => rows().find((row) => row.dataset.performer === String(performer))!.children[0].click();
const shown = (surface: Surface) => list.visible(surface).indices.length / 3;

beforeEach(() => {
  vi.stubGlobal('document', { createElement: () => new FakeElement() });
  section = new FakeElement();
  section.append(new FakeElement());
  list = new PerformerList(section as unknown as HTMLElement, () => {});
});
afterEach(() => vi.unstubAllGlobals());

test('a hidden performer stays hidden in the next meshes of a live take', () => {
  list.add(surfaceOf(1, 2), 'fight');
  hide(2);
  list.add(surfaceOf(1, 2, 3), 'fight');
  expect(rows().map((row) => row.dataset.performer)).toEqual(['1', '2', '3']);
  expect(shown(surfaceOf(1, 2, 3))).toBe(2);
});

test('the next live take begins with an empty list, because its numbers are of other performers', () => {
  list.add(surfaceOf(1, 2, 3), 'fight');
  hide(2);
  list.add(surfaceOf(1, 2), 'dance');
  expect(rows().map((row) => row.dataset.performer)).toEqual(['1', '2']);
  expect(shown(surfaceOf(1, 2))).toBe(2);
});

test('meshes of a recorded take keep the list', () => {
  list.add(surfaceOf(1, 2));
  hide(1);
  list.add(surfaceOf(2));
  expect(shown(surfaceOf(1, 2))).toBe(1);
  list.clear();
  expect(section.hidden).toBe(true);
});
