// Browser tests of the errors of the player: damaged deliveries, files that are missing, servers that do not answer.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { assertInStep, FIRST, PlayerStudio } from './player_probe.mjs';

const studio = new PlayerStudio();
let player;

before(async () => {
  await studio.start();
  player = await studio.newPlayer();
});
after(() => studio.end());

const manifest = () => JSON.parse(readFileSync(join(studio.volume, 'manifest.json'), 'utf8'));
const changed = (change) => {
  const file = manifest();
  change(file);
  return { 'manifest.json': JSON.stringify(file) };
};
const bytesOf = (name) => readFileSync(join(studio.volume, name));
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
  'a manifest that never comes': () => ({ faults: { 'manifest.json': silent }, message: /^manifest\.json: the server did not answer within 10 s/ }),
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
  'a video that never comes': () => ({ faults: { 'texture-av1.mp4': silent }, message: /^texture-av1\.mp4: has no picture after 10 s/ }),
  'a video of another size': () => ({ faults: changed((file) => { file.texture.side = 512; }), message: /^texture-av1\.mp4: has pictures of 256x256; expected 512x512/ }),
  'a shorter video': () => ({ faults: changed((file) => { file.pulses = 100; }), message: /^texture-av1\.mp4: lasts 1\.28 s; expected 4\.00 s/ }),
  'a server without ranges': () => ({ faults: { 'motion.v3d': withoutRanges('motion.v3d') }, message: /^motion\.v3d: the server answered 200 instead of 206 .*; expected .*range requests/ }),
};
let cases = 0;
/** Opens a delivery with faults. Its address is new, because Chromium keeps videos. Returns its error. */
async function errorOf(faults, attributes) {
  const name = `case-${++cases}`;
  studio.server.folders[name] = studio.volume;
  for (const [file, fault] of Object.entries(faults)) studio.server.faults.set(`/${name}/${file}`, fault);
  await player.open({ src: `/${name}/`, muted: true, deadline: 10, ...attributes });
  return player.event('error');
}

for (const what of Object.keys(DAMAGES)) {
  test(`reports ${what} in one line, within the deadline`, async () => {
    const { faults, message } = DAMAGES[what]();
    const error = await errorOf(faults);
    assert.match(error.message, message);
    assert.ok(!error.message.includes('\n'));
    assert.equal(await player.get('error'), error.message);
    assert.equal(await studio.page.getByRole('alert').textContent(), error.message);
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
    await player.open({ src, deadline: 10 });
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
  assert.ok(await studio.page.getByRole('alert').isHidden());
});
