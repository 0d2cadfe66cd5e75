// usage: viewer.mjs BUILD TAKE FRAMES: see tools/bench/viewer.
import { readFileSync } from 'node:fs';
import { createServer } from 'node:http';
import { basename, dirname, join } from 'node:path';
import { megabytes, memoryOf } from '../../tests/viewer/page_memory.mjs';
import { launchBrowser, ServedStudio, TIMEOUT_MS } from '../../tests/viewer/served_studio.mjs';

const [build, take, wanted] = process.argv.slice(2);
const MAX_GROWTH = 32e6;
const WARM = 1000;

/** Decoding rate of one thread in the browser, frames a second; mean triangles and bytes of a frame. */
async function decodeRate(browser) {
  const files = {
    '/': ['text/html', '<!doctype html>'],
    '/v3d_decoder.mjs': ['text/javascript', readFileSync(new URL('../../codec/v3d_decoder.mjs', import.meta.url))],
    '/v3d_decoder.wasm': ['application/wasm', readFileSync(join(build, 'codec/v3d_decoder.wasm'))],
    '/mesh.v3d': ['application/octet-stream', readFileSync(join(take, 'mesh.v3d'))],
  };
  const server = createServer((request, answer) => {
    const [type, bytes] = files[request.url] ?? ['text/plain', ''];
    answer.setHeader('Content-Type', type).end(bytes);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const page = await browser.newPage();
  await page.goto(`http://127.0.0.1:${server.address().port}/`);
  const measured = await page.evaluate(async () => {
    const { Decoder, OK } = await import('/v3d_decoder.mjs');
    const decoder = new Decoder(await WebAssembly.compileStreaming(fetch('/v3d_decoder.wasm')));
    const bytes = new Uint8Array(await (await fetch('/mesh.v3d')).arrayBuffer());
    const data = new DataView(bytes.buffer);
    const records = [];
    // "V3DR": docs/compact-frame.md
    for (let at = 16; at + 24 < bytes.length && data.getUint32(at) === 0x56334452; at += 24 + data.getUint32(at + 4, true)) {
      records.push(bytes.subarray(at + 24, at + 24 + data.getUint32(at + 4, true)));
    }
    const all = () => records.filter((record) => decoder.decode(record) === OK).length;
    if (all() !== records.length) throw new Error('not all meshes of the take can be decoded');
    const began = performance.now();
    let frames = 0;
    while (performance.now() - began < 5000) frames += all();
    const seconds = (performance.now() - began) / 1000;
    return { rate: frames / seconds, triangles: decoder.frame().indices.length / 3, bytes: bytes.length / records.length };
  });
  await page.close();
  server.close();
  return measured;
}

async function playFor(browser, frames, warm) {
  const studio = new ServedStudio(build, dirname(take));
  await studio.start();
  try {
    const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
    await page.goto(`${studio.address}#take=${basename(take)}`);
    await page.waitForFunction(() => Number(document.getElementById('canvas').dataset.shown) > 0, null, { timeout: TIMEOUT_MS });
    await page.selectOption('#speed', '4');
    const shows = (n) => page.waitForFunction((target) => Number(document.getElementById('canvas').dataset.shown) >= target, n, { timeout: 0 });
    await shows(warm);
    const early = await memoryOf(browser, page);
    await shows(frames);
    return { early, late: await memoryOf(browser, page) };
  } finally {
    await studio.end();
  }
}

const browser = await launchBrowser();
try {
  const { rate, triangles, bytes } = await decodeRate(browser);
  console.log(`decoding: ${rate.toFixed(0)} meshes/s, of ${triangles.toLocaleString('en')} triangles in ${(bytes / 1000).toFixed(0)} kB`);
  const warm = Math.min(WARM, Math.floor(Number(wanted) / 2));
  const { early, late } = await playFor(browser, Number(wanted), warm);
  console.log(`memory after ${warm} meshes: ${megabytes(early.heap)} MB of JavaScript, ${megabytes(early.resident)} MB resident`);
  console.log(`memory after ${wanted} meshes: ${megabytes(late.heap)} MB of JavaScript, ${megabytes(late.resident)} MB resident`);
  if (late.resident - early.resident > MAX_GROWTH) throw new Error('the memory of the page has grown by more than 32 MB');
} finally {
  await browser.close();
}
