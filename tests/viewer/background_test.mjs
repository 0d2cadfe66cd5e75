// Browser tests of scenes in front of an image, a spherical image and a video, and of scrubbing.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { PageProbe, isNear } from './eyes.mjs';
import { launchBrowser, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const { folder } = studio;
let browser, page, probe;

const RED = [200, 30, 30];
const GREEN = [40, 200, 40];
const BLUE = [30, 30, 200];
const YELLOW = [200, 200, 30];
const hex = (colour) => `0x${colour.map((c) => c.toString(16).padStart(2, '0')).join('')}`;
/** Near a colour of a video, which is rounded as luma and two chroma values. */
const isLike = (wanted) => (colour) => colour.every((c, k) => Math.abs(c - wanted[k]) <= 16);

const ffmpeg = (...words) => execFileSync('ffmpeg', ['-nostdin', '-loglevel', 'error', '-y', ...words], { cwd: folder });
/** Inputs of ffmpeg: one image of each colour. */
const patches = (colours, size) => colours.flatMap((colour) => ['-f', 'lavfi', '-i', `color=${hex(colour)}:s=${size}:r=10:d=1,format=rgb24`]);

function saveScene(name, background) {
  const scene = {
    v3d_scene: 1, rate_hz: 10, seconds: 4, background,
    takes: [{ take: '../ball' }],
    camera: { keys: [{ at_s: 0, eye: [0, -3, 1], look: [0, 0, 1], fov_deg: 50 }] },
  };
  writeFileSync(join(folder, 'takes', name, 'scene.json'), JSON.stringify(scene));
}
const openAt = async (name, at) => {
  await page.goto('about:blank');
  await page.goto(`${studio.address}#scene=${name}&at=${at}`);
  await probe.settles(name);
};

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [folder]);
  for (const name of ['still', 'sky', 'film']) mkdirSync(join(folder, 'takes', name));
  ffmpeg(...patches([RED, YELLOW], '64x64'), '-filter_complex', 'hstack', '-frames:v', '1', 'takes/still/wall.png');
  // From left to right: behind the camera on its left, left, ahead, right, as in the spherical image.
  ffmpeg(...patches([RED, GREEN, BLUE, YELLOW], '32x64'), '-filter_complex', 'hstack=inputs=4', '-frames:v', '1', 'takes/sky/sky.png');
  ffmpeg(...patches([RED, GREEN, BLUE, YELLOW], '64x48'), '-filter_complex', 'concat=n=4', '-c:v', 'libvpx', '-b:v', '500k',
    '-g', '5', 'takes/film/film.webm');
  saveScene('still', { image: 'wall.png' });
  saveScene('sky', { sphere: 'sky.png' });
  saveScene('film', { video: 'film.webm' });
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 1000, height: 640 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  probe = new PageProbe(page);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

const left = () => probe.colourAt(0.04, 0.9);
const right = () => probe.colourAt(0.96, 0.9);

test('shows a scene in front of an image', async () => {
  await openAt('still', 0.2);
  await probe.becomes(isNear(RED), 'its left half', left);
  await probe.becomes(isNear(YELLOW), 'its right half', right);
  await probe.becomes(isNear(GREEN), 'the ball in front of it');
});

test('keeps the background when the question for another file is cancelled', async () => {
  await openAt('still', 0.2);
  await probe.becomes(isNear(RED), 'its left half', left);
  page.once('dialog', (dialog) => void dialog.dismiss());
  await page.selectOption('[data-edit=background]', 'video', { force: true });
  assert.equal(await page.inputValue('[data-edit=background]'), 'image');
  await probe.settles('still');
  await probe.becomes(isNear(RED), 'its left half', left);
});

test('shows a scene inside a spherical image', async () => {
  await openAt('sky', 0.2);
  // The camera looks towards +y, a quarter from the left of the image, where red ends and green begins.
  await probe.becomes(isNear(RED), 'left of +y', left);
  await probe.becomes(isNear(GREEN), 'right of +y', right);
});

test('shows the frame of a video at the time of the scene', async () => {
  const wanted = [RED, GREEN, BLUE, YELLOW];
  for (const second of [2, 0, 3, 1]) {
    await openAt('film', second + 0.5);
    await probe.becomes(isLike(wanted[second]), `${second}.5 s`, left);
  }
});

test('shows the frame of a video after steps, scrubbing and playback', async () => {
  await openAt('film', 0.5);
  await probe.becomes(isLike(RED), 'at 0.5 s', left);
  const line = await page.locator('#timeline').boundingBox();
  const at = (second) => [line.x + line.width * (second / 3.9), line.y + line.height / 2];
  await page.mouse.move(...at(0.5));
  await page.mouse.down();
  for (const [second, colour] of [[1.5, GREEN], [2.5, BLUE], [3.5, YELLOW], [1.5, GREEN]]) {
    await page.mouse.move(...at(second), { steps: 4 });
    await probe.becomes(isLike(colour), `scrubbed to ${second} s`, left);
  }
  await page.mouse.up();
  await page.focus('#canvas');
  for (let step = 0; step < 10; ++step) await page.keyboard.press('ArrowRight');
  await probe.becomes(isLike(BLUE), 'a second on', left);
  await page.keyboard.press(' ');
  await probe.becomes(isLike(YELLOW), 'played on', left);
  await probe.becomes(isLike(RED), 'played from the beginning again', left);
});

test('shows every mesh under the pointer while scrubbing', async () => {
  await page.goto('about:blank');
  await page.goto(`${studio.address}#take=ball&pulse=0`);
  await probe.showsPulse(0);
  const line = await page.locator('#timeline').boundingBox();
  const at = (pulse) => [line.x + line.width * (pulse / 59), line.y + line.height / 2];
  await page.mouse.move(...at(0));
  await page.mouse.down();
  for (const pulse of [10, 50, 20, 58, 33, 5]) {
    await page.mouse.move(...at(pulse), { steps: 3 });
    await probe.showsPulse(pulse);
    await probe.becomes(isNear(pulse < 30 ? [40, 200, 40] : [40, 40, 200]), `pulse ${pulse}`);
  }
  await page.mouse.up();
  await page.mouse.move(...at(40));
  assert.equal(await probe.shownPulse(), 5, 'the pointer is released');
});
