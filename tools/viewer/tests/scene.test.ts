import { Object3D, Vector3 } from 'three';
import { expect, test, vi } from 'vitest';
import { place } from '../src/performer';
import { askPath } from '../src/scene_panel';
import { cameraAt, pulseAt, soundAt } from '../src/scene_clock';
import shared from '../../../tests/tools/scene_cases.json';
import { type CameraKey, type Outside, parseScene, pictureCount, type SceneTake, sideBySide, writeScene } from '../src/scene_file';

// The same cases as in tests/tools/scene_test.cc.
const cases = shared as unknown as {
  scene: Record<string, unknown>;
  pictures: number;
  cameras: CameraKey[];
  pulses: { outside: Outside; at_s: number; pulse: number | null }[];
  refused: { with: Record<string, unknown>; says: string }[];
};
const scene = () => parseScene(JSON.stringify(cases.scene));

test('a scene contains the position of every object', () => {
  expect(pictureCount(scene())).toBe(cases.pictures);
  expect(scene().background).toMatchObject({ colour: '#0a1b2c', sphere: 'sky.jpg', turn_deg: 90 });
  expect(scene().takes[0]).toMatchObject({ take: '../a', move: [1, 2, 3], speed: 0.5, out_pulse: 19, outside: 'loop', performer: 2,
    sound: false, sound_shift_s: 0.25, sound_gain_db: -6 });
  expect(scene().takes[1]).toMatchObject({ take: '../b', scale: 1, start_s: 0, in_pulse: null, outside: 'hold', performer: null,
    sound: true, sound_shift_s: 0, sound_gain_db: 0 });
});

test('a path that the panel adds can be read back', () => {
  const shown: string[] = [];
  vi.stubGlobal('alert', (text: string) => shown.push(text));
  for (const typed of ['/models/chair.glb', 'C:\\chair.glb', 'a%20b.glb', ' ', null]) {
    vi.stubGlobal('prompt', () => typed);
    expect(askPath('File?'), `${typed}`).toBeNull();
  }
  expect(shown).toHaveLength(3);
  expect(shown[0]).toContain('/models/chair.glb: expected a path from the folder of the scene');
  vi.stubGlobal('prompt', () => ' models/chair.glb ');
  const changed = scene();
  changed.models.push({ model: askPath('File?')!, move: [0, 0, 0], turn_deg: [0, 0, 0], scale: 1 });
  expect(parseScene(writeScene(changed)).models.at(-1)!.model).toBe('models/chair.glb');
  vi.unstubAllGlobals();
});

test('a scene that is written reads back the same', () => {
  expect(parseScene(writeScene(scene()))).toEqual(scene());
  expect(writeScene(scene())).toContain('"move": [1, 2, 3]');
});

test('a wrong scene is rejected with the name of the field', () => {
  for (const { with: changes, says } of cases.refused) {
    const wrong: Record<string, unknown> = { ...cases.scene, ...changes };
    // Merged by RFC 7396: nested objects are merged, null values are removed.
    if (changes.background) wrong.background = { ...(cases.scene.background as object), ...(changes.background as object) };
    for (const key of Object.keys(wrong)) if (wrong[key] === null) delete wrong[key];
    expect(() => parseScene(JSON.stringify(wrong)), says).toThrowError(says);
  }
  expect(() => parseScene('{')).toThrowError('is no JSON');
});

test('the camera goes through its keys', () => {
  for (const wanted of cases.cameras) {
    const key = cameraAt(scene().camera.keys, wanted.at_s);
    wanted.eye.forEach((n, k) => expect(key.eye[k]).toBeCloseTo(n, 9));
    wanted.look.forEach((n, k) => expect(key.look[k]).toBeCloseTo(n, 9));
    expect(key.fov_deg).toBeCloseTo(wanted.fov_deg, 9);
  }
});

test('takes are shifted and stretched', () => {
  for (const { outside, at_s, pulse } of cases.pulses) {
    const take: SceneTake = { ...scene().takes[0], outside };
    expect(pulseAt(take, 25, 0, 99, at_s), `${outside} at ${at_s}`).toBe(pulse);
  }
});

test('the sound of a take is shifted and stretched with it', () => {
  const take: SceneTake = { ...scene().takes[0], outside: 'hold' }; // pulses 10 to 19, at half the speed, from 0.5 s on
  expect(soundAt(take, 25, 0, 99, 0.75)).toEqual({ exact: 10, outPulse: 19 }); // 0.25 s later than the pictures
  expect(soundAt(take, 25, 0, 99, 0.95)!.exact).toBeCloseTo(12.5, 9);
  expect(soundAt(take, 25, 0, 99, 0.74)).toBeNull();
  expect(soundAt(take, 25, 0, 99, 1.56)).toBeNull();
  expect(soundAt({ ...take, outside: 'loop' }, 25, 0, 99, 1.63)!.exact).toBeCloseTo(11, 9);
});

test('an object is turned about x, then y, then z', () => {
  const thing = new Object3D();
  place(thing, { move: [1, 0, 0], turn_deg: [90, 0, 90], scale: 2 });
  thing.updateMatrixWorld();
  const up = new Vector3(0, 0, 1).applyMatrix4(thing.matrixWorld); // about x to -y, about z to +x
  expect(up.distanceTo(new Vector3(3, 0, 0))).toBeLessThan(1e-9);
});

test('a compared take stands to the right of the first and begins with it', () => {
  const key = { at_s: 0, eye: [0, -3, 1], look: [0, 0, 1], fov_deg: 40 } as CameraKey;
  const both = parseScene(writeScene(sideBySide({ name: 'a', rate_hz: 50, seconds: 2 }, { name: 'b', seconds: 3 }, key, 1.5)));
  expect(both).toMatchObject({ rate_hz: 50, seconds: 3 });
  expect(both.takes.map(({ take, move, start_s, sound }) => ({ take, move, start_s, sound }))).toEqual([
    { take: '../a', move: [0, 0, 0], start_s: 0, sound: true }, { take: '../b', move: [1.5, 0, 0], start_s: 0, sound: false },
  ].map((wanted) => ({ ...wanted, move: wanted.move.map((x) => expect.closeTo(x, 9)) })));
});
