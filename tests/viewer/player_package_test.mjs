// Test of the built package @v3d/player: its size, its parts, and its types for a program that uses it.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { once } from 'node:events';
import { mkdirSync, mkdtempSync, readdirSync, readFileSync, readlinkSync, rmSync, symlinkSync, truncateSync, writeFileSync } from 'node:fs';
import { createServer, get } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import { answerWithFile } from '../../tools/viewer/player/serve.mjs';

const built = join(process.env.V3D_BUILD, 'player');
const modules = fileURLToPath(new URL('../../tools/viewer/node_modules', import.meta.url));
/** Minified JavaScript besides three.js and the decoder, bytes (docs/player.md). */
const MAX_BYTES = 60_000;

test('has at most 60 kB of JavaScript besides three.js and the decoder', (context) => {
  const files = readdirSync(built).filter((name) => name.endsWith('.js'));
  assert.deepEqual(files.sort(), ['v3d-player-worker.js', 'v3d-player.js']);
  const sizes = files.map((name) => ({ name, bytes: readFileSync(join(built, name)) }));
  for (const { name, bytes } of sizes) context.diagnostic(`${name}: ${bytes.length} bytes, gzip ${gzipSync(bytes).length}`);
  const sum = sizes.reduce((all, { bytes }) => all + bytes.length, 0);
  assert.ok(sum > 10_000 && sum <= MAX_BYTES, `${sum} bytes`);
});

test('is tried by a server that survives invalid addresses', async () => {
  const server = createServer((request, response) => answerWithFile(built, request, response));
  server.listen(0, '127.0.0.1');
  await once(server, 'listening');
  const statusOf = (path) => new Promise((done, fail) => {
    get({ port: server.address().port, host: '127.0.0.1', path }, (response) => {
      response.resume();
      done(response.statusCode);
    }).on('error', fail);
  });
  try {
    for (const path of ['//', '/%00', '/%ff']) assert.equal(await statusOf(path), 400, path);
    assert.equal(await statusOf('/none.js'), 404);
    assert.equal(await statusOf('/package.json'), 200);
  } finally {
    server.close();
  }
});

test('is tried by a server that closes a file when the browser gives up', async () => {
  const folder = mkdtempSync(join(tmpdir(), 'v3d-serve-'));
  const file = join(folder, 'texture.mp4');
  writeFileSync(file, '');
  truncateSync(file, 200 << 20); // larger than the buffers of the connection
  const server = createServer((request, response) => answerWithFile(folder, request, response));
  server.listen(0, '127.0.0.1');
  await once(server, 'listening');
  const isOpen = () => readdirSync('/proc/self/fd').some((fd) => {
    try {
      return readlinkSync(`/proc/self/fd/${fd}`) === file;
    } catch {
      return false; // closed meanwhile
    }
  });
  try {
    const request = get({ port: server.address().port, host: '127.0.0.1', path: '/texture.mp4' });
    const [response] = await once(request, 'response');
    await once(response, 'data');
    assert.ok(isOpen());
    response.destroy();
    for (const until = Date.now() + 20_000; isOpen(); await new Promise((done) => setTimeout(done, 20))) {
      assert.ok(Date.now() < until, 'the file is still open');
    }
  } finally {
    server.close();
    rmSync(folder, { recursive: true });
  }
});

test('leaves three.js to its user', () => {
  const { peerDependencies } = JSON.parse(readFileSync(join(built, 'package.json'), 'utf8'));
  assert.deepEqual(Object.keys(peerDependencies), ['three']);
  const imported = [...readFileSync(join(built, 'v3d-player.js'), 'utf8').matchAll(/from"([^"]+)"/g)].map(([, name]) => name);
  assert.ok(imported.includes('three'));
  for (const name of imported) assert.match(name, /^three($|\/addons\/)/);
});

test('is found by bundlers with its worker and its decoder', () => {
  const module = readFileSync(join(built, 'v3d-player.js'), 'utf8');
  for (const file of ['v3d-player-worker.js', 'v3d_decoder.wasm']) {
    assert.ok(module.includes(`new URL("${file}",import.meta.url)`), file);
    assert.ok(readdirSync(built).includes(file));
  }
});

test('has types for a program that uses it', () => {
  const folder = mkdtempSync(join(tmpdir(), 'v3d-player-types-'));
  try {
    mkdirSync(join(folder, 'node_modules/@v3d'), { recursive: true });
    symlinkSync(built, join(folder, 'node_modules/@v3d/player'));
    for (const name of ['three', '@types']) symlinkSync(join(modules, name), join(folder, 'node_modules', name));
    const compile = (text) => {
      writeFileSync(join(folder, 'program.ts'), text);
      const flags = ['--noEmit', '--strict', '--skipLibCheck', '--preserveSymlinks', '--module', 'ESNext', '--moduleResolution', 'Bundler', '--target', 'ES2022'];
      execFileSync('node', [join(modules, 'typescript/bin/tsc'), ...flags, '--types', 'three', 'program.ts'], { cwd: folder, encoding: 'utf8' });
    };
    compile(`import { VolumePlayer, V3dPlayerElement } from '@v3d/player';
      const player = new VolumePlayer({ rate: 25, deadline: 10 });
      player.addEventListener('error', ({ message }) => console.log(message.length));
      player.addEventListener('timeupdate', ({ pulse }) => player.seek(pulse / 25));
      void player.load('kendo/').then(() => player.play());
      const element: V3dPlayerElement = new V3dPlayerElement();
      element.currentTime = player.duration + player.position.x;`);
    assert.throws(() => compile(`import { VolumePlayer } from '@v3d/player'; new VolumePlayer().seek('start');`), ({ stdout }) => stdout.includes('Argument of type'));
  } finally {
    rmSync(folder, { recursive: true });
  }
});
