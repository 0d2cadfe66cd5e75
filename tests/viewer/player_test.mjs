// Browser tests of the player, @v3d/player: its example page in Chromium, and a delivery of v3dctl export --format volume.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { FIRST, firstEvent, LAST, PlayerPage, PlayerServer, RATE, SIDE, tapPlayer, tapSound } from './player_probe.mjs';
import { GL, launchBrowser, TIMEOUT_MS } from './served_studio.mjs';

const build = process.env.V3D_BUILD;
const folder = mkdtempSync(join(tmpdir(), 'v3d-player-'));
const volume = join(folder, 'volume');
let server, browser, page, player;

/** Middle of the ball at a pulse, metres (moving_ball() in make_takes.cc). */
const xOf = (pulse) => 0.005 + 0.1 * Math.sin(0.3 * pulse);
const isAt = (x, pulse) => Math.abs(x - xOf(pulse)) < 0.001;
const hasSurface = (pulse) => pulse < 25 || pulse > 26;

/** The colour, the position and the media time are those of the pulse. */
function assertInStep({ pulse, coded, x, media }, what) {
  if (hasSurface(pulse)) {
    assert.equal(coded, pulse, `${what}: colour of pulse ${coded} with pulse ${pulse}`);
    assert.ok(isAt(x, pulse), `${what}: position ${x} at pulse ${pulse}`);
  } else {
    assert.equal(coded, null, `${what}: pulse ${pulse} has no surface`);
  }
  if (media !== null) assert.equal(FIRST + Math.round(media * RATE), pulse, `${what}: media time ${media}`);
}

