// The models of a scene.
import { BufferGeometry, Group, Mesh } from 'three';
import { afterEach, expect, it, vi } from 'vitest';

const loads = new Map<string, { done(file: unknown): void; fail(error: Error): void }>();
vi.mock('three/addons/loaders/GLTFLoader.js', () => ({
  GLTFLoader: class { loadAsync = (url: string) => new Promise((done, fail) => loads.set(url.split('/').at(-1)!, { done, fail })); },
}));
import { AuxiliaryContent } from '../src/auxiliary_content';
import { Composition } from '../src/composition';
import { newScene, WHOLE_TAKE } from '../src/scene_file';
/** Runs what waits for promises that are fulfilled. */
const settle = () => new Promise((done) => setTimeout(done, 0));


/** A scene without takes, and what its composition shows. */
function shownScene() {
  const nothing = () => undefined;
  const shown = { groups: [] as Group[], errors: new Map<string, string>(), performers: 0 };
  const performer = () => {
    ++shown.performers;
    return { mesh: new Mesh(), setViews: nothing, hasViews: false };
  };
  const stage = {
    backdrop: { set: nothing, setTime: nothing }, setModels: (groups: Group[]) => (shown.groups = groups), follow: nothing, redraw: nothing,
    addPerformer: performer, removePerformer: nothing, look: 'colour',
  };
  const scene = newScene(null, 4, { at_s: 0, eye: [0, -3, 1], look: [0, 0, 1], fov_deg: 40 });
  const trouble = (source: string, text: string) => void (text ? shown.errors.set(source, text) : shown.errors.delete(source));
  const auxiliary = new AuxiliaryContent(trouble);
  const open = () => new Composition(stage as never, {} as never, scene, 'http://studio/takes/a/scene.json', () => 25, trouble, auxiliary);
  return { scene, shown, auxiliary, open };
}
const place = { move: [0, 0, 0] as [number, number, number], turn_deg: [0, 0, 0] as [number, number, number], scale: 1 };
const answer = (status: number) => vi.stubGlobal('fetch', async () => new Response('busy', { status }));
afterEach(() => {
  loads.clear();
  vi.unstubAllGlobals();
});

it('does not show a model that was removed before it had loaded', async () => {
  const { scene, shown, open } = shownScene();
  scene.models.push({ model: 'large.glb', ...place });
  const composition = open();
  scene.models.push({ model: 'small.glb', ...place });
  composition.apply();
  scene.models.shift();
  composition.apply();
  loads.get('small.glb')!.done({ scene: new Group() });
  await settle();
  expect(shown.groups.length).toBe(1);
  const small = shown.groups[0];
  loads.get('large.glb')!.done({ scene: new Group() });
  await settle();
  expect(shown.groups).toEqual([small]);
});

it('loads a model again that a busy server did not send', async () => {
  const { scene, shown, auxiliary, open } = shownScene();
  scene.models.push({ model: 'chair.glb', ...place });
  open();
  answer(503);
  const first = loads.get('chair.glb')!;
  first.fail(new Error('503'));
  await settle();
  expect([...shown.errors.values()].join()).toContain('busy');
  auxiliary.again();
  expect(loads.get('chair.glb')).not.toBe(first);
  loads.get('chair.glb')!.done({ scene: new Group() });
  await settle();
  expect([shown.groups.length, shown.errors.size]).toEqual([1, 0]);
});

it('reports a model that does not exist, also after another change of the scene, and not after it was removed', async () => {
  const { scene, shown, open } = shownScene();
  scene.models.push({ model: 'chair.glb', ...place });
  const composition = open();
  answer(404);
  loads.get('chair.glb')!.fail(new Error('404'));
  await settle();
  scene.seconds = 5;
  composition.apply();
  expect([...shown.errors.values()]).toEqual(['The model chair.glb does not exist or is not a glTF file.']);
  expect(composition.settled).toBe(true);
  scene.models.pop();
  composition.apply();
  expect(shown.errors.size).toBe(0);
});

it('reports a take without meshes after another change of the scene, until the take is removed', async () => {
  let post: (message: unknown) => void = () => undefined;
  vi.stubGlobal('Worker', class {
    set onmessage(use: (event: { data: unknown }) => void) { post = (data) => use({ data }); }
    postMessage(): void {}
    terminate(): void {}
  });
  answer(404);
  const { scene, shown, open } = shownScene();
  const composition = open();
  scene.takes.push({ take: '../ball', ...place, ...WHOLE_TAKE });
  composition.apply();
  post({ kind: 'trouble', take: 0, text: 'This take has no meshes yet.' });
  scene.seconds = 5;
  composition.apply();
  expect([...shown.errors.values()]).toEqual(['../ball: This take has no meshes yet.']);
  scene.takes.pop();
  composition.apply();
  expect(shown.errors.size).toBe(0);
});

it('frees the buffers of a model that is removed', async () => {
  const { scene, open } = shownScene();
  scene.models.push({ model: 'chair.glb', ...place });
  const composition = open();
  const geometry = new BufferGeometry();
  const file = new Group().add(new Mesh(geometry));
  let freed = 0;
  geometry.addEventListener('dispose', () => ++freed);
  loads.get('chair.glb')!.done({ scene: file });
  await settle();
  composition.apply();
  expect(freed).toBe(0);
  scene.models.pop();
  composition.apply();
  expect(freed).toBe(1);
});
