// Soak test of the memory of the page and of the process that draws: shows two thousand meshes of each story, or V3D_MESHES=10000, as
// fast as the page shows them.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { megabytes, memoryOf } from './page_memory.mjs';
import { launchBrowser, LCM_URL, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const MESHES = Number(process.env.V3D_MESHES ?? 2_000);
const SAMPLES = 10;
/** Of the live meshes that are sent, per second. */
const RATE = 50;
// The growth is measured after the first two samples, when code is compiled and buffers have their size. A leak of one array of
// a mesh in a hundred meshes would exceed both bounds.
const MAX_GROWTH = { heap: 4e6, resident: 32e6, graphics: 32e6 };
const WORDS = { heap: 'of JavaScript', resident: 'of the renderer', graphics: 'of the process that draws' };
let browser, page;

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [studio.folder]);
  execFileSync(join(build, 'bin/v3dctl'), ['skeleton', join(studio.folder, 'takes/person')], { stdio: 'ignore' });
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 420, height: 320 } });
  page.setDefaultTimeout(TIMEOUT_MS);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

async function open(hash) {
  await page.goto(`${studio.address}#${hash}`);
  await page.reload();
  await page.waitForFunction(() => Number(document.getElementById('canvas').dataset.shown) > 0);
}

/** Shows the meshes, and checks that the memory of no process grows. */
async function usesConstantMemory(story) {
  const samples = [];
  for (let n = 1; n <= SAMPLES; ++n) {
    const meshes = Math.round((MESHES * n) / SAMPLES);
    await page.waitForFunction((wanted) => Number(document.getElementById('canvas').dataset.shown) >= wanted, meshes, { timeout: 0 });
    const sample = await memoryOf(browser, page);
    samples.push(sample);
    story.diagnostic(`after ${meshes} meshes: ${Object.keys(WORDS).map((what) => `${megabytes(sample[what])} MB ${WORDS[what]}`).join(', ')}`);
  }
  for (const [what, most] of Object.entries(MAX_GROWTH)) {
    const growth = samples.at(-1)[what] - Math.max(...samples.slice(0, 2).map((sample) => sample[what]));
    story.diagnostic(`growth: ${megabytes(growth)} MB ${WORDS[what]}`);
    assert.ok(growth <= most, `the memory ${WORDS[what]} has grown by ${growth} bytes, expected at most ${most}`);
  }
}

test('uses constant memory while it plays', async (story) => {
  await open('take=ball');
  await page.selectOption('#speed', '4');
  await usesConstantMemory(story);
});

test('uses constant memory while it draws bones', async (story) => {
  await open('take=person');
  await page.waitForSelector('#skeleton:not([hidden])');
  await page.click('#skeleton-on');
  await page.selectOption('#speed', '4');
  await usesConstantMemory(story);
});

test('uses constant memory while it shows live meshes', async (story) => {
  // A page that draws slowly misses most of them: the sender must not end before.
  const sender = spawn(join(build, 'tests/viewer_live'), [LCM_URL, 1_000_000, RATE, 0, 1].map(String), { stdio: 'ignore' });
  try {
    await open('live');
    await usesConstantMemory(story);
  } finally {
    sender.kill();
  }
});
