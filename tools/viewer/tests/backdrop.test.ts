// The background of a scene.
import { Scene, Texture } from 'three';
import { expect, test, vi } from 'vitest';
const loads = vi.hoisted(() => new Map<string, (texture: unknown) => void>());
vi.mock('three', async (original) => ({
  ...(await original<typeof import('three')>()),
  TextureLoader: class { load = (url: string, done: (texture: unknown) => void) => void loads.set(url, done); },
}));
import { Backdrop } from '../src/backdrop';
import { PLAIN } from '../src/scene_file';

test('a background that arrives after another scene was opened is not shown', () => {
  const scene = new Scene();
  const backdrop = new Backdrop(scene, () => undefined, () => undefined);
  const open = (name: string) => backdrop.set({ ...PLAIN, image: 'wall.png' }, (file) => `http://studio/takes/${name}/${file}`);
  open('a');
  backdrop.clear();
  open('b');
  const [ofA, ofB] = [new Texture(), new Texture()];
  loads.get('http://studio/takes/b/wall.png')!(ofB);
  loads.get('http://studio/takes/a/wall.png')!(ofA);
  expect(scene.background).toBe(ofB);
});
