// Browser tests of live meshes, sent by viewer_live (send_live.cc) through LCM and the real v3d-viewd. Every mesh that the page
// shows must be the complete ball of its pulse, in spite of earlier losses.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { join } from 'node:path';
import { createInterface } from 'node:readline';
import { after, before, test } from 'node:test';
import { PageProbe } from './eyes.mjs';
import { launchBrowser, LCM_URL, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const RATE = 20;
const SEED = 8;
/** Largest error of a latency: that of the offset between the clocks, which is measured by messages. */
const MAX_ERROR_MS = 200;
let browser, page, probe;

/**
 * Sends live meshes. `over` resolves with a list that says of each pulse whether it is a key frame, whether it was lost, and when its
 * edge was, ms since 1970; `fates` is the list so far. Before a loss after sent meshes, `beforeLoss` is called with the list until then, and the sender waits for it.
 */
function sendLive(pulses, lostPercent, beforeLoss = async () => {}) {
  const sender = spawn(join(build, 'tests/viewer_live'), [LCM_URL, pulses, RATE, lostPercent, SEED].map(String));
  const fates = [];
  const over = new Promise((done, fail) => {
    createInterface({ input: sender.stdout }).on('line', (line) => {
      if (line === 'pause') {
        beforeLoss(fates).then(() => sender.stdin.write('\n')).catch((error) => {
          fail(error);
          sender.kill();
        });
        return;
      }
      const [pulse, kind, fate, edge] = line.split(' ');
      fates.push({ pulse: Number(pulse), key: kind === 'key', lost: fate === 'lost', edge: Number(edge) });
    });
    sender.on('close', (status) => (status === 0 ? done(fates) : fail(new Error(`viewer_live ended with ${status}`))));
  });
  return { over, fates, end: () => sender.kill() };
}

/** The pulses that can be shown: those whose frame, and every frame before it until its key frame, was not lost. */
function showable(fates) {
  const pulses = [];
  let whole = false;
  for (const { pulse, key, lost } of fates) {
    whole = !lost && (key || whole);
    if (whole) pulses.push(pulse);
  }
  return pulses;
}

/**
 * Runs in the page before its scripts: checks every mesh that the worker posts. The worker posts the next one at once, not after the
 * page has drawn, because software may draw slower than the meshes come.
 */
function checkMeshes() {
  const seen = (globalThis.seenMeshes = []);
  const wrong = ({ pulse, positions, colours, indices }) => {
    const vertices = positions.length / 3;
    if (vertices < 1000 || indices.length < 3 * vertices) return `${vertices} vertices, ${indices.length} indices`;
    if (indices.some((index) => index >= vertices)) return 'a triangle without a vertex';
    const radius = 0.01 * (12 + (Math.floor(pulse / 5) % 8));
    const level = (factor) => 40 + (pulse * factor) % 170;
    const wanted = [level(67), level(101), level(139)];
    const each = colours.length / vertices;
    for (let v = 0; v < vertices; ++v) {
      const r = Math.hypot(positions[3 * v], positions[3 * v + 1], positions[3 * v + 2] - 1);
      if (Math.abs(r - radius) > 0.015) return `a vertex ${r.toFixed(3)} m from the middle, not ${radius}`;
      for (let c = 0; c < 3; ++c) {
        if (Math.abs(colours[each * v + c] - wanted[c]) > 12) return `the colour ${colours.slice(each * v, each * v + 3)}, not ${wanted}`;
      }
    }
    return '';
  };
  globalThis.Worker = class extends Worker {
    constructor(...how) {
      super(...how);
      this.addEventListener('message', ({ data }) => {
        if (data.kind !== 'frame') return;
        this.postMessage({ kind: 'drawn' });
        seen.push({ pulse: data.frame.pulse, wrong: wrong(data.frame) });
      });
    }
  };
}
const seenMeshes = () => page.evaluate(() => globalThis.seenMeshes);
const seesPulse = (first) => page.waitForFunction((n) => globalThis.seenMeshes.some(({ pulse }) => pulse >= n), first, { timeout: TIMEOUT_MS });

before(async () => {
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 500, height: 400 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  probe = new PageProbe(page);
  await page.addInitScript(checkMeshes);
  await page.goto(`${studio.address}#live`);
  await probe.shows('live-text', 'connected');
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('reports that nothing is live', async () => {
  await probe.shows('trouble', 'Nothing is recorded at the moment');
});

test('recovers at the next key frame after a loss and never shows a damaged mesh', async (story) => {
  // The page shows the newest complete mesh, and a busy machine skips some. The last one before a loss is the newest until the
  // sender continues.
  const seesNewest = async (sent) => {
    const newest = showable(sent).at(-1);
    if (newest !== undefined) await seesPulse(newest);
  };
  const fates = await sendLive(400, 5, seesNewest).over;
  await seesNewest(fates);
  const canBeShown = showable(fates);
  const seen = await seenMeshes();
  const lost = fates.filter((fate) => fate.lost);
  story.diagnostic(`${lost.length} of ${fates.length} frames lost, ${fates.length - canBeShown.length} not to be shown, ${seen.length} shown`);
  assert.ok(lost.some(({ key }) => key) && lost.some(({ key }) => !key), 'key frames and other frames are lost');
  assert.deepEqual(seen.filter(({ wrong }) => wrong), [], 'no mesh is damaged');
  assert.deepEqual(seen.filter(({ pulse }) => !canBeShown.includes(pulse)), [], 'no mesh is shown that depends on a lost frame');
  assert.ok(seen.every(({ pulse }, n) => n === 0 || pulse > seen[n - 1].pulse), 'they are shown in order');
  const lastBeforeLosses = canBeShown.filter((pulse, n) => canBeShown[n + 1] !== pulse + 1);
  assert.ok(lastBeforeLosses.length >= 5, `${lastBeforeLosses.length} stretches between losses`);
  assert.deepEqual(lastBeforeLosses.filter((last) => !seen.some(({ pulse }) => pulse === last)), [], 'it recovers after losses');
});

/** Runs in the page: records each latency with its pulse and the time at which the page states it. */
function recordLatencies() {
  const canvas = document.getElementById('canvas');
  globalThis.latencies = [];
  new MutationObserver(() => {
    const [pulse, ms] = canvas.dataset.latency.split(' ').map(Number);
    globalThis.latencies.push({ pulse, ms, at: performance.timeOrigin + performance.now() });
  }).observe(canvas, { attributeFilter: ['data-latency'] });
}

test('shows the latency of the mesh, from the edge of its pulse to its picture', async (story) => {
  await page.evaluate(recordLatencies);
  const sender = sendLive(2000, 0);
  try {
    await page.waitForFunction(() => globalThis.latencies.length >= 20, null, { timeout: TIMEOUT_MS });
    await probe.shows('facts', 'behind the pulse');
    const [, text] = /(-?\d+) ms behind the pulse/.exec(await probe.text('facts'));
    const latencies = await page.evaluate(() => globalThis.latencies);
    assert.ok(latencies.some(({ ms }) => ms.toFixed(0) === text), `${text} ms is one of ${JSON.stringify(latencies)}`);
    const edges = new Map(sender.fates.map(({ pulse, edge }) => [pulse, edge]));
    // The first may be of the last mesh of the story before.
    const errors = latencies.filter(({ pulse }) => edges.has(pulse)).map(({ pulse, ms, at }) => ms - (at - edges.get(pulse)));
    assert.ok(errors.length >= 10, `${errors.length} of ${latencies.length} latencies are of sent pulses`);
    const largest = Math.max(...errors.map(Math.abs));
    story.diagnostic(`${errors.length} latencies, wrong by at most ${largest.toFixed(1)} ms`);
    assert.ok(largest <= MAX_ERROR_MS, `errors: ${errors}`);
    await probe.shows('title', 'Live: lossy');
  } finally {
    sender.end();
    await sender.over.catch(() => {});
  }
});

test('says that the take has ended, and shows nothing of it to a new page', async () => {
  await probe.shows('trouble', 'the take has ended');
  await probe.shows('title', 'Last live mesh: lossy');
  await page.reload();
  await probe.shows('live-text', 'connected');
  await probe.shows('trouble', 'Nothing is recorded at the moment');
});

test('continues with live meshes after a restart of the service', async () => {
  const sender = sendLive(2000, 0);
  try {
    await studio.stop();
    await probe.shows('live-text', 'connecting');
    const before = (await seenMeshes()).length;
    await studio.start();
    await page.waitForFunction((n) => globalThis.seenMeshes.length > n + 5, before, { timeout: TIMEOUT_MS });
    assert.deepEqual((await seenMeshes()).filter(({ wrong }) => wrong), []);
    assert.match(await probe.text('live-text'), /connected/);
  } finally {
    sender.end();
    await sender.over.catch(() => {});
  }
});

test('reconnects the studio page after a restart of the service', async () => {
  await page.goto(`${studio.address}studio.html`);
  await probe.shows('nodes', 'silent');
  await studio.stop();
  await probe.shows('banner', 'does not answer');
  await studio.start();
  await probe.shows('banner', 'no studio key');
});
