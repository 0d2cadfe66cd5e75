// Browser tests of edited takes and skeletons: v3dctl, v3d-viewd, the built page, Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { PageProbe, isNear } from './eyes.mjs';
import { launchBrowser, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';
import { Motion } from '../../codec/v3d_decoder.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const takes = join(studio.folder, 'takes');
const file = join(takes, 'person/skeleton.json');
const [GREY, LEFT, RIGHT, RING] = [[120, 120, 120], [79, 180, 255], [255, 138, 74], [0, 255, 0]];
/** Largest distance of a previewed vertex from that of v3dctl edit, metres. */
const SAME_M = 0.003;
let browser, page, probe, skeleton;

const v3dctl = (...parts) => execFileSync(join(build, 'bin/v3dctl'), parts, { stdio: ['ignore', 'pipe', 'ignore'] });
const open = async (take, pulse) => {
  await page.goto(`${studio.address}#take=${take}&pulse=${pulse}`);
  await page.reload();
  await probe.showsPulse(pulse);
};
const openPerson = async (pulse, take = 'person') => {
  await open(take, pulse);
  await page.waitForSelector('#skeleton:not([hidden])');
};
const positions = () => page.$eval('#canvas', (canvas) => Array.from(canvas.positions));

/** Pixels of the stage as [x, y] on the page whose colour is near the wanted one. */
const pixelsOf = async (wanted) => {
  const box = await page.locator('#canvas').boundingBox();
  await probe.settled();
  await probe.drawn();
  const clip = { x: box.x, y: box.y + 60, width: Math.floor(box.width), height: Math.floor(box.height - 120) };
  const pixels = await probe.decode(await page.screenshot({ clip }));
  const found = [];
  for (let at = 0; at < pixels.length; at += 4) {
    if (!isNear(wanted)([...pixels.subarray(at, at + 3)])) continue;
    found.push([clip.x + (at / 4) % clip.width + 0.5, clip.y + Math.floor(at / 4 / clip.width) + 0.5]);
  }
  return found;
};

/** The surface of a take at a frame: x, y, z of each vertex. */
const surfaceOf = (take, frame) => {
  const module = new WebAssembly.Module(readFileSync(join(build, 'codec/v3d_decoder.wasm')));
  const motion = new Motion(module, readFileSync(join(takes, take, 'motion.v3d')));
  const segment = motion.segments.findIndex(({ pulses }) => pulses.includes(frame));
  return Array.from(motion.decode(segment, motion.segments[segment].pulses.indexOf(frame)).positions);
};
/** Distances of the vertices of two surfaces, metres, ascending. */
const distances = (a, b) => {
  assert.equal(a.length, b.length);
  return Array.from({ length: a.length / 3 }, (_, v) => Math.hypot(...[0, 1, 2].map((k) => a[3 * v + k] - b[3 * v + k])))
    .sort((x, y) => x - y);
};

const setDegrees = async (degrees) => {
  await page.locator('#bend-degrees').fill(String(degrees));
  await probe.shows('bend-angle', `${degrees}°`);
};
/** Saves the edit file, applies it to the person, and returns the path of the file. */
const saveEdit = async (name) => {
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#bend-save')]);
  assert.equal(download.suggestedFilename(), 'edit.json');
  const saved = join(studio.folder, `${name}.json`);
  await download.saveAs(saved);
  v3dctl('edit', join(takes, 'person'), saved, join(takes, name));
  return JSON.parse(readFileSync(saved));
};

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [studio.folder]);
  v3dctl('skeleton', join(takes, 'person'));
  skeleton = readFileSync(file, 'utf8');
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 1100, height: 760 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  probe = new PageProbe(page);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('plays a take that has a motion file and no meshes', async () => {
  await open('person', 3);
  await probe.shows('facts', 'tracked');
  assert.ok(await page.locator('#trouble').isHidden());
  for (const hidden of ['#motion-on', '[data-look=view]', '[data-look=confidence]']) assert.ok(await page.locator(hidden).isHidden(), hidden);
  assert.ok(await page.locator('#freeze').isVisible());
  const from = await positions();
  await page.keyboard.press('End');
  await probe.showsPulse(39);
  assert.ok(distances(from, await positions()).at(-1) > 0.3, 'the person has moved');
  await page.keyboard.press('m');
  await page.keyboard.press('4');
  await probe.showsPulse(39);
  assert.equal(await page.locator('[data-look=colour][aria-pressed=true]').count(), 1);
});

test('shows such a take in a scene', async () => {
  mkdirSync(join(takes, 'staged'));
  writeFileSync(join(takes, 'staged/scene.json'), JSON.stringify({ v3d_scene: 1, rate_hz: 25, seconds: 1, takes: [{ take: '../person' }],
    camera: { keys: [{ at_s: 0, eye: [3, 0, 1], look: [0, 0, 1] }] } }));
  await page.goto(`${studio.address}#scene=staged&at=0`);
  await page.reload();
  await probe.settles('staged');
  assert.ok((await pixelsOf(GREY)).length > 1000);
});

