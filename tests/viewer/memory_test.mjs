// Soak test of the page's memory: plays two thousand meshes, or V3D_MESHES=10000, as fast as the page shows them.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { megabytes, memoryOf } from './page_memory.mjs';
import { launchBrowser, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const MESHES = Number(process.env.V3D_MESHES ?? 2_000);
const SAMPLES = 10;
// The growth is measured after the first two samples, when code is compiled and buffers have their size. A leak of one array of
// a mesh in a hundred meshes would exceed both bounds.
const MAX_HEAP_GROWTH = 4e6;
const MAX_RESIDENT_GROWTH = 32e6;
let browser, page;

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [studio.folder]);
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 420, height: 320 } });
  page.setDefaultTimeout(TIMEOUT_MS);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('uses constant memory while it plays', async (story) => {
  await page.goto(`${studio.address}#take=ball`);
  await page.waitForFunction(() => Number(document.getElementById('canvas').dataset.shown) > 0);
  await page.selectOption('#speed', '4');
  const samples = [];
  for (let n = 1; n <= SAMPLES; ++n) {
    const meshes = Math.round((MESHES * n) / SAMPLES);
    await page.waitForFunction((wanted) => Number(document.getElementById('canvas').dataset.shown) >= wanted, meshes, { timeout: 0 });
    const { heap, resident } = await memoryOf(browser, page);
    samples.push({ heap, resident });
    story.diagnostic(`after ${meshes} meshes: ${megabytes(heap)} MB of JavaScript, ${megabytes(resident)} MB resident`);
  }
  const growth = (what) => samples.at(-1)[what] - Math.max(...samples.slice(0, 2).map((sample) => sample[what]));
  story.diagnostic(`growth: ${megabytes(growth('heap'))} MB of JavaScript, ${megabytes(growth('resident'))} MB resident`);
  assert.ok(growth('heap') <= MAX_HEAP_GROWTH, `the JavaScript heap has grown by ${growth('heap')} bytes, expected at most ${MAX_HEAP_GROWTH}`);
  assert.ok(growth('resident') <= MAX_RESIDENT_GROWTH, `the renderer has grown by ${growth('resident')} bytes, expected at most ${MAX_RESIDENT_GROWTH}`);
});
