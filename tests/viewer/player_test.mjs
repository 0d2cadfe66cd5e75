// Browser tests of the player, @v3d/player: its example page in Chromium, and a delivery of v3dctl export --format volume.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { assertInStep, FIRST, firstEvent, isAt, LAST, PlayerStudio, RATE, recordedBursts, tapElement, tapOutput, tapSound } from './player_probe.mjs';

const studio = new PlayerStudio();
let player;

before(() => studio.start());
after(() => studio.end());

test('shows the first pulse of a delivery, and the pulse of a time', async () => {
  player = await studio.newPlayer();
  await player.open({ src: '/volume/', muted: true });
  await player.event('loadedmetadata');
  assert.equal(await player.get('duration'), (LAST - FIRST + 1) / RATE);
  assertInStep(await player.showing(FIRST), 'first');
  for (const pulse of [12, 31, 24, 26, LAST, FIRST]) assertInStep(await player.seek(pulse), 'sought');
});

test('plays a delivery with the surface of the picture that the video shows, again with loop, else to its end', async () => {
  await player.open({ src: '/volume/', muted: true, autoplay: true, loop: true });
  await studio.page.waitForFunction(() => {
    const pulses = window.seen.map(({ pulse }) => pulse);
    return new Set(pulses).size >= 6 && pulses.some((pulse, n) => n > 0 && pulse < pulses[n - 1]);
  });
  assert.equal(await player.hasEvent('ended'), false);
  await player.set('loop', false);
  await player.event('ended');
  await player.showing(LAST);
  for (const look of await player.seen()) assertInStep(look, 'played');
  assert.equal(await player.get('ended'), true);
});

test('shows the right pulse in browsers without VideoFrame or without announced pictures', async () => {
  const lacks = [() => { delete window.VideoFrame; }, () => { delete window.VideoFrame; delete HTMLVideoElement.prototype.requestVideoFrameCallback; }];
  for (const lack of lacks) {
    player = await studio.newPlayer(lack);
    await player.open({ src: '/volume/', muted: true });
    await player.event('loadedmetadata');
    for (const pulse of [12, 31, LAST]) assertInStep(await player.seek(pulse), String(lack));
  }
  player = await studio.newPlayer();
});

test('plays H.264 in browsers without AV1', async () => {
  player = await studio.newPlayer(() => {
    const { canPlayType } = HTMLMediaElement.prototype;
    HTMLMediaElement.prototype.canPlayType = function (type) {
      return type.includes('av01') ? '' : canPlayType.call(this, type);
    };
  });
  await player.open({ src: '/volume/', muted: true });
  await player.event('loadedmetadata');
  assert.match(await studio.page.evaluate(() => window.video.src), /texture-h264\.mp4$/);
  for (const pulse of [12, 31, LAST, FIRST]) assertInStep(await player.seek(pulse), 'sought');
  await player.call('play');
  await player.event('ended');
  for (const look of await player.seen()) assertInStep(look, 'played');
  player = await studio.newPlayer();
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
    player = await studio.newPlayer();
    const { event } = await firstEvent(studio.page, ['autoplayblocked', 'play']);
    await player.open({ src: '/volume/', autoplay: true, ...attributes });
    assert.equal(await event, expected);
  }
  await player.event('ended');
});

test('plays with sound after a click', async () => {
  player = await studio.newPlayer();
  const { event } = await firstEvent(studio.page, ['autoplayblocked']);
  await player.open({ src: '/volume/', autoplay: true });
  await event;
  assert.equal(await player.get('paused'), true);
  await studio.page.getByRole('button', { name: 'Play with sound' }).click();
  await player.event('ended');
  assert.equal(await studio.page.evaluate(() => window.video.muted), false);
  for (const look of await player.seen()) assertInStep(look, 'with sound');
});

test('has controls that play, pause, seek and switch the sound', async () => {
  await player.open({ src: '/volume/', controls: true, loop: true });
  await player.event('loadedmetadata');
  await studio.page.getByRole('button', { name: 'Play', exact: true }).click();
  await player.event('play');
  await studio.page.getByRole('button', { name: 'Pause' }).click();
  await player.event('pause');
  await studio.page.getByLabel('Time, seconds').fill('0.4');
  assertInStep(await player.showing(15), 'time line');
  await studio.page.getByRole('button', { name: 'Sound' }).click();
  assert.equal(await player.get('muted'), true);
  assert.equal(await studio.page.evaluate(() => window.video.muted), true);
});

test('has the sound of a pulse at the media time of its picture', async (context) => {
  await player.open({ src: '/volume/', muted: true });
  await player.event('loadedmetadata');
  const times = await studio.page.evaluate(async () => {
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
  await studio.page.evaluate(tapSound);
  await player.call('play');
  await player.event('ended');
  await studio.page.waitForFunction(() => window.bursts.length === 3);
  const { bursts, drawn } = await studio.page.evaluate(() => ({ bursts: window.bursts, drawn: window.drawn }));
  // The times are reported only: on a busy machine without a sound device they say little.
  bursts.forEach((at, n) => {
    const pulse = 10 + 10 * n;
    const { pulse: shown } = drawn.findLast((picture) => picture.at <= at) ?? drawn[0];
    const start = drawn.find((picture) => picture.pulse >= pulse);
    const late = start ? `; pulse ${start.pulse} was drawn ${(1000 * (start.at - at) - (1000 * (start.pulse - pulse)) / RATE).toFixed(0)} ms after its sound` : '';
    context.diagnostic(`sound of pulse ${pulse} with pulse ${shown} on the screen${late}`);
  });
});

test('repeats the sound of a loop without a missing or repeated sample', async (context) => {
  player = await studio.newPlayer(tapOutput);
  await player.open({ src: '/volume/', loop: true });
  await player.event('loadedmetadata');
  await studio.page.evaluate(tapElement);
  await player.call('play');
  // Three bursts in a pass; the fourth to the ninth are two passes and the ends between them.
  const bursts = 10;
  await studio.page.waitForFunction(recordedBursts, bursts);
  const { sampleRate, starts, samples } = await studio.page.evaluate(recordedBursts, bursts);
  const pass = Math.round(((LAST - FIRST + 1) / RATE) * sampleRate);
  const begin = starts[3] - Math.round(0.1 * sampleRate);
  context.diagnostic(`bursts after ${starts.slice(1).map((start, n) => start - starts[n]).join(', ')} samples; a pass has ${pass}`);
  let difference = 0;
  for (let n = begin; n < begin + pass; ++n) difference = Math.max(difference, Math.abs(samples[n + pass] - samples[n]));
  assert.ok(difference < 1e-4, `a sample of the next pass differs by ${difference}`);
  for (const look of await player.seen()) assertInStep(look, 'in a loop with sound');
  assert.equal(await player.hasEvent('ended'), false);
  await player.set('loop', false);
  await player.event('ended');
});

test('waits for a gesture before the sound of a loop', async () => {
  player = await studio.newPlayer();
  const { event } = await firstEvent(studio.page, ['autoplayblocked', 'play']);
  await player.open({ src: '/volume/', autoplay: true, loop: true });
  assert.equal(await event, 'autoplayblocked');
});
