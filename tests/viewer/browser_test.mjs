// Browser tests of the viewer: v3d-viewd, the built page, Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { PageProbe, isNear, openPage } from './eyes.mjs';
import { launchBrowser, NO_GL, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';
import { ssim } from './ssim.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build);
const { folder } = studio;
let browser, page, probe;

const text = (id) => probe.text(id);
const shows = (id, part) => probe.shows(id, part);
const open = (hash) => page.goto(`${studio.address}#${hash}`);
const shownPulse = () => probe.shownPulse();
const showsPulse = (pulse) => probe.showsPulse(pulse);
const decode = (png) => probe.decode(png);
const colourAt = (across, down) => probe.colourAt(across, down);
const becomes = (check, what, seen) => probe.becomes(check, what, seen);
const middleBecomes = (wanted) => becomes(isNear(wanted), `wanted ${wanted}`);

const v3dctl = (...words) => execFileSync(join(build, 'bin/v3dctl'), words, { cwd: folder });

/** A scene with the ball twice, 1.4 s apart, and a model of the ball below them. */
const duel = {
  v3d_scene: 1, rate_hz: 25, seconds: 2,
  background: { colour: '#203040' },
  takes: [
    { take: '../ball', move: [-0.5, 0, 0] },
    { take: '../ball', move: [0.5, 0, 0], turn_deg: [0, 0, 90], start_s: -1.4 },
  ],
  models: [{ model: 'ball.glb', move: [0, 0, -0.5] }],
  camera: { keys: [{ at_s: 0, eye: [0, -3, 1], look: [0, 0, 1] }, { at_s: 2, eye: [1, -2.5, 1.5], look: [0, 0, 1], fov_deg: 50 }] },
};
const GREEN = [40, 200, 40];
const BLUE = [40, 40, 200];

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [folder]);
  mkdirSync(join(folder, 'takes/duel'));
  v3dctl('export', 'takes/ball', '--format', 'glb', '--frames', '0', 'takes/duel/ball.glb');
  writeFileSync(join(folder, 'takes/duel/scene.json'), JSON.stringify(duel));
  await studio.start();
  ({ browser, page, probe } = await openPage());
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('shows the proxy of a take until the full meshes are chosen', async () => {
  const YELLOW = [200, 200, 40];
  const isOn = () => page.getAttribute('#proxy', 'aria-pressed');
  await open('take=proxied&pulse=12');
  await showsPulse(12);
  await middleBecomes(YELLOW);
  assert.equal(await isOn(), 'true');
  assert.ok(await page.locator('[data-look=view]').isHidden(), 'views of cameras are those of the full meshes');
  await page.keyboard.press('ArrowRight');
  await showsPulse(13);
  await page.click('#proxy');
  await middleBecomes(GREEN);
  assert.equal(await shownPulse(), 13, 'the pulse stays');
  assert.equal(await isOn(), 'false');
  assert.ok(await page.locator('[data-look=view]').isVisible());
  await open('take=ball&pulse=12');
  await showsPulse(12);
  assert.ok(await page.locator('#proxy').isHidden(), 'a take without a proxy');
  await open('take=proxied&pulse=14');
  await showsPulse(14);
  await middleBecomes(GREEN);
  await page.keyboard.press('z');
  await middleBecomes(YELLOW);
  await open('take=ball&pulse=12');
  await showsPulse(12);
  await open('take=proxied&pulse=15&mesh=master');
  await showsPulse(15);
  await middleBecomes(GREEN);
});

test('stays at the pulse when the other file of the take has other pulses', async () => {
  const file = join(folder, 'takes/proxied/proxy.v3d');
  const whole = readFileSync(file);
  const index = Number(whole.readBigUInt64LE(whole.length - 24));
  writeFileSync(file, whole.subarray(0, index - 10)); // without its index and its last frame
  const isPlaying = () => page.evaluate(() => document.getElementById('transport').classList.contains('playing'));
  await open('take=ball&pulse=12');
  await open('take=proxied&pulse=12&mesh=proxy');
  await showsPulse(12);
  await middleBecomes([200, 200, 40]);
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('ArrowRight');
  await showsPulse(14);
  await page.keyboard.press('z');
  await middleBecomes(GREEN);
  await showsPulse(14);
  assert.equal(await isPlaying(), false);
  writeFileSync(file, whole);
});

