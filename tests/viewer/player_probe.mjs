// A small delivery and single files on a web server of this test, and what the player shows of them in Chromium.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { once } from 'node:events';
import { mkdtempSync, rmSync } from 'node:fs';
import { createServer } from 'node:http';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { answerWithFile } from '../../tools/viewer/player/serve.mjs';
import { GL, launchBrowser, TIMEOUT_MS } from './served_studio.mjs';

/** Pulses of the take `coded` (make_takes.cc); the pulses 25 and 26 have no surface. */
export const FIRST = 5, LAST = 36, RATE = 25;
const SIDE = 256;

/** Middle of the ball at a pulse, metres (moving_ball() in make_takes.cc). */
const xOf = (pulse) => 0.005 + 0.1 * Math.sin(0.3 * pulse);
export const isAt = (x, pulse) => Math.abs(x - xOf(pulse)) < 0.001;
const hasSurface = (pulse) => pulse < 25 || pulse > 26;

/** The colour, the position and the media time are those of the pulse. */
export function assertInStep({ pulse, coded, x, media }, what) {
  if (hasSurface(pulse)) {
    assert.equal(coded, pulse, `${what}: colour of pulse ${coded} with pulse ${pulse}`);
    assert.ok(isAt(x, pulse), `${what}: position ${x} at pulse ${pulse}`);
  } else {
    assert.equal(coded, null, `${what}: pulse ${pulse} has no surface`);
  }
  if (media !== null) assert.equal(FIRST + Math.round(media * RATE), pulse, `${what}: media time ${media}`);
}

/** Serves the example page at /, and folders below their names. An answer in `faults` replaces that of its path. */
export class PlayerServer {
  /** [path]: bytes or a text, a status, or a function of the request and the response. */
  faults = new Map();

  constructor(page, folders) {
    this.folders = folders;
    this.server = createServer((request, response) => {
      const path = new URL(request.url, 'http://localhost').pathname;
      const fault = this.faults.get(path);
      if (typeof fault === 'number') return response.writeHead(fault).end();
      if (typeof fault === 'function') return fault(request, response);
      if (fault !== undefined) return answerWithBytes(fault, request, response);
      const name = Object.keys(folders).find((folder) => path.startsWith(`/${folder}/`));
      if (name) request.url = request.url.slice(name.length + 1);
      answerWithFile(name ? folders[name] : page, request, response);
    });
  }

  async start() {
    this.server.listen(0, '127.0.0.1');
    await once(this.server, 'listening');
    this.address = `http://127.0.0.1:${this.server.address().port}/`;
  }

  end() {
    this.server.closeAllConnections();
    this.server.close();
  }
}

/** As answerWithFile(), for bytes. */
function answerWithBytes(content, request, response) {
  const bytes = Buffer.from(content);
  const range = /^bytes=(\d+)-(\d*)$/.exec(request.headers.range ?? '');
  const first = range ? Number(range[1]) : 0;
  const last = Math.min(bytes.length - 1, range && range[2] ? Number(range[2]) : bytes.length - 1);
  if (range && first > last) return response.writeHead(416, { 'Content-Range': `bytes */${bytes.length}` }).end();
  if (range) response.setHeader('Content-Range', `bytes ${first}-${last}/${bytes.length}`);
  response.writeHead(range ? 206 : 200, { 'Content-Length': last - first + 1, 'Accept-Ranges': 'bytes' });
  response.end(request.method === 'HEAD' ? undefined : bytes.subarray(first, last + 1));
}

/**
 * Runs in the page before its scripts. Records events of the player, and at every picture of the screen the pulse that the
 * player states, that of the colour of its pixels, that of the position of its vertices, and the media time of the video's
 * picture.
 */