test('reports a damaged motion file of a take without meshes', async () => {
  const motion = join(takes, 'person/motion.v3d');
  const bytes = readFileSync(motion);
  writeFileSync(motion, bytes.subarray(0, bytes.length - 1));
  await page.goto(`${studio.address}#take=person`);
  await page.reload();
  await probe.shows('trouble', 'motion.v3d of this take is damaged.');
  writeFileSync(motion, bytes);
});

test('shows meshes with all looks again after a take without meshes', async () => {
  await page.click('[data-take=ball]');
  await page.waitForSelector('[data-look=view]:not([hidden])');
  await page.waitForSelector('#motion', { state: 'hidden' });
  await page.waitForSelector('#skeleton', { state: 'hidden' });
});

test('draws bones over the surface', async () => {
  await openPerson(3);
  const without = await pixelsOf(GREY);
  assert.ok(without.length > 1000);
  await page.keyboard.press('j');
  await page.waitForSelector('#canvas[data-skeletons="1"]');
  assert.equal(await page.locator('#skeleton-on[aria-pressed=true]').count(), 1);
  assert.equal(await probe.text('skeleton-note'), '');
  assert.ok((await pixelsOf(GREY)).length < without.length - 500);
});

test('draws left and right in different colours, and chooses the joint of a clicked bone', async () => {
  const certain = JSON.parse(skeleton);
  for (const pulse of certain.pulses) pulse.confidences.fill(1);
  writeFileSync(file, JSON.stringify(certain));
  await openPerson(3);
  await page.keyboard.press('j');
  await page.waitForSelector('#canvas[data-skeletons="1"]');
  for (const [colour, side] of [[LEFT, 'left'], [RIGHT, 'right']]) {
    const pixels = await pixelsOf(colour);
    assert.ok(pixels.length > 100, `${side}: ${pixels.length} pixels`);
    await page.mouse.click(...pixels.at(-1)); // the lowest: at the foot
    await page.waitForFunction((start) => document.getElementById('joint').selectedOptions[0].textContent.startsWith(start), side);
  }
  writeFileSync(file, skeleton);
});

test('draws the skeletons of several performers, without hidden ones', async () => {
  const joints = [{ name: 'pelvis', parent: null }, { name: 'neck', parent: 'pelvis', bone_m: 0.3 }];
  const of = (x) => JSON.stringify({ format: 'v3d-skeleton', version: 1, rate_hz: 25, stature_m: 1.7, joints,
    pulses: [{ pulse: 0, positions: [[x, 0, 0.9], [x, 0, 1.2]], rotations: [[1, 0, 0, 0], [1, 0, 0, 0]], confidences: [1, 1] }] });
  writeFileSync(join(takes, 'pair/skeleton.json'), of(-0.1));
  writeFileSync(join(takes, 'pair/skeleton.performer2.json'), of(0.1));
  await open('pair', 0);
  await page.waitForSelector('#skeleton:not([hidden])');
  await page.keyboard.press('j');
  await page.waitForSelector('#canvas[data-skeletons="2"]');
  await page.click('[data-performer="2"] button[aria-pressed]');
  await page.waitForSelector('#canvas[data-skeletons="1"]');
  assert.ok(await page.locator('#bend-on').isDisabled(), 'without a skin');
});

test('plots the turns of a joint, and seeks by a click', async () => {
  await openPerson(3);
  await page.keyboard.press('g');
  await page.waitForSelector('#angles:not([hidden])');
  await page.selectOption('#joint', { label: 'left shoulder' });
  const side = await page.$eval('#angles .turn-1[d]', (path) => path.getAttribute('d').match(/[ML]/g).join(''));
  assert.equal(side, `M${'L'.repeat(39)}`);
  const heights = await page.$eval('#angles .turn-1[d]', (path) => path.getAttribute('d').match(/ [\d.-]+/g).map(Number));
  assert.ok(Math.max(...heights) - Math.min(...heights) > 20, 'the arm is raised sideways');
  const area = await page.locator('#angles .area').boundingBox(), line = await page.locator('#timeline').boundingBox();
  assert.ok(Math.abs(area.x - line.x) < 1 && Math.abs(area.width - line.width) < 1, 'the same time axis');
  await page.mouse.click(area.x + (area.width * 26) / 39, area.y + 20);
  await probe.showsPulse(26);
});

test('marks the pulses with similar poses, and jumps to one', async () => {
  await openPerson(8);
  await page.keyboard.press('y');
  await page.waitForSelector('#timeline .similar');
  const [best] = await page.$$eval('#timeline .similar', (marks) => marks.map((mark) => Number(mark.dataset.pulse)));
  assert.ok(Math.abs(best - 28) <= 1 || Math.abs(best - 32) <= 1, `pulse ${best}`); // the arm rises and falls alike
  await page.click(`#timeline .similar[data-pulse="${best}"]`);
  await probe.showsPulse(best);
  const marks = await page.$$eval('#timeline .similar', (all) => all.map((mark) => Number(mark.dataset.pulse)));
  assert.ok(marks.length > 0 && marks.every((pulse) => Math.abs(pulse - best) >= 13), `${marks}`);
});