async function newPage(prepare) {
  page = await browser.newPage({ viewport: { width: 480, height: 360 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  if (prepare) await page.addInitScript(prepare);
  await page.addInitScript(tapPlayer);
  player = new PlayerPage(page, server.address);
}

before(async () => {
  execFileSync(join(build, 'tests/viewer_takes'), [folder]);
  execFileSync(join(build, 'bin/v3dctl'), ['export', join(folder, 'takes/coded'), '--format', 'volume', '--atlas', String(SIDE), volume],
    { stdio: 'ignore' });
  server = new PlayerServer(join(build, 'player-example'), { volume, takes: join(folder, 'takes') });
  await server.start();
  // Chromium without a window otherwise lets everything play.
  browser = await launchBrowser([...GL, '--autoplay-policy=document-user-activation-required']);
  await newPage();
});
after(async () => {
  await browser?.close();
  server?.end();
  rmSync(folder, { recursive: true });
});

test('shows the first pulse of a delivery, and the pulse of a time', async () => {
  await player.open({ src: '/volume/', muted: true });
  await player.event('loadedmetadata');
  assert.equal(await player.get('duration'), (LAST - FIRST + 1) / RATE);
  assertInStep(await player.showing(FIRST), 'first');
  for (const pulse of [12, 31, 24, 26, LAST, FIRST]) assertInStep(await player.seek(pulse), 'sought');
});

test('plays a delivery with the surface of the picture that the video shows, to its end', async () => {
  await player.open({ src: '/volume/', muted: true, autoplay: true });
  await player.event('ended');
  const seen = await player.seen();
  for (const look of seen) assertInStep(look, 'played');
  assert.ok(new Set(seen.map(({ pulse }) => pulse)).size >= 3, 'pulses move');
  assert.equal(seen.at(-1).pulse, LAST);
  assert.equal(await player.get('ended'), true);
});

test('starts again at the end with loop', async () => {
  await player.open({ src: '/volume/', muted: true, autoplay: true, loop: true });
  await page.waitForFunction(() => window.seen.some(({ pulse }, n) => n > 0 && pulse < window.seen[n - 1].pulse));
  assert.equal(await player.hasEvent('ended'), false);
  for (const look of await player.seen()) assertInStep(look, 'looped');
});

test('shows the right pulse in browsers without VideoFrame or without announced pictures', async () => {
  const lacks = [() => { delete window.VideoFrame; }, () => { delete window.VideoFrame; delete HTMLVideoElement.prototype.requestVideoFrameCallback; }];
  for (const lack of lacks) {
    await page.close();
    await newPage(lack);
    await player.open({ src: '/volume/', muted: true });
    await player.event('loadedmetadata');
    for (const pulse of [12, 31, LAST]) assertInStep(await player.seek(pulse), String(lack));
  }
  await page.close();
  await newPage();
});

test('plays motion.v3d and mesh.v3d', async () => {
  await player.open({ src: '/takes/coded/motion.v3d', autoplay: true });
  await player.event('ended');
  for (const look of await player.seen()) assert.ok(isAt(look.x, look.pulse), `position at pulse ${look.pulse}`);
  const { coded } = await player.seek(30);
  assert.equal(coded, 30);
  await player.open({ src: '/takes/ball/mesh.v3d', rate: 50 });
  await player.event('loadedmetadata');
  assert.equal(await player.get('duration'), 60 / 50);
  const green = await player.showing(0);
  assert.ok(green.colour[1] > 150 && green.colour[0] < 80, `${green.colour}`);
  await player.set('currentTime', 50 / 50);
  const blue = await player.showing(50);
  assert.ok(blue.colour[2] > 150 && blue.colour[0] < 80, `${blue.colour}`);
});

test('waits for a gesture before sound, and plays muted without one', async () => {
  for (const [attributes, expected] of [[{}, 'autoplayblocked'], [{ muted: true }, 'play']]) {
    await page.close();
    await newPage();
    const { event } = await firstEvent(page, ['autoplayblocked', 'play']);
    await player.open({ src: '/volume/', autoplay: true, ...attributes });
    assert.equal(await event, expected);
  }
  await player.event('ended');
});

test('plays with sound after a click', async () => {
  await page.close();
  await newPage();
  const { event } = await firstEvent(page, ['autoplayblocked']);
  await player.open({ src: '/volume/', autoplay: true });
  await event;
  assert.equal(await player.get('paused'), true);
  await page.getByRole('button', { name: 'Play with sound' }).click();
  await player.event('ended');
  assert.equal(await page.evaluate(() => window.video.muted), false);
  for (const look of await player.seen()) assertInStep(look, 'with sound');
});

test('has controls that play, pause, seek and switch the sound', async () => {
  await player.open({ src: '/volume/', controls: true, loop: true });
  await player.event('loadedmetadata');
  await page.getByRole('button', { name: 'Play', exact: true }).click();
  await player.event('play');
  await page.getByRole('button', { name: 'Pause' }).click();
  await player.event('pause');
  await page.getByLabel('Time, seconds').fill('0.4');
  assertInStep(await player.showing(15), 'time line');
  await page.getByRole('button', { name: 'Sound' }).click();
  assert.equal(await player.get('muted'), true);
  assert.equal(await page.evaluate(() => window.video.muted), true);
});

const manifest = () => JSON.parse(readFileSync(join(volume, 'manifest.json'), 'utf8'));
const changed = (change) => {
  const file = manifest();
  change(file);
  return { 'manifest.json': JSON.stringify(file) };
};
const bytesOf = (name) => readFileSync(join(volume, name));
const cut = (name, part) => ({ [name]: bytesOf(name).subarray(0, Math.floor(bytesOf(name).length * part)) });
const withoutRanges = (name) => (request, response) => {
  response.setHeader('Content-Length', bytesOf(name).length);
  response.end(request.method === 'HEAD' ? undefined : bytesOf(name));
};
/** Answers nothing, ever. */
const silent = () => undefined;
/** [what is damaged]: the faults by file, and the message. */
const DAMAGES = {
  'no manifest': () => ({ faults: { 'manifest.json': 404 }, message: /^manifest\.json: the server answered 404; expected the manifest/ }),
  'no JSON': () => ({ faults: { 'manifest.json': '<html>' }, message: /^manifest\.json: is no JSON/ }),
  'a manifest that never comes': () => ({ faults: { 'manifest.json': silent }, message: /^manifest\.json: the server did not answer within 2 s/ }),
  'a manifest without an end': () => ({ faults: { 'manifest.json': ' '.repeat(2 << 20) }, message: /^manifest\.json: the server sent more than 1048576 bytes/ }),
  'another version': () => ({ faults: changed((file) => { file.version = 2; }), message: /^manifest\.json: version: expected 1/ }),
  'a wrong type': () => ({ faults: changed((file) => { file.texture.videos = 'texture-av1.mp4'; }), message: /^manifest\.json: texture\.videos: expected a list/ }),
  'a huge number': () => ({ faults: changed((file) => { file.pulses = 1e300; }), message: /^manifest\.json: pulses: expected a whole number from 1 to 10000000/ }),
  'a path': () => ({ faults: changed((file) => { file.motion = '../secret/motion.v3d'; }), message: /^manifest\.json: motion: expected the name of a file in the same folder/ }),
  'another origin': () => ({ faults: changed((file) => { file.segments[0].surface = 'https://example.org/a.glb'; }), message: /segments\[0\]\.surface: expected the name of a file/ }),
  'no codec that plays': () => ({ faults: changed((file) => { file.texture.videos = [{ file: 'a.mp4', type: 'video/mp4; codecs="none"' }]; }), message: /this browser plays none of video\/mp4; codecs="none"/ }),
  'no motion': () => ({ faults: { 'motion.v3d': 404 }, message: /^motion\.v3d: the server answered 404; expected the motion file/ }),
  'a truncated motion': () => ({ faults: cut('motion.v3d', 0.7), message: /^motion\.v3d: .*is damaged/ }),
  'the motion of another delivery': () => ({ faults: changed((file) => { file.segments.pop(); }), message: /^motion\.v3d: has 2 segments; expected 1, as the manifest/ }),
  'other counts': () => ({ faults: changed((file) => { file.segments[1].vertices += 1; }), message: /^motion\.v3d: segment 1 has (\d+) vertices and .*; expected \d+ and \d+, as the manifest/ }),
  'no segment': () => ({ faults: { 'segment-000.glb': 404 }, message: /^segment-000\.glb: the server answered 404/ }),
  'a truncated segment': () => ({ faults: cut('segment-000.glb', 0.5), message: /^segment-000\.glb: is incomplete: has \d+ bytes of \d+/ }),
  'another segment': () => ({ faults: { 'segment-000.glb': bytesOf('segment-001.glb') }, message: /^segment-000\.glb: has \d+ triangles; expected \d+, those of the motion file/ }),
  'no video': () => ({ faults: { 'texture-av1.mp4': 404 }, message: /^texture-av1\.mp4: cannot be played/ }),
  'a video that never comes': () => ({ faults: { 'texture-av1.mp4': silent }, message: /^texture-av1\.mp4: has no picture after 2 s/ }),
  'a video of another size': () => ({ faults: changed((file) => { file.texture.side = 512; }), message: /^texture-av1\.mp4: has pictures of 256x256; expected 512x512/ }),
  'a shorter video': () => ({ faults: changed((file) => { file.pulses = 100; }), message: /^texture-av1\.mp4: lasts 1\.28 s; expected 4\.00 s/ }),
  'a server without ranges': () => ({ faults: { 'motion.v3d': withoutRanges('motion.v3d') }, message: /^motion\.v3d: the server answered 200 instead of 206 .*; expected .*range requests/ }),
};
let cases = 0;
/** Opens a delivery with faults. Its address is new, because Chromium keeps videos. Returns its error. */
async function errorOf(faults, attributes) {
  const name = `case-${++cases}`;
  server.folders[name] = volume;
  for (const [file, fault] of Object.entries(faults)) server.faults.set(`/${name}/${file}`, fault);
  await player.open({ src: `/${name}/`, muted: true, deadline: 2, ...attributes });
  return player.event('error');
}

for (const what of Object.keys(DAMAGES)) {
  test(`reports ${what} in one line, within the deadline`, async () => {
    const { faults, message } = DAMAGES[what]();
    const error = await errorOf(faults);
    assert.match(error.message, message);
    assert.ok(!error.message.includes('\n'));
    assert.equal(await player.get('error'), error.message);
    assert.equal(await page.getByRole('alert').textContent(), error.message);
  });
}

test('reports a video that ends in the middle', async () => {
  const error = await errorOf(cut('texture-av1.mp4', 0.6), { autoplay: true });
  assert.match(error.message, /^texture-av1\.mp4: (lasts|cannot be played|has no picture)/);
});

test('reports addresses and files that it cannot play', async () => {
  for (const [src, message] of [
    ['/takes/coded/calib.toml', /^calib\.toml: is neither a mesh file nor a motion file/],
    ['/takes/none.v3d', /^none\.v3d: the server answered 404/],
    ['file:///etc/passwd', /expected an address that begins with http: or https:/],
  ]) {
    await player.open({ src, deadline: 2 });
    assert.match((await player.event('error')).message, message);
  }
});

test('plays another source after an error', async () => {
  await player.open({ src: '/takes/none.v3d' });
  await player.event('error');
  await player.set('src', '/volume/');
  await player.event('loadedmetadata');
  assertInStep(await player.showing(FIRST), 'after an error');
  assert.equal(await player.get('error'), null);
  assert.ok(await page.getByRole('alert').isHidden());
});

test('has the sound of a pulse at the media time of its picture', async (context) => {
  await player.open({ src: '/volume/', muted: true });
  await player.event('loadedmetadata');
  const times = await page.evaluate(async () => {
    const sound = await new OfflineAudioContext(2, 48_000, 48_000).decodeAudioData(await (await fetch('/volume/texture-av1.mp4')).arrayBuffer());
    const samples = sound.getChannelData(0);
    const bursts = [];
    for (let n = 0; n < samples.length; ++n) {
      if (Math.abs(samples[n]) < 0.4) continue;
      bursts.push(n / sound.sampleRate);
      n += 0.1 * sound.sampleRate; // beyond the burst
    }
    return bursts;
  });
  assert.equal(times.length, 3);
  [10, 20, 30].forEach((pulse, n) => {
    const offset = times[n] - (pulse - FIRST) / RATE;
    context.diagnostic(`burst of pulse ${pulse}: ${(1000 * offset).toFixed(1)} ms after the start of its picture`);
    assert.ok(offset > -0.5 / RATE && offset < 0.5 / RATE, `burst of pulse ${pulse} ${offset} s beside its picture`);
  });
});

test('plays the sound of all pulses while it shows them', async (context) => {
  await player.open({ src: '/volume/' });
  await player.event('loadedmetadata');
  await page.evaluate(tapSound);
  await player.call('play');
  await player.event('ended');
  await page.waitForFunction(() => window.bursts.length === 3);
  const { bursts, drawn } = await page.evaluate(() => ({ bursts: window.bursts, drawn: window.drawn }));
  // The times are reported only: on a busy machine without a sound device they say little.
  bursts.forEach((at, n) => {
    const pulse = 10 + 10 * n;
    const { pulse: shown } = drawn.findLast((picture) => picture.at <= at) ?? drawn[0];
    const start = drawn.find((picture) => picture.pulse >= pulse);
    const late = start ? `; pulse ${start.pulse} was drawn ${(1000 * (start.at - at) - (1000 * (start.pulse - pulse)) / RATE).toFixed(0)} ms after its sound` : '';
    context.diagnostic(`sound of pulse ${pulse} with pulse ${shown} on the screen${late}`);
  });
});
