// Browser tests of photographs over the view, view-dependent colours and confidence. They use two simulated takes with raw
// frames, of 15 and of 4 cameras, one take without raw frames, and one whose meshes keep the colours
// of cameras instead.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { PageProbe } from './eyes.mjs';
import { launchBrowser, ServedStudio, TIMEOUT_MS } from './served_studio.mjs';
import { ssim } from './ssim.mjs';

const build = process.env.V3D_BUILD;
const studio = new ServedStudio(build, 'takes', 'takes/four/calib.toml');
const { folder } = studio;
let browser, page, probe;

const run = (program, ...words) => execFileSync(join(build, 'bin', program), words, { cwd: folder, stdio: 'pipe' });
const shows = (id, part) => probe.shows(id, part);
const settled = () => probe.settled();
const hidden = (id) => page.evaluate((i) => document.getElementById(i).hidden, id);

async function open(hash) {
  await page.goto(`${studio.address}#${hash}`);
  await page.reload();
}
const setOverlays = (visibility) => page.evaluate((v) => {
  for (const over of document.querySelectorAll('.stage > :not(canvas)')) over.style.visibility = v;
}, visibility);
/** Pixels of the stage, or of a part of it, without overlays. */
async function picture(part = null) {
  const { x, y, width, height } = part ?? (await page.locator('#canvas').boundingBox());
  await setOverlays('hidden');
  await probe.drawn();
  const png = await page.screenshot({ clip: { x, y, width, height } });
  await setOverlays('');
  return { pixels: await probe.decode(png), width, height };
}
const alike = (a, b) => ssim(a.pixels, b.pixels, a.width, a.height);

/**
 * Whole pixels of the screen inside the image frame of the camera at whose position the viewer is. Waits until the page has
 * drawn the frame.
 */
async function imageBox() {
  await page.waitForFunction(() => {
    const frame = document.getElementById('image-frame');
    return !frame.hidden && parseFloat(frame.style.width) > 0;
  }, null, { timeout: TIMEOUT_MS });
  return page.evaluate(() => {
    const canvas = document.getElementById('canvas').getBoundingClientRect();
    const { left, top, width, height } = document.getElementById('image-frame').style;
    const [l, t, w, h] = [left, top, width, height].map(parseFloat);
    const x = Math.ceil(canvas.left + l), y = Math.ceil(canvas.top + t);
    return { x, y, width: Math.floor(w) - 1, height: Math.floor(h) - 1, left: canvas.left + l, top: canvas.top + t, scale: w };
  });
}

/** The photograph without lens distortion at the pixels of `box`, by bilinear interpolation. */
async function undistortedPhotograph(take, pulse, camera, box) {
  const pixels = await page.evaluate(async ([t, p, c, at]) => {
    const rig = (await (await fetch(`api/takes/${t}/rig`)).json()).cameras.find(({ name }) => name === c);
    const jpeg = await fetch(`api/takes/${t}/photographs/${p}/${c}.jpg`);
    if (!jpeg.ok) throw new Error(`${jpeg.status}`);
    const image = await createImageBitmap(await jpeg.blob());
    const pen = new OffscreenCanvas(image.width, image.height).getContext('2d');
    pen.drawImage(image, 0, 0);
    const from = pen.getImageData(0, 0, image.width, image.height).data;
    const [k1, k2, p1, p2, k3] = [0, 1, 2, 3, 4].map((n) => rig.distortion[n] ?? 0);
    if (rig.distortion.slice(5).some((k) => k !== 0)) throw new Error('the test supports at most five distortion coefficients');
    const [[fx, , cx], [, fy, cy]] = rig.matrix;
    const scale = at.scale / rig.width;
    let text = '';
    for (let row = 0; row < at.height; ++row) {
      for (let column = 0; column < at.width; ++column) {
        const x = ((at.x + column + 0.5 - at.left) / scale - 0.5 - cx) / fx;
        const y = ((at.y + row + 0.5 - at.top) / scale - 0.5 - cy) / fy;
        const s = x * x + y * y, radial = 1 + s * (k1 + s * (k2 + s * k3));
        const u = fx * (x * radial + 2 * p1 * x * y + p2 * (s + 2 * x * x)) + cx;
        const v = fy * (y * radial + p1 * (s + 2 * y * y) + 2 * p2 * x * y) + cy;
        const left = Math.floor(u), top = Math.floor(v), right = u - left, down = v - top;
        const between = (channel) => {
          const pixel = (i, j) => from[4 * ((top + j) * image.width + left + i) + channel];
          const upper = pixel(0, 0) + right * (pixel(1, 0) - pixel(0, 0));
          const lower = pixel(0, 1) + right * (pixel(1, 1) - pixel(0, 1));
          return Math.round(upper + down * (lower - upper));
        };
        const inside = left >= 0 && top >= 0 && left + 1 < image.width && top + 1 < image.height;
        text += inside ? String.fromCharCode(between(0), between(1), between(2), 255) : '\x10\x12\x16\xff';
      }
    }
    return btoa(text);
  }, [take, pulse, camera, box]);
  return { pixels: Buffer.from(pixels, 'base64'), width: box.width, height: box.height };
}