test('reports a damaged proxy, and shows the full meshes without it', async () => {
  const file = join(folder, 'takes/proxied/proxy.v3d');
  const whole = readFileSync(file);
  writeFileSync(file, 'no mesh file, but longer than its header');
  await open('take=ball&pulse=12');
  await open('take=proxied&pulse=12&mesh=proxy');
  await shows('trouble', 'proxy.v3d: This is not a mesh file. Switch Proxy off to see mesh.v3d.');
  await page.click('#proxy');
  await showsPulse(12);
  await middleBecomes(GREEN);
  writeFileSync(file, whole);
});

test('hides a performer, shows one alone, and saves what is visible', async () => {
  await open('take=pair');
  await page.waitForSelector('#performers:not([hidden])');
  assert.equal(await page.locator('[data-performer]').count(), 2);
  await probe.settled();
  const above = () => colourAt(0.5, 0.35), below = () => colourAt(0.5, 0.65);
  await becomes(isNear(BLUE), 'the upper half', above);
  await becomes(isNear(GREEN), 'the lower half', below);
  await page.click('[data-performer="2"] [aria-pressed=true]');
  await becomes((colour) => !isNear(BLUE)(colour), 'the hidden half is gone', above);
  assert.ok(isNear(GREEN)(await below()), 'the other half stays');
  await page.click('[data-performer="2"] button:not([aria-pressed])');
  await becomes(isNear(BLUE), 'the upper half alone', above);
  await becomes((colour) => !isNear(GREEN)(colour), 'without the lower half', below);
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#save-mesh')]);
  assert.equal(download.suggestedFilename(), 'pulse-0.glb');
  const file = readFileSync(await download.path());
  assert.equal(file.toString('latin1', 0, 4), 'glTF');
  const { accessors, meshes } = JSON.parse(file.toString('utf8', 20, 20 + file.readUInt32LE(12)));
  const { min, max } = accessors[meshes[0].primitives[0].attributes.POSITION];
  assert.ok(max[0] - min[0] > 0.35 && max[1] - min[1] < 0.25 && min[1] > 0.95, `the upper half, y up: ${min}, ${max}`);
  await page.click('[data-performer="1"] [aria-pressed=false]');
  await becomes(isNear(GREEN), 'both halves', below);
});

test('shows the pulse of the address in the colours of the mesh', async () => {
  await open('take=ball&pulse=12');
  await showsPulse(12);
  await middleBecomes([40, 200, 40]);
  await page.keyboard.press('2');
  await becomes(([red, green, up]) => up > 100 && (red !== 40 || green !== 200), 'colours of normals, which partly point up, because the camera looks from slightly above');
  await page.keyboard.press('1');
});

test('follows an address to another pulse and to another file of the open take', async () => {
  await open('take=ball&pulse=40');
  await showsPulse(40);
  await middleBecomes(BLUE);
  await page.keyboard.press(' ');
  await open('take=ball&pulse=12');
  await showsPulse(12);
  await middleBecomes(GREEN);
  await open('take=proxied&pulse=12&mesh=proxy');
  await showsPulse(12);
  await middleBecomes([200, 200, 40]);
  await open('take=proxied&pulse=14&mesh=master');
  await showsPulse(14);
  await middleBecomes(GREEN);
  await open('take=ball&pulse=12');
  await showsPulse(12);
});

test('draws a paused take again after the graphics card has lost the picture, and says so until then', async () => {
  await open('take=ball&pulse=12');
  await showsPulse(12);
  await middleBecomes(GREEN);
  const background = await colourAt(0.02, 0.3);
  await page.evaluate(() => (globalThis.loss = document.getElementById('canvas').getContext('webgl2').getExtension('WEBGL_lose_context')).loseContext());
  await shows('trouble', 'The graphics card has lost the picture.');
  await open('take=ball&pulse=13');
  await showsPulse(13);
  assert.match(await text('trouble'), /has lost the picture/, 'it is still lost');
  await page.evaluate(() => globalThis.loss.restoreContext());
  await page.waitForSelector('#trouble', { state: 'hidden' });
  await middleBecomes(GREEN);
  await becomes(isNear(background), 'the background', () => colourAt(0.02, 0.3));
});

