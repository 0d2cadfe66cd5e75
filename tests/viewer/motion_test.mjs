// Browser tests of tracked surfaces (motion.v3d): v3d-viewd, the built page, Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { isNear, openPage } from './eyes.mjs';
import { ServedStudio } from './served_studio.mjs';
import { Motion } from '../../codec/v3d_decoder.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const file = join(studio.folder, 'takes/moving/motion.v3d');
const [GREEN, RED, BLUE, YELLOW] = [[40, 200, 40], [200, 40, 40], [40, 40, 200], [200, 200, 40]];
let browser, page, probe, motion, bytes;

const showsPulse = (pulse) => probe.showsPulse(pulse);
const middleBecomes = (wanted) => probe.becomes(isNear(wanted), `wanted ${wanted}`);
const uploads = () => page.locator('#canvas').getAttribute('data-uploads');
const isPressed = (id) => page.locator(`#${id}[aria-pressed=true]`).count();
const open = async (pulse) => {
  await page.goto(`${studio.address}#take=moving&pulse=${pulse}`);
  await page.reload();
  await showsPulse(pulse);
};
const seek = async (pulse, first = 0, last = 58) => {
  const line = await page.locator('#timeline').boundingBox();
  await page.mouse.click(line.x + (line.width * (pulse - first)) / (last - first), line.y + line.height / 2);
  await showsPulse(pulse);
};
/** Waits until the facts name the vertices and triangles of this segment. */
const showsTemplate = async ({ vertices, triangles }) => {
  await probe.shows('facts', 'tracked');
  await probe.shows('facts', `${vertices.toLocaleString('en')} vertices`);
  await probe.shows('facts', `${triangles.toLocaleString('en')} triangles`);
};
/** Pixels of the stage without what lies over it. */
const pixels = async () => {
  const { x, y, width, height } = await page.locator('#canvas').boundingBox();
  await probe.settled();
  const clip = { x, y: y + 60, width: width - 10, height: height - 120 };
  return probe.decode(await page.screenshot({ clip }));
};
const differing = (a, b) => {
  let count = 0;
  for (let at = 0; at < a.length; at += 4) if ([0, 1, 2].some((k) => Math.abs(a[at + k] - b[at + k]) > 40)) ++count;
  return count;
};

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [studio.folder]);
  bytes = readFileSync(file);
  motion = new Motion(new WebAssembly.Module(readFileSync(join(build, 'codec/v3d_decoder.wasm'))), bytes);
  await studio.start();
  ({ browser, page, probe } = await openPage());
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('offers motion for takes with tracked surfaces only', async () => {
  await open(3);
  await page.waitForSelector('#motion:not([hidden])');
  assert.equal(await isPressed('motion-on'), 0);
  await page.click('[data-take=ball]');
  await page.waitForSelector('#motion', { state: 'hidden' });
});

test('shows the mesh of a pulse without a tracked surface', async () => {
  await open(3);
  await page.click('#motion-on');
  await probe.shows('motion-note', 'no tracked surface');
  await middleBecomes(GREEN);
});

test('keeps the triangles of the template through the pulses of a segment', async () => {
  await seek(5);
  await showsTemplate(motion.segments[0]);
  await middleBecomes(RED);
  const before = await uploads();
  for (const pulse of [6, 7, 8]) {
    await page.keyboard.press('ArrowRight');
    await showsPulse(pulse);
    await showsTemplate(motion.segments[0]);
  }
  await seek(20);
  await showsTemplate(motion.segments[0]);
  await middleBecomes(BLUE);
  assert.equal(await uploads(), before, 'triangles are uploaded once');
  await seek(27);
  await showsTemplate(motion.segments[1]);
  await middleBecomes(YELLOW);
  assert.equal(await uploads(), String(Number(before) + 1));
  assert.notEqual(motion.segments[0].vertices, motion.segments[1].vertices);
});

test('moves the vertices of the surface', async () => {
  await seek(8);
  const near = await pixels();
  await seek(16);
  assert.ok(differing(near, await pixels()) > 500);
});

test('plays through tracked surfaces and meshes', async () => {
  await seek(3);
  await page.keyboard.press(' ');
  for (const part of ['segment 1 of 2', 'segment 2 of 2']) await probe.shows('facts', part);
  await page.waitForFunction(() => !document.getElementById('facts').textContent.includes('tracked'));
  await page.keyboard.press(' ');
});

test('freezes the texture: all pulses have the colours of the template', async () => {
  await seek(10);
  await middleBecomes(RED);
  const template = [...motion.surface(0).colours.subarray(0, 3)];
  assert.ok(!isNear(RED)(template) && !isNear(BLUE)(template), `${template}`);
  await page.click('#freeze');
  await middleBecomes(template);
  await seek(20);
  await middleBecomes(template);
  await page.keyboard.press('t');
  await middleBecomes(BLUE);
});

test('draws the trail of a clicked point, up to the border of the segment, and clears it', async () => {
  await seek(20);
  await middleBecomes(BLUE);
  const without = await pixels();
  const box = await page.locator('#canvas').boundingBox();
  await page.mouse.click(box.x + box.width * 0.5, box.y + box.height * 0.5);
  await probe.shows('motion-note', '1 of 20 trails');
  await page.waitForSelector('#canvas[data-trails="1 16"]'); // pulses 5 to 20
  assert.ok(differing(without, await pixels()) > 50, 'a line and a dot');
  await page.mouse.click(box.x + 20, box.y + box.height - 80); // beside the surface
  await probe.drawn();
  assert.match(await probe.text('motion-note'), /^1 of 20/);
  await seek(22);
  await page.waitForSelector('#canvas[data-trails="1 18"]');
  await seek(27);
  await page.waitForSelector('#canvas[data-trails="0 0"]');
  await seek(20);
  await page.waitForSelector('#canvas[data-trails="1 16"]');
  await page.click('#clear-trails');
  await page.waitForSelector('#canvas[data-trails="0 0"]');
  assert.equal(differing(without, await pixels()), 0);
  assert.ok(await page.locator('#clear-trails').isDisabled());
});

test('shows the meshes again when motion is off', async () => {
  await page.keyboard.press('m');
  await middleBecomes(GREEN);
  await page.waitForFunction(() => !/tracked/.test(document.querySelector('#facts').textContent)); // follows the picture
});

test('shows the mesh of a pulse whose record is damaged', async () => {
  const damaged = Buffer.from(bytes);
  damaged[damaged.length - 1] ^= 255; // in the last pulse, 29
  writeFileSync(file, damaged);
  await open(29);
  await page.click('#motion-on');
  await probe.shows('motion-note', 'motion.v3d of this take is damaged in part');
  await middleBecomes(GREEN);
  await seek(20);
  await probe.shows('facts', 'tracked');
});

test('reports a damaged file, and plays the meshes', async () => {
  for (const damaged of [bytes.subarray(0, bytes.length - 1), Buffer.alloc(5000, 'x'), Buffer.alloc(0)]) {
    writeFileSync(file, damaged);
    await open(20);
    await page.click('#motion-on');
    await probe.shows('motion-note', 'motion.v3d of this take is damaged');
    assert.equal(await isPressed('motion-on'), 0);
    await page.keyboard.press('ArrowRight');
    await showsPulse(21);
    await middleBecomes(GREEN);
  }
});