export function tapPlayer() {
  window.events = [];
  window.seen = [];
  window.mediaTime = null;
  window.shown = null;
  const RealFrame = window.VideoFrame;
  if (RealFrame) {
    window.VideoFrame = class extends RealFrame {
      constructor(...of) {
        super(...of);
        window.mediaTime = this.timestamp / 1e6;
      }
    };
  }
  const listen = (element) => {
    for (const name of ['loadedmetadata', 'play', 'pause', 'timeupdate', 'ended', 'autoplayblocked', 'error']) {
      element.addEventListener(name, ({ detail }) => {
        window.events.push({ name, ...detail });
        window.reportEvent?.(name);
        if (name === 'timeupdate') window.shown = { media: window.mediaTime };
        if (name === 'loadedmetadata') requestAnimationFrame(turn);
      });
    }
  };
  const create = document.createElement.bind(document);
  document.createElement = (name) => {
    const element = create(name);
    if (name === 'video') window.video = element; // the last one is the player's
    if (name === 'v3d-player') listen(element);
    return element;
  };
  /** The pulse of a colour, coded() in make_takes.cc, of an sRGB value. */
  const pulseOfColour = (colour) => colour.reduce((pulse, value) => 4 * pulse + Math.max(0, Math.min(3, Math.round((value - 40) / 60))), 0);
  const pen = new OffscreenCanvas(64, 64).getContext('2d', { willReadFrequently: true });
  /** Mean colour of the ball's middle on a canvas; null: there is no ball. */
  const colourOf = (canvas) => {
    pen.clearRect(0, 0, 64, 64);
    pen.drawImage(canvas, canvas.width * 0.25, 0, canvas.width * 0.5, canvas.height, 0, 0, 64, 64);
    const { data } = pen.getImageData(0, 0, 64, 64);
    const sum = [0, 0, 0];
    let count = 0;
    for (let at = 0; at < data.length; at += 4) {
      if (data[at + 3] < 255) continue; // behind the ball the canvas is clear
      for (let k = 0; k < 3; ++k) sum[k] += data[at + k];
      ++count;
    }
    return count < 100 ? null : sum.map((value) => value / count);
  };
  const look = () => {
    const element = document.querySelector('v3d-player');
    if (!element?.player || element.pulse < 0) return null;
    const mesh = element.player.children[0].children[0];
    const colour = mesh?.visible ? colourOf(element.shadowRoot.querySelector('canvas')) : null;
    const positions = mesh.geometry.getAttribute('position')?.array;
    let low = Infinity, high = -Infinity;
    for (let at = 0; positions && at < positions.length; at += 3) {
      low = Math.min(low, positions[at]);
      high = Math.max(high, positions[at]);
    }
    return { pulse: element.pulse, coded: colour && pulseOfColour(colour), colour, x: (low + high) / 2, media: window.shown.media };
  };
  // Follows the player in every picture of the screen, because its callback was registered first. A canvas can be read only
  // until the picture is on the screen.
  const turn = () => {
    const now = window.shown && look();
    if (now) window.seen.push(now);
    window.shown = null;
    requestAnimationFrame(turn);
  };
}

/**
 * Resolves with the first of these events. Nothing is evaluated in the page, which Chromium would take for a gesture of the user.
 * To call before the page is opened.
 */
export async function firstEvent(page, names) {
  let resolve;
  const event = new Promise((done) => { resolve = done; });
  await page.exposeFunction('reportEvent', (name) => names.includes(name) && resolve(name));
  return { event };
}

/**
 * Runs in the page: plays the video through Web Audio and records when bursts of its sound leave for the loudspeakers, and when
 * pulses are drawn, by the clock of the page, seconds.
 */
export async function tapSound() {
  window.bursts = [];
  window.drawn = [];
  const context = new AudioContext();
  const code = `registerProcessor('burst', class extends AudioWorkletProcessor {
    last = -1;
    process([[samples]]) {
      const n = samples?.findIndex((value) => Math.abs(value) > 0.4) ?? -1;
      if (n >= 0 && currentTime > this.last + 0.1) this.port.postMessage((this.last = currentTime + n / sampleRate));
      return true;
    }
  })`;
  await context.audioWorklet.addModule(URL.createObjectURL(new Blob([code], { type: 'text/javascript' })));
  const worklet = new AudioWorkletNode(context, 'burst');
  worklet.port.onmessage = ({ data }) => {
    const { contextTime, performanceTime } = context.getOutputTimestamp();
    window.bursts.push(performanceTime / 1000 + data - contextTime);
  };
  context.createMediaElementSource(window.video).connect(worklet).connect(context.destination);
  const element = document.querySelector('v3d-player');
  element.addEventListener('timeupdate', ({ detail }) => window.drawn.push({ pulse: detail.pulse, at: performance.now() / 1000 }));
  await context.resume();
}

/**
 * Runs in the page before its scripts. Records all samples that are sent to the loudspeakers by Web Audio, in a list for each
 * context.
 */
export function tapOutput() {
  window.recordings = [];
  const code = `registerProcessor('record', class extends AudioWorkletProcessor {
    process([[samples]]) {
      this.port.postMessage(samples ? samples.slice() : new Float32Array(128));
      return true;
    }
  })`;
  const { connect } = AudioNode.prototype;
  const record = async (node) => {
    const { context } = node;
    const recording = { sampleRate: context.sampleRate, blocks: [] };
    window.recordings.push(recording);
    await context.audioWorklet.addModule(URL.createObjectURL(new Blob([code], { type: 'text/javascript' })));
    const worklet = new AudioWorkletNode(context, 'record');
    worklet.port.onmessage = ({ data }) => recording.blocks.push(data);
    connect.call(node, worklet);
    connect.call(worklet, context.destination); // it writes silence
  };
  AudioNode.prototype.connect = function (to, ...more) {
    if (to instanceof AudioDestinationNode) void record(this);
    return connect.call(this, to, ...more);
  };
}

