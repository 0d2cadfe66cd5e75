// Browser tests of the studio page: a simulated studio with the real daemons, v3d-viewd that accepts orders, Chromium.
import assert from 'node:assert/strict';
import { cpSync, mkdirSync, readdirSync, rmSync } from 'node:fs';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import { LiveStudio, OPERATOR_TOKEN } from './live_studio.mjs';
import { launchBrowser, TIMEOUT_MS } from './served_studio.mjs';

const studio = new LiveStudio(process.env.V3D_BUILD);
let browser, page;

const text = (id) => page.textContent(`#${id}`);
/** Waits until the text of element `id` holds `part`; else fails with its text. */
async function shows(id, part) {
  try {
    await page.waitForFunction(([i, p]) => document.getElementById(i).textContent.includes(p), [id, part], { timeout: TIMEOUT_MS });
  } catch (error) {
    assert.fail(`#${id} does not show "${part}" but "${await text(id)}": ${error.message}`);
  }
}
const offers = (order) => page.waitForSelector(`[data-order=${order}]:enabled`, { timeout: TIMEOUT_MS });
const recordsNow = () => page.waitForSelector('body.recording', { timeout: TIMEOUT_MS });
/** The page shows the verdict that `v3dctl verify` prints about a take of the studio; "complete" or "incomplete". */
async function showsVerdict(take) {
  await shows('last-order', `take ${take}: `);
  const verdict = await studio.verdict(take);
  await shows('last-order', verdict);
  return /: (\w+),/.exec(verdict)[1];
}

/** Saves a screenshot, if V3D_PICTURES=FOLDER is set. */
async function picture(name) {
  if (!process.env.V3D_PICTURES) return;
  mkdirSync(process.env.V3D_PICTURES, { recursive: true });
  await page.screenshot({ path: join(process.env.V3D_PICTURES, `${name}.png`) });
}

async function unlock() {
  await page.fill('#token', OPERATOR_TOKEN);
  await page.click('#unlock button');
  await page.waitForSelector('#orders:not([hidden])', { timeout: TIMEOUT_MS });
}
/** Runs a story in a page of its own, whose routes `prepare` sets before the page is opened. */
async function inOwnPage(prepare, story) {
  const kept = page;
  page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  try {
    await prepare();
    await page.goto(`${studio.address}studio.html`);
    await unlock();
    await story();
  } finally {
    await page.close();
    page = kept;
  }
}
/** Changes the states of the studio before they reach the page. */
const changeStates = (change) => page.routeWebSocket(/api.studio/, (socket) => {
  const changed = (state) => (state.type === 'state' ? change(state) : state);
  socket.connectToServer().onMessage((message) =>
    socket.send(typeof message === 'string' ? JSON.stringify(changed(JSON.parse(message))) : message));
});
async function arm(take, seconds = '') {
  await offers('arm');
  await page.fill('#take-name', take);
  await page.fill('#take-seconds', seconds);
  await page.click('[data-order=arm]');
  await offers('start');
}

before(async () => {
  await studio.start();
  browser = await launchBrowser();
  page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.setDefaultTimeout(TIMEOUT_MS);
  await page.goto(`${studio.address}studio.html`);
});
after(async () => {
  await browser?.close();
  await studio.end();
});

test('offers no order without the operators\' token', async () => {
  await page.waitForSelector('#operator:not([hidden])');
  assert.ok(await page.isHidden('#orders'));
  await page.fill('#token', 'operators-9876543210');
  await page.keyboard.press('Enter');
  await shows('order-trouble', "not the operators' token");
  assert.equal(await page.inputValue('#token'), '', 'the field is cleared');
  assert.ok(await page.isHidden('#orders'));
  await picture('locked');
});

test('unlocks this tab only, after the pause that follows a wrong token', async () => {
  const until = Date.now() + TIMEOUT_MS;
  while (await page.isHidden('#orders')) {
    assert.ok(Date.now() < until, await text('order-trouble'));
    await page.fill('#token', OPERATOR_TOKEN);
    const [answer] = await Promise.all([page.waitForResponse('**/api/order'), page.click('#unlock button')]);
    await answer.finished();
  }
  assert.ok(!page.url().includes(OPERATOR_TOKEN));
  await page.reload();
  await page.waitForSelector('#orders:not([hidden])');
  const other = await browser.newPage();
  await other.goto(`${studio.address}studio.html`);
  await other.waitForSelector('#unlock:not([hidden])', { timeout: TIMEOUT_MS });
  await other.close();
});

