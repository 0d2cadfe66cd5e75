// Reads texts and colours of a page of the viewer.
import assert from 'node:assert/strict';
import { launchBrowser, TIMEOUT_MS } from './served_studio.mjs';

/** Largest difference of a colour channel from the expected value. */
const TOLERANCE = 6;

export const isNear = (wanted) => (colour) => colour.every((c, k) => Math.abs(c - wanted[k]) <= TOLERANCE);

export class PageProbe {
  constructor(page) {
    this.page = page;
  }

  text(id) {
    return this.page.textContent(`#${id}`);
  }
  shows(id, part) {
    const has = ([i, p]) => document.getElementById(i).textContent.includes(p);
    return this.page.waitForFunction(has, [id, part], { timeout: TIMEOUT_MS });
  }
  showsPulse(pulse) {
    return this.shows('facts', `pulse ${pulse} `);
  }
  async shownPulse() {
    return Number(/pulse (\d+)/.exec(await this.text('facts'))?.[1] ?? -1);
  }
  /** Waits until the page has drawn two more frames. */
  drawn() {
    return this.page.evaluate(() => new Promise((done) =>
      requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done)))));
  }
  /**
   * Waits until the page has loaded and drawn everything. The page sets `data-settled` once per drawn frame, so until the
   * next frame the value may be older than the last key or click.
   */
  async settled() {
    await this.drawn();
    await this.page.waitForFunction(() => document.getElementById('canvas').dataset.settled === 'true', null, { timeout: TIMEOUT_MS });
  }
  /** Waits until the page shows this scene completely. */
  async settles(scene) {
    await this.shows('title', scene);
    await this.settled();
  }

  /** Pixels of a PNG: red, green, blue and 255 of each. */
  async decode(png) {
    return Buffer.from(await this.page.evaluate(async (data) => {
      const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0));
      const picture = await createImageBitmap(new Blob([bytes], { type: 'image/png' }));
      const pen = new OffscreenCanvas(picture.width, picture.height).getContext('2d');
      pen.drawImage(picture, 0, 0);
      const pixels = pen.getImageData(0, 0, picture.width, picture.height).data;
      let text = ''; // a list of a million numbers takes half a minute to transfer
      for (let at = 0; at < pixels.length; at += 8192) text += String.fromCharCode(...pixels.subarray(at, at + 8192));
      return btoa(text);
    }, png.toString('base64')), 'base64');
  }

  /** Colour at a point of the stage, given by 0 to 1 of its width and height: [red, green, blue]. */
  async colourAt(across, down) {
    const box = await this.page.locator('#canvas').boundingBox();
    const at = { x: Math.round(box.x + box.width * across), y: Math.round(box.y + box.height * down), width: 1, height: 1 };
    return [...(await this.decode(await this.page.screenshot({ clip: at }))).subarray(0, 3)];
  }

  /** Waits until `check` accepts the colour that `seen` returns, because a change is drawn with the next frame. */
  async becomes(check, what, seen = () => this.colourAt(0.5, 0.5)) {
    const until = Date.now() + TIMEOUT_MS;
    for (let colour; !check((colour = await seen())); ) {
      if (Date.now() > until) assert.fail(`${what}: the colour is ${colour}`);
    }
  }
}

/** An empty page of the usual size in a browser of its own, and its probe. */
export async function openPage() {
  const browser = await launchBrowser();
  const page = await browser.newPage({ viewport: { width: 1000, height: 640 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  return { browser, page, probe: new PageProbe(page) };
}