test('presses the buttons by the keyboard that reached them, and plays by Space after a click', async () => {
  const pressed = (selector) => page.getAttribute(selector, 'aria-pressed');
  const reach = async (selector) => { // as by Tab from elsewhere
    await page.focus(selector);
    await page.keyboard.press('Shift+Tab');
    await page.keyboard.press('Tab');
    assert.ok(await page.evaluate((s) => document.activeElement.matches(s), selector));
  };
  await reach('[data-take=pair]');
  await page.keyboard.press('Enter');
  await shows('title', 'pair');
  await reach('[data-take=ball]');
  await page.keyboard.press(' ');
  await shows('title', 'ball');
  await open('take=ball&pulse=12');
  await reach('#wireframe');
  await page.keyboard.press(' ');
  assert.equal(await pressed('#wireframe'), 'true');
  await page.keyboard.press('Enter');
  assert.equal(await pressed('#wireframe'), 'false', 'it keeps the focus');
  await page.keyboard.press('x');
  assert.equal(await pressed('#wireframe'), 'true', 'other keys stay shortcuts');
  await page.click('#cameras');
  await page.click('[data-do=loop]');
  const isPlaying = () => page.evaluate(() => document.getElementById('transport').classList.contains('playing'));
  const before = await isPlaying();
  const loop = await pressed('[data-do=loop]');
  await page.keyboard.press(' ');
  await page.waitForFunction((was) => document.getElementById('transport').classList.contains('playing') !== was, before);
  assert.equal(await pressed('[data-do=loop]'), loop, 'Space plays, and does not press the clicked button again');
  await page.click('#cameras');
  await page.click('#wireframe');
  await page.click('[data-do=loop]');
  await open('take=pair');
  await open('take=ball&pulse=12');
  await showsPulse(12);
});

test('steps by meshes and scrubs along the time line', async () => {
  await page.keyboard.press('ArrowRight');
  await showsPulse(13);
  const line = await page.locator('#timeline').boundingBox();
  await page.mouse.click(line.x + line.width * (40 / 59), line.y + line.height / 2);
  await showsPulse(40);
  await middleBecomes([40, 40, 200]);
  await page.mouse.click(line.x + line.width * (29 / 59), line.y + line.height / 2);
  await showsPulse(29);
  await middleBecomes([40, 200, 40]);
  await page.keyboard.press('ArrowRight');
  await showsPulse(33); // 30 to 32 have none
});

test('plays repeatedly from the in point to the out point', async () => {
  await page.keyboard.press('i');
  await page.keyboard.press('Shift+ArrowRight');
  await page.keyboard.press('o');
  await page.keyboard.press(' ');
  const seen = new Set();
  await assert.doesNotReject(async () => {
    const until = Date.now() + TIMEOUT_MS;
    let rounds = 0;
    for (let last = 0; rounds < 2; ) {
      const pulse = await shownPulse();
      if (pulse < last) ++rounds;
      seen.add((last = pulse));
      if (Date.now() > until) throw new Error(`saw only the pulses ${[...seen]}`);
      await page.waitForTimeout(30);
    }
  });
  assert.ok([...seen].every((pulse) => pulse >= 33 && pulse <= 58), `${[...seen]}`);
  await page.keyboard.press(' ');
});

test('shows the view from the position of a camera', async () => {
  await page.click('[data-camera=cam01]');
  await page.waitForSelector('#image-frame:not([hidden])', { timeout: TIMEOUT_MS });
  await middleBecomes([40, 40, 200]);
});

const settles = (scene) => probe.settles(scene);

test('composes takes and models into a scene, each at its place and time', async () => {
  await open('scene=duel&at=0.2');
  await settles('duel');
  await becomes(isNear(GREEN), 'the first ball at 0.2 s', () => colourAt(0.32, 0.5));
  await becomes(isNear(BLUE), 'the second is 1.4 s ahead', () => colourAt(0.68, 0.5));
  await becomes(isNear(GREEN), 'the model below them', () => colourAt(0.5, 0.75));
  await becomes(isNear([32, 48, 64]), 'the background', () => colourAt(0.05, 0.5));
});