const scene = (take) => ({
  v3d_scene: 1, rate_hz: 25, seconds: 0.08, floor: false, background: { colour: '#203040' }, takes: [{ take: `../${take}`, turn_deg: [0, 0, 70] }],
  camera: { keys: [{ at_s: 0, eye: [1.1, -1.9, 1.4], look: [0, 0, 0.95] }] },
});

before(async () => {
  mkdirSync(join(folder, 'takes'));
  for (const [take, cameras] of [['dome', '15'], ['four', '4']]) {
    run('v3d-sim', 'take', `takes/${take}`, '--frames', '3', '--cameras', cameras, '--size', '640x480');
    run('v3dctl', 'reconstruct', `takes/${take}`, '--voxel', '15mm');
    mkdirSync(join(folder, `takes/scene-${take}`));
    writeFileSync(join(folder, `takes/scene-${take}/scene.json`), JSON.stringify(scene(take)));
  }
  mkdirSync(join(folder, 'takes/meshes-alone'));
  for (const file of ['take.toml', 'calib.toml', 'mesh.v3d']) {
    cpSync(join(folder, 'takes/four', file), join(folder, 'takes/meshes-alone', file));
  }
  const kept = join(folder, 'takes/kept');
  cpSync(join(folder, 'takes/dome'), kept, { recursive: true });
  run('v3dctl', 'camera-colours', 'takes/kept');
  for (const file of readdirSync(kept)) if (file.endsWith('.lcmlog')) rmSync(join(kept, file));
  for (const take of ['meshes-alone', 'kept']) {
    const toml = join(folder, 'takes', take, 'take.toml');
    writeFileSync(toml, readFileSync(toml, 'utf8').replace(/^name = .*$/m, `name = '${take}'`));
  }
  mkdirSync(join(folder, 'takes/scene-kept'));
  writeFileSync(join(folder, 'takes/scene-kept/scene.json'), JSON.stringify(scene('kept')));
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 1100, height: 720 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  probe = new PageProbe(page);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('shows the undistorted photograph over the view from its camera', async (story) => {
  await open('take=dome&pulse=1');
  await shows('facts', 'pulse 1 ');
  await page.click('[data-camera=cam07]');
  await page.waitForSelector('#blend:not([hidden])');
  const box = await imageBox();
  const without = await picture(box);
  await page.keyboard.press('b');
  for (let n = 0; n < 6; ++n) await page.keyboard.press('+');
  await settled();
  const photograph = await undistortedPhotograph('dome', 1, 'cam07', box);
  const over = alike(await picture(box), photograph);
  story.diagnostic(`SSIM ${over.toFixed(4)}, without it ${alike(without, photograph).toFixed(4)}`);
  assert.ok(over >= 0.95, `SSIM ${over.toFixed(4)}`);
  await page.keyboard.press('b');
  assert.ok(alike(await picture(box), without) > 0.999, 'the photograph is removed again');
});

test('shows the photograph of the shown pulse over the view, also after playback', async (story) => {
  await page.keyboard.press('b');
  await page.keyboard.press(' ');
  await page.waitForFunction(() => {
    const seen = (window.pulsesSeen ??= new Set());
    seen.add(/pulse (\d+)/.exec(document.getElementById('facts').textContent)?.[1]);
    return seen.size >= 3;
  }, null, { timeout: TIMEOUT_MS });
  await page.keyboard.press(' ');
  await page.keyboard.press('Home');
  await page.keyboard.press('ArrowRight');
  await page.keyboard.press('ArrowRight');
  await shows('facts', 'pulse 2 ');
  await settled();
  const box = await imageBox();
  const shown = await picture(box);
  const right = alike(shown, await undistortedPhotograph('dome', 2, 'cam07', box));
  const wrong = alike(shown, await undistortedPhotograph('dome', 0, 'cam07', box));
  story.diagnostic(`SSIM ${right.toFixed(4)}; with the first pulse's ${wrong.toFixed(4)}`);
  assert.ok(right >= 0.95 && right > wrong, `SSIM ${right.toFixed(4)}, ${wrong.toFixed(4)}`);
});

test('removes the photograph when the view moves away', async () => {
  const { x, y, width, height } = await page.locator('#canvas').boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(x + width / 2 + 60, y + height / 2 + 10, { steps: 4 });
  await page.mouse.up();
  await page.waitForSelector('#blend', { state: 'hidden' });
});

// The takes dome and four have raw frames. The meshes of the take kept have the colours of cameras.
for (const take of ['dome', 'four', 'kept']) {
  test(`renders view-dependent colours of ${take} like the native renderer`, async (story) => {
    await open(`scene=scene-${take}&at=0`);
    await shows('title', `scene-${take}`);
    await settled();
    const plain = await picture();
    await page.keyboard.press('4');
    await settled();
    const shaded = await picture();
    run('v3dctl', 'render', '--scene', `takes/scene-${take}/scene.json`, '--view-dependent', '--at', '0', '--size', `${plain.width}x${plain.height}`, 'native.png');
    const native = { ...plain, pixels: await probe.decode(readFileSync(join(folder, 'native.png'))) };
    const [right, wrong] = [alike(shaded, native), alike(plain, native)];
    story.diagnostic(`SSIM ${right.toFixed(4)}; view-independent colours ${wrong.toFixed(4)}`);
    assert.ok(right >= 0.9 && right > wrong, `SSIM ${right.toFixed(4)}, ${wrong.toFixed(4)}`);
  });
}

test('shows the colours of cameras that the meshes keep, without the server', async () => {
  const asked = [];
  page.on('request', (request) => asked.push(request.url()));
  await open('take=kept&pulse=1');
  await shows('facts', 'pulse 1 ');
  await settled();
  const plain = await picture();
  await page.keyboard.press('4');
  await settled();
  const shaded = await picture();
  assert.equal(await hidden('look-note'), true);
  assert.ok(alike(shaded, plain) < 0.999, 'the colours changed');
  await page.keyboard.press('1');
  await settled();
  assert.ok(alike(await picture(), plain) > 0.999, 'the colours of the mesh are shown again');
  assert.deepEqual(asked.filter((url) => url.includes('/views/')), []);
});

/** Part of the picture in the colour of at least six agreeing cameras: yellow, with any shading. */
async function confidentPart() {
  const { pixels, width, height } = await picture();
  let count = 0;
  for (let n = 0; n < 4 * width * height; n += 4) {
    const [r, g, b] = pixels.subarray(n, n + 3);
    if (r > 130 && g > 120 && b < 0.3 * r) ++count;
  }
  return count / (width * height);
}

test('shows the number of cameras that agree about the surface', async (story) => {
  await open('take=dome&pulse=1');
  await shows('facts', 'pulse 1 ');
  await page.keyboard.press('5');
  await page.waitForSelector('#legend:not([hidden])');
  await settled();
  const dome = await confidentPart();
  await open('take=four&pulse=1');
  await shows('facts', 'pulse 1 ');
  await page.keyboard.press('5');
  await page.waitForSelector('#legend:not([hidden])');
  await settled();
  const four = await confidentPart();
  story.diagnostic(`six cameras agree: ${(100 * dome).toFixed(2)} % of the picture of 15, ${(100 * four).toFixed(2)} % of that of 4`);
  assert.ok(dome > 0.002, `${dome}`);
  assert.ok(four < 0.0002, `four cameras cannot be six: ${four}`);
  await page.keyboard.press('?');
  await shows('confidence-note', 'number of cameras that see a point');
});

test('lists takes with small pictures, where they have raw frames', async () => {
  await open('');
  await page.waitForSelector('[data-take=meshes-alone]', { state: 'attached' });
  await page.locator('[data-take=four]').scrollIntoViewIfNeeded();
  await page.waitForFunction(() => document.querySelector('[data-take=four] img')?.naturalWidth > 0, null, { timeout: TIMEOUT_MS });
  await page.locator('[data-take=meshes-alone]').scrollIntoViewIfNeeded();
  await page.waitForFunction(() => !document.querySelector('[data-take=meshes-alone] img'), null, { timeout: TIMEOUT_MS });
});

test('reports a take without raw frames', async () => {
  await open('take=meshes-alone&pulse=1');
  await shows('facts', 'pulse 1 ');
  await page.keyboard.press('4');
  await shows('look-note', 'which show what each camera sees, are not on this PC');
  await page.keyboard.press('1');
  await page.click('[data-camera=cam02]');
  await page.keyboard.press('b');
  await shows('blend-note', 'cam02 has no photograph at this pulse');
  await page.keyboard.press('b');
  assert.equal(await hidden('look-note'), true);
});

test('returns 404 for a photograph that does not exist', async () => {
  const statuses = await page.evaluate(async () => Promise.all([
    'four/photographs/1/cam01.jpg', 'four/photographs/3/cam01.jpg', 'four/photographs/1/cam99.jpg', 'none/photographs/1/cam01.jpg',
    'four/photographs/1/..%2fcam01.jpg', 'four/views/1', 'four/views/3', 'meshes-alone/views/1', 'none/views/1',
  ].map(async (path) => (await fetch(`api/takes/${path}`)).status)));
  assert.deepEqual(statuses, [200, 404, 404, 404, 400, 200, 404, 404, 404]);
});
