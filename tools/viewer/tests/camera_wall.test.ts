import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { CameraWall } from '../src/camera_wall';
import type { NodeState, PreviewHead } from '../src/message';

/** An element, as far as the wall uses it. */
class FakeElement {
  children: FakeElement[] = [];
  parent: FakeElement | null = null;
  textContent = '';
  append(...parts: FakeElement[]): void {
    for (const part of parts) this.insertBefore(part, null);
  }
  insertBefore(part: FakeElement, next: FakeElement | null): void {
    this.children.splice(next ? this.children.indexOf(next) : this.children.length, 0, part);
    part.parent = this;
  }
  remove(): void {
    this.parent!.children = this.parent!.children.filter((child) => child !== this);
  }
  getContext = () => ({ drawImage: () => undefined });
}

let root: FakeElement;
let wall: CameraWall;
let closed: number;

beforeEach(() => {
  root = new FakeElement();
  closed = 0;
  vi.stubGlobal('document', { createElement: () => new FakeElement() });
  vi.stubGlobal('createImageBitmap', async () => ({ close: () => ++closed }));
  wall = new CameraWall(root as unknown as HTMLElement);
});
afterEach(() => vi.unstubAllGlobals());

const node = (...cameras: string[]): NodeState => ({ name: 'cap01', heard: true, cameras, values: {} });
/** The names on the cards: their second part is a line, which begins with the name. */
const names = () => root.children.map((card) => card.children[1].children[0].textContent);
const preview = (camera: string) =>
  wall.setPreview({ type: 'preview', camera, pulse: 0, width: 1, height: 1, runs: 0 } as PreviewHead, new Uint8Array());

it('the wall shows the cameras of the last state only', async () => {
  await preview('cam02'); // a preview may come before the first state
  expect(wall.setState([node('cam01', 'cam02')]).all).toBe(2);
  expect(names()).toEqual(['cam01', 'cam02']);
  expect(wall.setState([node('cam01', 'cam03')]).all).toBe(2);
  expect(names()).toEqual(['cam01', 'cam03']);
  expect(closed).toBe(1);
  await preview('cam02'); // of a node that has the studio file from before
  expect(names()).toEqual(['cam01', 'cam03']);
  expect(closed).toBe(2);
});