test('follows an address to another time of the open scene', async () => {
  await open('scene=duel&at=1.6');
  await shows('facts', '1.60 s');
  await open('scene=duel&at=0.2');
  await shows('facts', '0.20 s');
});

test('renders a scene along its camera path like the native renderer', async (story) => {
  const { x, y, width, height } = await page.locator('#canvas').boundingBox();
  for (const at of [0.2, 1.2]) {
    await open(`scene=duel&at=${at}`);
    await page.reload();
    await page.evaluate(() => document.querySelectorAll('.stage > :not(canvas)').forEach((e) => (e.style.display = 'none')));
    await settles('duel');
    await becomes(isNear([32, 48, 64]), 'the background', () => colourAt(0.02, 0.02));
    v3dctl('render', '--scene', 'takes/duel/scene.json', '--at', String(at), '--size', `${width}x${height}`, 'native.png');
    const native = await decode(readFileSync(join(folder, 'native.png')));
    const shown = await decode(await page.screenshot({ clip: { x, y, width, height } }));
    const alike = ssim(native, shown, width, height);
    story.diagnostic(`SSIM ${alike.toFixed(4)} at ${at} s`);
    assert.ok(alike >= 0.9, `SSIM ${alike.toFixed(4)} at ${at} s`);
  }
  await page.reload();
});

test('saves an edited scene', async () => {
  await settles('duel');
  await page.click('#scene-panel summary >> nth=0');
  await page.fill('#scene-panel [data-edit=move-x] >> nth=0', '-0.25');
  await page.keyboard.press('Tab');
  await page.click('#scene-panel summary:has-text("Camera path")');
  await page.click('[data-edit=key-here]');
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('[data-edit=save]')]);
  const saved = JSON.parse(readFileSync(await download.path(), 'utf8'));
  assert.deepEqual(saved.takes[0], { take: '../ball', move: [-0.25, 0, 0] });
  assert.equal(saved.takes[1].start_s, -1.4);
  assert.equal(saved.camera.keys.length, 3);
});

test('shows the take that was opened while a scene file was read', async () => {
  // The page reads the file when release() is called.
  await page.evaluate(() => {
    const { text } = File.prototype;
    File.prototype.text = async function () {
      await new Promise((done) => (window.release = done));
      return text.call(this);
    };
  });
  await page.setInputFiles('#scene-file', { name: 'late.json', mimeType: 'application/json', buffer: Buffer.from(JSON.stringify(duel)) });
  await page.waitForFunction(() => window.release);
  await page.click('[data-take=ball]');
  await shows('title', 'ball');
  await page.evaluate(() => window.release());
  await probe.settled();
  assert.equal(await text('title'), 'ball');
  assert.ok(await page.isHidden('#scene-panel'));
  await page.reload();
});

test('reports the invalid field of a scene', async () => {
  writeFileSync(join(folder, 'takes/duel/scene.json'), JSON.stringify({ ...duel, seconds: 'long' }));
  await open('scene=duel&at=1');
  await page.reload();
  await shows('trouble', 'duel/scene.json: seconds: expected a number');
});

test('reconnects after a restart of the service', async () => {
  await open('live');
  await shows('live-text', 'connected');
  await studio.stop();
  await shows('live-text', 'connecting');
  await studio.start();
  await shows('live-text', 'connected');
});

test('fetches again what a busy server refused, and says so', async () => {
  const busy = new Set(['/api/takes', '/api/scenes', '/api/takes/sounding/sound', '/api/takes/sounding/rig', '/takes/sounding/motion.v3d']);
  await page.route(/\/(api|takes)\//, (route) => {
    const { pathname } = new URL(route.request().url());
    return busy.delete(pathname) ? route.fulfill({ status: 503, body: 'too many open files; try again\n' }) : route.continue();
  });
  await page.goto('about:blank');
  await open('take=sounding&pulse=0');
  await shows('takes-note', 'too many open files; try again');
  await showsPulse(0); // the address is followed after the second list
  await page.waitForSelector('[data-scene=duel]');
  await page.waitForSelector('#sound:not([hidden])');
  await page.waitForSelector('[data-camera]');
  await page.waitForSelector('#trouble', { state: 'hidden' });
  assert.deepEqual([...busy], []);
  await page.unroute(/\/(api|takes)\//);
});

