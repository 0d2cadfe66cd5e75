// The viewer as a person has it: v3d-viewd, the built page, Chromium.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { chromium } from '../../tools/viewer/node_modules/playwright-core/index.mjs';

const build = process.env.V3D_BUILD;
const folder = mkdtempSync(join(tmpdir(), 'v3d-browser-'));
const WITHIN = 30_000;
const GL = ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];

const studio = (port) => `
name = "dojo"
[[node]]
name = "cap01"
[[node]]
name = "recon01"
[[camera]]
name = "cam01"
node = "cap01"
address = "127.0.0.11"
[trigger]
node = "cap01"
wire = "trigger.sock"
[space]
min = [-1.5, -1.5, 0.0]
max = [1.5, 1.5, 2.5]
[network]
lcm_url = "udpm://239.255.76.67:7667?ttl=0"
key = "studio.key"
[storage]
takes = "takes"
background = "background"
calib = "takes/ball/calib.toml"
[reconstruction]
node = "recon01"
[viewer]
listen = "127.0.0.1:${port}"
page = "${build}/viewer"
`;

const freePort = () => new Promise((done) => {
  const server = createServer().listen(0, '127.0.0.1', () => {
    const { port } = server.address();
    server.close(() => done(port));
  });
});

let port, daemon, browser, page;

/** Resolves when the daemon serves. */
function startDaemon() {
  return new Promise((done, fail) => {
    daemon = spawn(join(build, 'bin/v3d-viewd'), ['--studio', join(folder, 'studio.toml')]);
    let said = '';
    daemon.stderr.on('data', (data) => {
      said += data;
      if (said.includes('serves http')) done();
    });
    daemon.on('exit', () => fail(new Error(`v3d-viewd ended: ${said}`)));
  });
}
const stopDaemon = () => new Promise((done) => {
  daemon.removeAllListeners('exit').on('exit', done);
  daemon.kill();
});

const text = (id) => page.textContent(`#${id}`);
const shows = (id, part) => page.waitForFunction(([i, p]) => document.getElementById(i).textContent.includes(p), [id, part], { timeout: WITHIN });
const open = (hash) => page.goto(`http://127.0.0.1:${port}/#${hash}`);
const shownPulse = async () => Number(/pulse (\d+)/.exec(await text('facts'))?.[1] ?? -1);
const showsPulse = (pulse) => shows('facts', `pulse ${pulse} `);

/** Of the middle of the stage: [red, green, blue]. */
async function middle() {
  const box = await page.locator('#canvas').boundingBox();
  const at = { x: Math.round(box.x + box.width / 2), y: Math.round(box.y + box.height / 2), width: 1, height: 1 };
  const png = (await page.screenshot({ clip: at })).toString('base64');
  return page.evaluate(async (data) => {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
    const picture = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
    const pen = new OffscreenCanvas(1, 1).getContext('2d');
    pen.drawImage(picture, 0, 0);
    return [...pen.getImageData(0, 0, 1, 1).data.slice(0, 3)];
  }, png);
}
function near(colour, wanted) {
  assert.ok(colour.every((c, k) => Math.abs(c - wanted[k]) <= 6), `${colour} is not ${wanted}`);
}

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [folder]);
  port = await freePort();
  writeFileSync(join(folder, 'studio.toml'), studio(port));
  await startDaemon();
  browser = await chromium.launch({ executablePath: '/usr/bin/chromium', args: GL });
  page = await browser.newPage({ viewport: { width: 800, height: 600 } });
});
after(async () => {
  await browser?.close();
  await stopDaemon();
  rmSync(folder, { recursive: true });
});

test('lists the takes, and says what one lacks', async () => {
  await open('');
  await shows('takes', 'ball');
  assert.match(await text('takes'), /57 meshes/);
  await page.click('[data-take=empty]');
  await shows('trouble', 'no meshes yet');
});

test('shows the pulse that the address names, in the colours of the mesh', async () => {
  await open('take=ball&pulse=12');
  await showsPulse(12);
  near(await middle(), [40, 200, 40]);
  await page.keyboard.press('2');
  const [, , up] = await middle();
  assert.ok(up > 100, 'normals, seen a little from above, point up as well');
  await page.keyboard.press('1');
});

test('steps by meshes and scrubs along the time line', async () => {
  await page.keyboard.press('ArrowRight');
  await showsPulse(13);
  const line = await page.locator('#timeline').boundingBox();
  await page.mouse.click(line.x + line.width * (40 / 59), line.y + line.height / 2);
  await showsPulse(40);
  near(await middle(), [40, 40, 200]);
  await page.mouse.click(line.x + line.width * (29 / 59), line.y + line.height / 2);
  await showsPulse(29);
  near(await middle(), [40, 200, 40]);
  await page.keyboard.press('ArrowRight');
  await showsPulse(33); // 30 to 32 have none
});

test('plays on from the in point to the out point, again and again', async () => {
  await page.keyboard.press('i');
  await page.keyboard.press('Shift+ArrowRight');
  await page.keyboard.press('o');
  await page.keyboard.press(' ');
  const seen = new Set();
  await assert.doesNotReject(async () => {
    const until = Date.now() + WITHIN;
    let turns = 0;
    for (let last = 0; turns < 2; ) {
      const pulse = await shownPulse();
      if (pulse < last) ++turns;
      seen.add((last = pulse));
      if (Date.now() > until) throw new Error(`saw only ${[...seen]}`);
      await page.waitForTimeout(30);
    }
  });
  assert.ok([...seen].every((pulse) => pulse >= 33 && pulse <= 58), `${[...seen]}`);
  await page.keyboard.press(' ');
});

test('stands where a camera stands', async () => {
  await page.click('[data-camera=cam01]');
  await page.waitForSelector('#image-frame:not([hidden])', { timeout: WITHIN });
  near(await middle(), [40, 40, 200]);
});

test('connects again when the service has been restarted', async () => {
  await open('live');
  await shows('live-text', 'connected');
  await stopDaemon();
  await shows('live-text', 'connecting');
  await startDaemon();
  await shows('live-text', 'connected');
});

test('shows operators which nodes are silent', async () => {
  await page.goto(`http://127.0.0.1:${port}/studio.html`);
  await shows('nodes', 'silent');
  assert.match(await text('wall'), /cam01.*cap01 is silent/s);
  assert.match(await text('banner'), /no studio key/);
});

test('says so where the browser has no WebGL 2', async () => {
  const bare = await chromium.launch({ executablePath: '/usr/bin/chromium', args: ['--no-sandbox', '--disable-gpu', '--disable-3d-apis'] });
  const other = await bare.newPage();
  await other.goto(`http://127.0.0.1:${port}/`);
  await other.waitForFunction(() => document.getElementById('trouble').textContent.includes('no WebGL 2'), null, { timeout: WITHIN });
  await bare.close();
});
