// Browser tests of the viewer's list of takes: its filters, and the comparison of two takes.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { isNear, openPage } from './eyes.mjs';
import { ServedStudio } from './served_studio.mjs';

const studio = new ServedStudio(process.env.V3D_BUILD);
const { folder } = studio;
let browser, page, probe;

const text = (id) => probe.text(id);
const shows = (id, part) => probe.shows(id, part);
const open = (hash) => page.goto(`${studio.address}#${hash}`);
const showsPulse = (pulse) => probe.showsPulse(pulse);
const colourAt = (across, down) => probe.colourAt(across, down);
const becomes = (check, what, seen) => probe.becomes(check, what, seen);

const GREEN = [40, 200, 40];
const BLUE = [40, 40, 200];

before(async () => {
  execFileSync(join(process.env.V3D_BUILD, 'tests/viewer_takes'), [folder]);
  writeFileSync(join(folder, 'takes/person/slate.toml'), 'scene = "12"\nmark = "circled"\n');
  writeFileSync(join(folder, 'takes/empty/slate.toml'), 'scene = "3"\nmark = "rejected"\n');
  await studio.start();
  ({ browser, page, probe } = await openPage());
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('lists the takes and reports a take without meshes', async () => {
  await open('');
  await shows('takes', 'ball');
  assert.match(await text('takes'), /57 meshes/);
  await page.click('[data-take=empty]');
  await shows('trouble', 'no meshes yet');
});

const listed = () => page.locator('#takes [data-take]').evaluateAll((buttons) => buttons.map((b) => b.dataset.take));

test('finds takes by words and by their state', async () => {
  await open('');
  const all = (await listed()).length;
  await page.fill('#take-words', 'BALL');
  assert.deepEqual(await listed(), ['ball']);
  await shows('takes-note', `1 of ${all} takes`);
  await page.fill('#take-words', '');
  await page.selectOption('#take-state', 'edited');
  assert.deepEqual(await listed(), []);
  await page.selectOption('#take-state', '');
  assert.equal((await listed()).length, all);
});

test('finds takes by the scene and the mark of their slates', async () => {
  await open('');
  await page.waitForSelector('#take-scene option[value="12"]', { state: 'attached' });
  await page.selectOption('#take-scene', '12');
  assert.deepEqual(await listed(), ['person']);
  await page.selectOption('#take-scene', '');
  await page.selectOption('#take-mark', 'circled');
  assert.deepEqual(await listed(), ['person']);
  await page.selectOption('#take-mark', 'not rejected');
  const names = await listed();
  assert.ok(names.includes('ball') && names.includes('person') && !names.includes('empty'), `${names}`);
  await page.selectOption('#take-mark', 'all');
  assert.ok((await listed()).includes('empty'));
});

const isBall = (colour) => isNear(GREEN)(colour) || isNear(BLUE)(colour);
/** The colour of the first ball between two parts of the width of the stage, halfway down; black without one. */
const ballIn = (from, to) => async () => {
  for (let across = from; across < to; across += 0.02) {
    const seen = await colourAt(across, 0.5);
    if (isBall(seen)) return seen;
  }
  return [0, 0, 0];
};

test('shows another take beside the open one', async () => {
  await open('take=ball&pulse=12');
  await showsPulse(12);
  const { x, y, width, height } = await page.locator('#canvas').boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  for (let n = 0; n < 10; ++n) await page.mouse.wheel(0, -500); // close to the ball, so that the other take would be out of sight
  await page.hover('[data-take=pair]');
  await page.click('[data-compare=pair]');
  await shows('title', 'ball and pair');
  await page.keyboard.press('Home');
  await becomes(isBall, 'the ball at the left', ballIn(0.1, 0.5));
  await becomes(isBall, 'the pair at the right', ballIn(0.5, 0.9));
});

test('shows both compared takes at the same pulse', async () => {
  await open('take=ball&pulse=12');
  await showsPulse(12);
  await page.hover('[data-take=sounding]');
  await page.click('[data-compare=sounding]');
  await shows('title', 'ball and sounding');
  await page.keyboard.press('ArrowLeft'); // pauses
  await page.keyboard.press('Home');
  await page.keyboard.press('f');
  await page.keyboard.press('Shift+ArrowRight');
  const forward = async (pulses) => { for (let n = 0; n < pulses; ++n) await page.keyboard.press('ArrowRight'); };
  await forward(4);
  await becomes(isNear(GREEN), 'pulse 29 at the left', ballIn(0.1, 0.5));
  await becomes(isNear(GREEN), 'pulse 29 at the right', ballIn(0.5, 0.9));
  await forward(4);
  await becomes(isNear(BLUE), 'pulse 33 at the left', ballIn(0.1, 0.5));
  await becomes(isNear(BLUE), 'pulse 33 at the right', ballIn(0.5, 0.9));
});