test('keeps the focus in lists that are fetched again, and opens a take that a later list has', async () => {
  let lists = 0;
  await page.route('**/api/takes', async (route) => {
    const response = await route.fetch();
    const { takes } = await response.json();
    const known = ++lists > 2 ? takes : takes.filter(({ name }) => name !== 'pair');
    return route.fulfill({ json: { takes: known.map((take) => (take.name === 'ball' ? { ...take, seconds: lists } : take)) } });
  });
  await page.goto('about:blank');
  await open('take=pair');
  await shows('trouble', 'There is no take pair.');
  await page.waitForSelector('[data-scene=duel]');
  const remember = (selector) => page.$eval(selector, (button) => {
    globalThis.focused = button;
    button.focus();
  });
  const isFocused = () => page.evaluate(() => document.activeElement === globalThis.focused);
  const isListed = (count) => page.waitForFunction((n) => Number(document.querySelector('[data-take=ball] em').textContent.split(':')[1]) >= n, count);
  await remember('[data-scene=duel]');
  await shows('title', 'pair'); // of the third list
  await isListed(lists + 1);
  assert.ok(await isFocused(), 'a scene');
  await remember('[data-take=ball]');
  await isListed(lists + 1);
  assert.ok(await isFocused(), 'a take that has changed');
  await page.unroute('**/api/takes');
});

test('fetches the decoder again, and reports a worker that is not on the server', async () => {
  let busy = true;
  await page.route('**/v3d_decoder-*.wasm', (route) => {
    if (!busy) return route.continue();
    busy = false;
    return route.fulfill({ status: 503 });
  });
  await page.goto('about:blank');
  await open('take=ball&pulse=12');
  await showsPulse(12);
  assert.equal(busy, false);
  await page.unroute('**/v3d_decoder-*.wasm');
  await page.waitForSelector('[data-scene=duel]');
  const other = await browser.newPage();
  other.setDefaultTimeout(TIMEOUT_MS);
  await other.addInitScript(() => {
    globalThis.Worker = class extends Worker {
      constructor(url, how) {
        super(`${url}-of-another-version`, how);
      }
    };
  });
  await other.goto(`${studio.address}#take=ball&pulse=12`);
  const otherShows = new PageProbe(other);
  await otherShows.shows('trouble', 'A worker of this page could not start');
  await otherShows.shows('title', 'ball');
  assert.match(await otherShows.text('trouble'), /reload the page/, 'also after a take was opened');
  await other.close();
});

test('shows the reason for which the server refuses the lists, and keeps the last ones', async () => {
  const refusal = 'This studio requires a token: open this address with ?token=TOKEN appended, once.';
  const lists = /\/api\/(takes|scenes)$/;
  await page.route(lists, (route) => route.fulfill({ status: 401, body: `${refusal}\n` }));
  await shows('takes-note', refusal);
  await shows('scenes-note', refusal);
  assert.ok(await page.isVisible('[data-scene=duel]'));
  await page.unroute(lists);
});

test('shows operators which nodes are silent', async () => {
  await page.goto(`${studio.address}studio.html`);
  await shows('nodes', 'silent');
  assert.match(await text('nodes'), /Try: systemctl status --all 'v3d-\*' on cap01/);
  assert.match(await text('wall'), /cam01.*cap01 is silent/s);
  assert.match(await text('banner'), /no studio key/);
});

test('reports a browser without WebGL 2', async () => {
  const bare = await launchBrowser(NO_GL);
  const other = await bare.newPage();
  other.setDefaultTimeout(TIMEOUT_MS);
  await other.goto(studio.address);
  await other.waitForFunction(() => document.getElementById('trouble').textContent.includes('no WebGL 2'), null, { timeout: TIMEOUT_MS });
  await bare.close();
});
