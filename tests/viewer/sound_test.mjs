// Browser tests of the sound of takes: v3d-viewd, the built page, Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { PageProbe } from './eyes.mjs';
import { launchBrowser, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
let browser, page, probe;

/** The sound rises from 0.1 to 0.9 of full scale, so its value is its position (make_takes.cc). */
const SAMPLES = 120_000;
const FIRST_SAMPLE = 4800;
const SAMPLES_PER_PULSE = 1921;
const RATE = 25;
const MAX_OFFSET_S = 0.02;
/** The playback skips time after a later picture. */
const MAX_PICTURE_MS = 500;

/**
 * Runs the sound output on the clock of the page, so that a busy machine does not delay its time stamps. Records every
 * part of sound that is started, every position of the playback, and the last values that go to the loudspeakers.
 */
const tapSound = () => {
  const clock = () => performance.now() / 1000;
  const realTime = Object.getOwnPropertyDescriptor(BaseAudioContext.prototype, 'currentTime').get;
  Object.defineProperty(BaseAudioContext.prototype, 'currentTime', { get: clock });
  AudioContext.prototype.getOutputTimestamp = () => {
    const now = performance.now();
    return { contextTime: now / 1000, performanceTime: now };
  };
  const { start, stop } = AudioBufferSourceNode.prototype;
  window.parts = [];
  AudioBufferSourceNode.prototype.start = function (when, offset, duration) {
    const at = offset * this.buffer.sampleRate;
    const [a, b] = [0, 1].map((k) => this.buffer.getChannelData(0)[Math.floor(at) + k]);
    this.part = { when, value: a + (at - Math.floor(at)) * (b - a), stopped: Infinity };
    window.parts.push(this.part);
    start.call(this, Math.max(0, when - clock() + realTime.call(this.context)), offset, duration);
  };
  AudioBufferSourceNode.prototype.stop = function () {
    this.part.stopped = clock();
    stop.call(this);
  };
  const { connect } = AudioNode.prototype;
  AudioNode.prototype.connect = function (to, ...rest) {
    if (to instanceof AudioDestinationNode) {
      window.tap ??= new AnalyserNode(to.context, { fftSize: 32 });
      connect.call(this, window.tap);
    }
    return connect.call(this, to, ...rest);
  };
  window.positions = [];
  document.addEventListener('DOMContentLoaded', () => {
    const canvas = document.getElementById('canvas');
    new MutationObserver(() => window.positions.push(canvas.dataset.position.split(' ').map(Number)))
      .observe(canvas, { attributeFilter: ['data-position'] });
  });
};

/** The newest value that goes to the loudspeakers, and what the page says of the sound. */
const listen = () => page.evaluate(() => {
  const values = new Float32Array(32);
  window.tap?.getFloatTimeDomainData(values);
  return { value: values[31], state: document.getElementById('canvas').dataset.sound };
});

const heardPulse = (value) => (((value - 0.1) / 0.8) * SAMPLES - FIRST_SAMPLE) / SAMPLES_PER_PULSE;

/** The position of the playback at a time of the page; null where it jumps, or waits for a late picture. */
function playbackAt(positions, ms) {
  const next = positions.findIndex(([now]) => now > ms);
  if (next < 1) return null;
  const [[t0, p0], [t1, p1]] = [positions[next - 1], positions[next]];
  return p1 > p0 && t1 - t0 < MAX_PICTURE_MS ? p0 + ((ms - t0) / (t1 - t0)) * (p1 - p0) : null;
}

/** How much later than its picture every part of sound was heard, seconds. */
const offsets = async () => {
  const { parts, positions } = await page.evaluate(() => ({ parts: window.parts, positions: window.positions }));
  return parts.filter(({ when, stopped }) => stopped > when)
    .map(({ when, value }) => ({ playback: playbackAt(positions, 1000 * when), pulse: heardPulse(value) }))
    .filter(({ playback }) => playback !== null)
    .map(({ playback, pulse }) => (playback - pulse) / RATE);
};

/** Waits until `check` accepts what is played. */
const becomes = async (check, what) => {
  const until = Date.now() + TIMEOUT_MS;
  for (let heard; !check((heard = await listen())); ) {
    if (Date.now() > until) assert.fail(`${what}: ${JSON.stringify(heard)}`);
  }
};
const isHeard = ({ value }) => value > 0.05;
const isSilent = ({ value }) => value === 0;

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [studio.folder]);
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 400, height: 300 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  await page.addInitScript(tapSound);
  probe = new PageProbe(page);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('offers sound for takes with sound only', async () => {
  await page.goto(`${studio.address}#take=ball&pulse=0`);
  await probe.showsPulse(0);
  assert.ok(await page.locator('#sound').isHidden());
  await page.goto(`${studio.address}#take=sounding&pulse=0`);
  await page.reload();
  await probe.showsPulse(0);
  await page.waitForSelector('#sound[aria-pressed=true]');
  assert.ok(isSilent(await listen()), 'it is paused');
});

