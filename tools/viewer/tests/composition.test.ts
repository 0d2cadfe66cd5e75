// The models of a scene.
import { Group } from 'three';
import { expect, it, vi } from 'vitest';

const loads = new Map<string, { done(file: unknown): void }>();
vi.mock('three/addons/loaders/GLTFLoader.js', () => ({
  GLTFLoader: class { loadAsync = (url: string) => new Promise((done) => loads.set(url.split('/').at(-1)!, { done })); },
}));
import { Composition } from '../src/composition';
import { newScene } from '../src/scene_file';
/** Runs what waits for promises that are fulfilled. */
const settle = () => new Promise((done) => setTimeout(done, 0));

it('does not show a model that was removed before it had loaded', async () => {
  let shown: Group[] = [];
  const nothing = () => undefined;
  const stage = {
    backdrop: { set: nothing, setTime: nothing }, setModels: (groups: Group[]) => (shown = groups), follow: nothing, redraw: nothing,
  };
  const scene = newScene(null, 4, { at_s: 0, eye: [0, -3, 1], look: [0, 0, 1], fov_deg: 40 });
  const place = { move: [0, 0, 0] as [number, number, number], turn_deg: [0, 0, 0] as [number, number, number], scale: 1 };
  scene.models.push({ model: 'large.glb', ...place });
  const base = 'http://studio/takes/a/scene.json';
  const composition = new Composition(stage as never, {} as never, scene, base, () => 25, nothing, {} as never);
  scene.models.push({ model: 'small.glb', ...place });
  composition.apply();
  scene.models.shift();
  composition.apply();
  loads.get('small.glb')!.done({ scene: new Group() });
  await settle();
  expect(shown.length).toBe(1);
  const small = shown[0];
  loads.get('large.glb')!.done({ scene: new Group() });
  await settle();
  expect(shown).toEqual([small]);
});
