// The background of a scene.
import { Scene, Texture } from 'three';
import { afterEach, expect, test, vi } from 'vitest';
const loads = vi.hoisted(() => new Map<string, { done(texture: unknown): void; fail(error: Error): void }>());
vi.mock('three', async (original) => ({
  ...(await original<typeof import('three')>()),
  TextureLoader: class { loadAsync = (url: string) => new Promise((done, fail) => loads.set(url, { done, fail })); },
}));
import { Backdrop } from '../src/backdrop';
import { PLAIN } from '../src/scene_file';
import { AuxiliaryContent } from '../src/auxiliary_content';

afterEach(() => vi.unstubAllGlobals());
/** Runs what waits for promises that are fulfilled. */
const settle = () => new Promise((done) => setTimeout(done, 0));

function shownBackdrop() {
  const scene = new Scene();
  const troubles: string[] = [];
  const auxiliary = new AuxiliaryContent((_, text) => troubles.push(text));
  const backdrop = new Backdrop(scene, () => undefined, (text) => troubles.push(text));
  const open = (name: string, what: { image?: string; video?: string }) =>
    backdrop.set({ ...PLAIN, ...what }, (file) => `http://studio/takes/${name}/${file}`, auxiliary);
  return { scene, troubles, auxiliary, backdrop, open };
}

test('a background that arrives after another scene was opened is not shown', async () => {
  const { scene, backdrop, open } = shownBackdrop();
  open('a', { image: 'wall.png' });
  backdrop.clear();
  open('b', { image: 'wall.png' });
  const [ofA, ofB] = [new Texture(), new Texture()];
  loads.get('http://studio/takes/b/wall.png')!.done(ofB);
  loads.get('http://studio/takes/a/wall.png')!.done(ofA);
  await settle();
  expect(scene.background).toBe(ofB);
});

test('a background that a busy server did not send is loaded again', async () => {
  const { scene, troubles, auxiliary, open } = shownBackdrop();
  vi.stubGlobal('fetch', async () => new Response('too many open files; try again', { status: 503 }));
  open('a', { image: 'wall.png' });
  loads.get('http://studio/takes/a/wall.png')!.fail(new Error('failed'));
  await settle();
  expect(troubles.at(-1)).toContain('too many open files');
  auxiliary.again();
  const wall = new Texture();
  loads.get('http://studio/takes/a/wall.png')!.done(wall);
  await settle();
  expect(scene.background).toBe(wall);
  expect(troubles.at(-1)).toBe('');
});

test('a background that does not exist is reported and not loaded again', async () => {
  const { troubles, auxiliary, open } = shownBackdrop();
  vi.stubGlobal('fetch', async () => new Response('', { status: 404 }));
  open('a', { image: 'wall.png' });
  const first = loads.get('http://studio/takes/a/wall.png')!;
  first.fail(new Error('failed'));
  await settle();
  expect(troubles.at(-1)).toBe('The background http://studio/takes/a/wall.png is not there.');
  auxiliary.again();
  expect(loads.get('http://studio/takes/a/wall.png')).toBe(first);
});

test('a background video ends its requests and reports nothing after it was left', async () => {
  class Video extends EventTarget {
    loads = 0;
    load(): void { ++this.loads; }
    removeAttribute(): void {}
  }
  const video = new Video();
  vi.stubGlobal('document', { createElement: () => video });
  vi.stubGlobal('fetch', async () => new Response('', { status: 404 }));
  const { troubles, backdrop, open } = shownBackdrop();
  open('a', { video: 'wall.mp4' });
  backdrop.clear();
  video.dispatchEvent(new Event('error'));
  await settle();
  expect(troubles.filter(Boolean)).toEqual([]);
  expect(video.loads).toBe(1);
});