test('does not arm by the keyboard or with an invalid name', async () => {
  await offers('arm');
  await page.fill('#take-name', '../kendo');
  await page.keyboard.press('Enter');
  await page.click('#title');
  for (const key of ['a', 's', 'r', ' ', 'Enter']) await page.keyboard.press(key);
  await page.click('[data-order=arm]');
  await shows('order-trouble', 'letters, digits');
  assert.match(await text('doing'), /No take is armed/);
  assert.ok(await page.isHidden('#last-order'), 'no order was sent');
});

test('does not arm with a duration that is no number, and types letters that are shortcuts elsewhere', async () => {
  await page.fill('#take-name', '');
  await page.locator('#take-name').pressSequentially('kumite-03');
  assert.equal(await page.getAttribute('#mask', 'aria-pressed'), 'true', 'M switches the silhouettes outside of fields only');
  await page.locator('#take-seconds').pressSequentially('1e');
  await page.click('[data-order=arm]');
  await shows('order-trouble', 'expected a number from 1 to 86400');
  assert.ok(await page.isHidden('#last-order'), 'no order was sent');
  await page.fill('#take-seconds', '');
});

test('arms by a click and does not start by a second click', async () => {
  await page.fill('#take-name', 'kendo-07');
  await page.dblclick('[data-order=arm]');
  await shows('last-order', 'armed kendo-07: trigger cap01, 20 Hz');
  await shows('doing', 'kendo-07 is armed');
  await offers('start');
  assert.ok(await page.isHidden('#arming'));
  await picture('armed');
});

test('shows a red page while recording, then the verdict of v3dctl', async () => {
  await page.click('[data-order=start]');
  await recordsNow();
  assert.match(await text('recording'), /RECORDING.*kendo-07/s);
  assert.match(await page.title(), /^● kendo-07/);
  await page.waitForFunction(() => parseInt(document.getElementById('recording-facts').textContent) >= 30, null, { timeout: TIMEOUT_MS });
  await picture('recording');
  await offers('stop');
  await page.click('[data-order=stop]');
  const verdict = await showsVerdict('kendo-07');
  await page.waitForSelector('body:not(.recording)');
  await page.waitForSelector(`[data-take=kendo-07] .verdict.${verdict}`, { timeout: TIMEOUT_MS });
  await picture('stopped');
  await shows('events', `127.0.0.1: stop: done: take kendo-07: ${verdict}`);
});

test('proposes the name of the next take', async () => {
  await page.waitForFunction(() => document.getElementById('take-name').value === 'kendo-08', null, { timeout: TIMEOUT_MS });
});

test('shows the verdict of a take that ended after its duration', async () => {
  await arm('kendo-08', '1');
  await page.click('[data-order=start]');
  await offers('verdict');
  await page.click('[data-order=verdict]');
  await showsVerdict('kendo-08');
  await shows('last-order', 'x 20 pulses');
});

test('aborts only after a confirmation', async () => {
  await arm('kendo-09');
  await page.click('[data-order=abort]');
  await page.waitForSelector('#sure[open]');
  await picture('sure');
  await page.keyboard.press('Enter'); // the focus is on "Do not abort"
  await page.waitForSelector('#sure:not([open])', { state: 'attached' });
  await page.click('[data-order=abort]');
  await page.keyboard.press('Escape');
  assert.match(await text('doing'), /kendo-09 is armed/);
  await page.click('[data-order=abort]');
  await page.click('#sure .abort');
  await shows('last-order', 'aborted');
  await shows('doing', 'No take is armed');
});

test('shows the message of v3dctl about a rejected order', async () => {
  await offers('arm');
  await page.fill('#take-name', 'kendo-07'); // a take with this name exists
  await page.click('[data-order=arm]');
  await page.waitForSelector('#last-order .alarm');
  await shows('last-order', 'refused: ');
  await picture('refused');
});

test('leaves out two cameras that are rejected one after the other', async () => {
  const background = join(studio.folder, 'background');
  const kept = join(studio.folder, 'background-kept');
  cpSync(background, kept, { recursive: true });
  for (const file of readdirSync(background)) {
    if (/^cam0[12]\./.test(file)) rmSync(join(background, file));
  }
  await page.fill('#take-name', 'kendo-11');
  for (const camera of ['cam01', 'cam02']) {
    await offers('arm');
    await page.click('[data-order=arm]');
    await shows('last-order', `${camera} has no background model`);
    await page.click(`#without-cameras button:has-text("${camera}")`);
  }
  await offers('arm');
  await page.click('[data-order=arm]');
  await offers('abort');
  assert.ok(await page.isHidden('#without'));
  cpSync(kept, background, { recursive: true });
  await page.click('[data-order=abort]');
  await page.click('#sure .abort');
  await shows('doing', 'No take is armed');
});