test('previews a bend that v3dctl edit makes the same', async () => {
  await openPerson(20);
  await page.keyboard.press('h');
  await page.selectOption('#joint', { label: 'left shoulder' });
  const straight = await positions();
  await setDegrees(-60);
  const bent = await positions();
  assert.ok(distances(straight, bent).at(-1) > 0.2, 'the hand moves');
  const { operations } = await saveEdit('bent');
  assert.equal(operations.length, 1);
  assert.deepEqual(operations[0], { do: 'bend', joint: 'left_shoulder', degrees: -60, axis: [0, 1, 0], frames: [7, 34], ramp: 6 });
  assert.ok(distances(bent, surfaceOf('bent', 20)).at(-1) < SAME_M);
  await page.keyboard.press('Home');
  await probe.showsPulse(0);
  assert.ok(distances(await positions(), surfaceOf('bent', 0)).at(-1) < SAME_M, 'a frame outside the range');
  const line = await page.locator('#timeline').boundingBox();
  await page.mouse.click(line.x + (line.width * 9) / 39, line.y + line.height / 2);
  await probe.showsPulse(9);
  const ramp = await positions();
  assert.ok(distances(ramp, surfaceOf('bent', 9)).at(-1) < SAME_M, 'a frame of the ramp');
  assert.ok(distances(ramp, surfaceOf('person', 9)).at(-1) > 0.02);
});

test('cannot bend an edited take whose operations are damaged', async () => {
  const edits = join(takes, 'bent/edit.json');
  const text = readFileSync(edits);
  writeFileSync(edits, '{"format": "v3d-scene"}');
  await openPerson(12, 'bent');
  await probe.shows('skeleton-note', 'edit.json: format: expected "v3d-edit"');
  assert.ok(await page.locator('#bend-on').isDisabled());
  writeFileSync(edits, text);
});

test('adds a bend to the operations of an edited take', async () => {
  await openPerson(12, 'bent');
  await page.keyboard.press('h');
  await page.selectOption('#joint', { label: 'right shoulder' });
  await page.locator('#bend-from').fill('5');
  await page.locator('#bend-to').fill('20');
  await page.locator('#bend-ramp').fill('2');
  await page.keyboard.press('Enter');
  await setDegrees(40);
  await probe.shows('skeleton-note', 'the take that this one was made from');
  const bent = await positions();
  const { operations } = await saveEdit('twice');
  assert.deepEqual(operations.map(({ joint, frames }) => [joint, frames]), [['left_shoulder', [7, 34]], ['right_shoulder', [5, 21]]]);
  assert.ok(distances(bent, surfaceOf('twice', 12)).at(-1) < SAME_M);
});

test('bends by dragging a ring around the joint', async () => {
  await openPerson(20);
  await page.keyboard.press('h');
  await page.selectOption('#joint', { label: 'left shoulder' });
  const straight = await positions();
  const ring = await pixelsOf(RING);
  assert.ok(ring.length > 20, `${ring.length} pixels`);
  const [x, y] = ring[Math.floor(ring.length / 3)];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 20, y + 20, { steps: 4 });
  await page.mouse.move(x + 50, y + 40, { steps: 4 });
  await page.mouse.up();
  assert.notEqual(await probe.text('bend-angle'), '0°');
  assert.ok(distances(straight, await positions()).at(-1) > 0.02);
  assert.equal(await page.$eval('#bend-axis', (list) => list.selectedOptions[0].textContent), 'bend (y)');
  await page.click('#bend-reset');
  assert.equal(distances(straight, await positions()).at(-1), 0);
});

test('shows the skeleton after the server was busy', async () => {
  let busy = true;
  await page.route('**/takes/person/skeleton.json', (route) => {
    if (!busy) return route.continue();
    busy = false;
    return route.fulfill({ status: 503, body: 'too many open files; try again\n' });
  });
  await openPerson(4);
  assert.equal(busy, false);
  await page.waitForSelector('#trouble', { state: 'hidden' });
  assert.ok(await page.locator('#bend-on').isEnabled());
  await page.unroute('**/takes/person/skeleton.json');
});

test('reports a damaged skeleton.json in one line, and plays the take', async () => {
  const whole = JSON.parse(skeleton);
  const damage = [
    ['{', 'skeleton.json: is no JSON'],
    [JSON.stringify({ ...whole, format: 'v3d-edit' }), 'skeleton.json: format: expected "v3d-skeleton"'],
    [JSON.stringify({ ...whole, skins: [{ ...whole.skins[0], weights: 'AAAA' }] }), 'skeleton.json: skins[0].weights: expected 8 bytes'],
  ];
  for (const [text, note] of damage) {
    writeFileSync(file, text);
    await openPerson(4);
    await probe.shows('skeleton-note', note);
    await page.keyboard.press('j');
    await page.keyboard.press('ArrowRight');
    await probe.showsPulse(5);
    assert.equal(await page.getAttribute('#canvas', 'data-skeletons'), '0');
  }
  writeFileSync(file, skeleton);
});