/** Runs in the page: sends the sound of the video element through Web Audio, too, so that tapOutput() records it. */
export async function tapElement() {
  const context = new AudioContext();
  context.createMediaElementSource(window.video).connect(context.destination);
  await context.resume();
}

/** Runs in the page: samples of the recording that has `bursts` bursts, and the first sample of each; null: none has them yet. */
export function recordedBursts(bursts) {
  for (const { sampleRate, blocks } of window.recordings) {
    const starts = [];
    for (let n = 0; n < 128 * blocks.length; ++n) {
      if (Math.abs(blocks[n >> 7][n & 127]) < 0.4) continue;
      starts.push(n);
      n += 0.1 * sampleRate; // beyond the burst
    }
    if (starts.length < bursts) continue;
    return { sampleRate, starts, samples: blocks.flatMap((block) => Array.from(block)) };
  }
  return null;
}

/** A player on the example page. */
export class PlayerPage {
  constructor(page, address) {
    this.page = page;
    this.address = address;
  }

  /** `attributes`: of the element; true: without a value. */
  async open(attributes) {
    const query = Object.entries(attributes).map(([name, value]) => `${name}=${encodeURIComponent(value === true ? '' : value)}`);
    await this.page.goto(`${this.address}?${query.join('&')}`);
  }
  /** Waits for an event; returns its detail. */
  async event(name) {
    await this.page.waitForFunction((n) => window.events.some((event) => event.name === n), name);
    return this.page.evaluate((n) => window.events.find((event) => event.name === n), name);
  }
  async hasEvent(name) {
    return this.page.evaluate((n) => window.events.some((event) => event.name === n), name);
  }
  /** Calls a method of the element. */
  call(method, ...of) {
    return this.page.evaluate(([m, a]) => document.querySelector('v3d-player')[m](...a), [method, of]);
  }
  get(name) {
    return this.page.evaluate((n) => document.querySelector('v3d-player')[n], name);
  }
  set(name, value) {
    return this.page.evaluate(([n, v]) => { document.querySelector('v3d-player')[n] = v; }, [name, value]);
  }
  /** Shows the pulse and returns what is seen of it. */
  async seek(pulse) {
    await this.set('currentTime', (pulse - FIRST) / RATE);
    return this.showing(pulse);
  }
  /** Waits until the screen shows the pulse. */
  async showing(pulse) {
    await this.page.waitForFunction((p) => window.seen.at(-1)?.pulse === p, pulse);
    return this.page.evaluate(() => window.seen.at(-1));
  }
  seen() {
    return this.page.evaluate(() => window.seen);
  }
}

/** A delivery of the take `coded` at /volume/, takes at /takes/, and a page of Chromium. */
export class PlayerStudio {
  #build = process.env.V3D_BUILD;
  folder = mkdtempSync(join(tmpdir(), 'v3d-player-'));
  volume = join(this.folder, 'volume');
  takes = join(this.folder, 'takes');

  async start() {
    execFileSync(join(this.#build, 'tests/viewer_takes'), [this.folder]);
    const words = ['export', join(this.takes, 'coded'), '--format', 'volume', '--atlas', String(SIDE), this.volume];
    execFileSync(join(this.#build, 'bin/v3dctl'), words, { stdio: 'ignore' });
    this.server = new PlayerServer(join(this.#build, 'player-example'), { volume: this.volume, takes: this.takes });
    await this.server.start();
    // Chromium without a window otherwise lets everything play.
    this.browser = await launchBrowser([...GL, '--autoplay-policy=document-user-activation-required']);
  }

  /** A new page without a gesture, in place of the last one. `prepare`: runs in it before its scripts. */
  async newPlayer(prepare) {
    await this.page?.close();
    this.page = await this.browser.newPage({ viewport: { width: 480, height: 360 } });
    this.page.setDefaultTimeout(TIMEOUT_MS);
    if (prepare) await this.page.addInitScript(prepare);
    await this.page.addInitScript(tapPlayer);
    return new PlayerPage(this.page, this.server.address);
  }

  async end() {
    await this.browser?.close();
    this.server?.end();
    rmSync(this.folder, { recursive: true });
  }
}