test('plays the sound in step with the pictures, through the end of a loop', async () => {
  await page.keyboard.press(' ');
  await becomes(isHeard, 'sound');
  await page.waitForFunction(() => window.positions.some(([, exact], n, all) => n > 0 && exact < all[n - 1][1]));
  const before = (await offsets()).length;
  let found = [];
  for (const until = Date.now() + TIMEOUT_MS; found.length < before + 5 && Date.now() < until; found = await offsets()) await probe.drawn();
  console.log(`${found.length} parts, at most ${(1000 * Math.max(...found.map(Math.abs))).toFixed(1)} ms from their pictures`);
  assert.ok(found.length >= before + 5, `${found.length} parts, ${before} of them in the first loop`);
  for (const offset of found) assert.ok(Math.abs(offset) <= MAX_OFFSET_S, `${found}`);
});

test('is silent at another speed, and plays again at the speed of the recording', async () => {
  await page.selectOption('#speed', '0.5');
  await becomes((heard) => isSilent(heard) && heard.state === 'muted', 'muted');
  await page.selectOption('#speed', '1');
  await becomes(isHeard, 'sound');
});

test('is silent when it is switched off, while the position stays, and while paused', async () => {
  await page.click('#sound');
  await page.waitForSelector('#sound[aria-pressed=false]');
  await becomes(isSilent, 'off');
  await page.keyboard.press('u');
  await becomes(isHeard, 'sound');
  const line = await page.locator('#timeline').boundingBox();
  await page.mouse.move(line.x + 10, line.y + line.height / 2);
  await page.mouse.down();
  await page.mouse.move(line.x + line.width / 2, line.y + line.height / 2, { steps: 3 });
  await becomes(isSilent, 'the position stays');
  await page.mouse.up();
  await page.keyboard.press(' ');
  await becomes(isHeard, 'sound');
  await page.keyboard.press(' ');
  await becomes(isSilent, 'paused');
});

test('plays the sound of each position while scrubbing', async () => {
  await page.evaluate(() => { window.parts.length = 0; });
  const line = await page.locator('#timeline').boundingBox();
  const y = line.y + line.height / 2;
  await page.mouse.move(line.x + 0.1 * line.width, y);
  await page.mouse.down();
  for (const [n, part] of [0.2, 0.35, 0.5, 0.6, 0.7].entries()) {
    await page.mouse.move(line.x + part * line.width, y);
    await page.waitForFunction((count) => window.parts.length > count, n);
  }
  const { parts, positions } = await page.evaluate(() => ({ parts: window.parts, positions: window.positions }));
  for (const { when, value } of parts) {
    const [, exact] = positions.findLast(([now]) => now <= 1000 * when);
    assert.ok(Math.abs(exact - heardPulse(value)) / RATE <= MAX_OFFSET_S, `pulse ${heardPulse(value)} is heard at ${exact}`);
  }
  await becomes(isSilent, 'the position does not change');
  await page.mouse.up();
});

test('reports a sound file that cannot be played until it can, while the pictures go on', async () => {
  const shown = () => page.evaluate(() => Number(document.getElementById('canvas').dataset.shown));
  await page.route('**/sound/*.wav', async (route) => {
    const response = await route.fetch();
    const body = await response.body();
    const format = body.indexOf('fmt ');
    if (format >= 0) body.writeUInt16LE(16, format + 22); // bits of a sample
    await route.fulfill({ response, body });
  });
  await page.reload();
  await probe.showsPulse(0);
  await page.waitForSelector('#sound:not([hidden])');
  await page.keyboard.press(' ');
  await probe.shows('trouble', 'is no 24-bit PCM');
  const before = await shown();
  await page.waitForFunction((count) => Number(document.getElementById('canvas').dataset.shown) >= count, before + 5);
  assert.match(await probe.text('trouble'), /is no 24-bit PCM/, 'the pictures do not remove it');
  assert.equal(await page.getAttribute('#sound', 'data-state'), 'failed');
  await page.unroute('**/sound/*.wav');
  await becomes(isHeard, 'sound');
  await page.waitForSelector('#trouble', { state: 'hidden' });
});