test('accepts a reply that arrives after the end of its order', async () => {
  const refused = () => page.waitForSelector('#last-order:has-text("kendo-08") .alarm', { timeout: TIMEOUT_MS });
  await page.route('**/api/order', async (route) => {
    const answer = await route.fetch();
    await refused();
    await route.fulfill({ response: answer });
  });
  await page.fill('#take-name', 'kendo-08'); // a take with this name exists
  await page.click('[data-order=arm]');
  await offers('arm');
  await refused();
  await page.unroute('**/api/order');
});

test('offers orders again after a restart of the server during an order', async () => {
  let toPage;
  await page.routeWebSocket(/api.studio/, (socket) => {
    toPage = socket;
    socket.connectToServer();
  });
  await page.reload();
  await offers('arm');
  const order = { type: 'order', number: 99, by: '127.0.0.1', at_ms: 0, do: 'stop', take: '', text: 'stop', under_way: true, status: 0, lines: [] };
  toPage.send(JSON.stringify(order));
  await shows('doing', 'stop: under way');
  await studio.stopViewd();
  await studio.startViewd(); // the process that forwarded the order has ended, the new one knows none
  await offers('arm');
  await shows('doing', 'No take is armed');
});

test('clears the fault of a node after a question', async () => {
  const atFault = (node) => (node.name === 'cap01' ? { ...node, state: 'fault', take: '', text: 'Input/output error' } : node);
  await inOwnPage(() => changeStates((state) => ({ ...state, nodes: state.nodes.map(atFault) })), async () => {
    await shows('doing', 'Nodes at fault: cap01');
    await offers('abort');
    assert.equal(await page.locator('[data-order=arm]').count(), 0, 'the node would refuse it');
    await page.click('[data-order=abort]');
    await shows('sure-head', 'Clear the fault?');
    await picture('fault');
    const [request] = await Promise.all([page.waitForRequest('**/api/order'), page.click('#sure-yes')]);
    assert.equal(request.postDataJSON().do, 'abort');
    await shows('last-order', 'abort');
  });
});

test('shows no recording any more when the network falls silent, and connects again', async () => {
  let passes = true;
  const recording = (node) => ({ ...node, state: 'recording', take: 'kendo-99' });
  await inOwnPage(() => page.routeWebSocket(/api.studio/, (socket) => {
    socket.connectToServer().onMessage((message) => {
      if (!passes || typeof message !== 'string') return; // nothing closes
      const state = JSON.parse(message);
      socket.send(JSON.stringify(state.type === 'state' ? { ...state, nodes: state.nodes.map(recording) } : state));
    });
  }), async () => {
    await recordsNow();
    assert.ok(await page.isHidden('#banner:has-text("does not answer")'));
    passes = false;
    await shows('banner', 'does not answer');
    await page.waitForSelector('body:not(.recording)');
    passes = true;
    await recordsNow();
  });
});

test('offers the orders again after an order without an answer, or with half of one', async () => {
  for (const answer of [() => undefined, (route) => route.fulfill({ status: 202, contentType: 'application/json', body: '{' })]) {
    await offers('arm');
    await page.route('**/api/order', answer);
    await page.fill('#take-name', 'kendo-12');
    await page.click('[data-order=arm]');
    await shows('order-trouble', 'No answer: whether the studio got the order is not known');
    await offers('arm');
    await page.unroute('**/api/order');
  }
});

test('locks the page again on request', async () => {
  await page.click('#lock');
  assert.ok(await page.isHidden('#orders'));
  await page.reload();
  await page.waitForSelector('#operator:not([hidden])');
  assert.ok(await page.isHidden('#orders'));
});

test('works by touch on a tablet', async () => {
  const context = await browser.newContext({ viewport: { width: 768, height: 1024 }, hasTouch: true });
  page = await context.newPage();
  page.setDefaultTimeout(TIMEOUT_MS);
  await page.goto(`${studio.address}studio.html`);
  await unlock();
  await offers('arm');
  await page.fill('#take-name', 'kendo-10');
  await page.tap('[data-order=arm]');
  await offers('start');
  await page.tap('[data-order=start]');
  await recordsNow();
  await picture('tablet');
  await offers('stop');
  const { height } = await page.locator('[data-order=stop]').boundingBox();
  assert.ok(height >= 44, `height of a touch target: ${height} px, expected at least 44`);
  await page.tap('[data-order=stop]');
  await showsVerdict('kendo-10');
});
