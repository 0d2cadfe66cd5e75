import { Object3D } from 'three';
import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import type { Clip } from '../player/src/clip';
import type { V3dPlayerElement } from '../player/src/player_element';
import { VolumePlayer } from '../player/src/volume_player';

/** An element, as far as the player uses it. */
class FakeElement {
  readonly attributes = new Map<string, string>();
  readonly events: string[] = [];
  getAttribute = (name: string) => this.attributes.get(name) ?? null;
  hasAttribute = (name: string) => this.attributes.has(name);
  dispatchEvent = ({ type }: Event) => this.events.push(type);
}

/** A clip that plays. */
class FakeClip {
  readonly mesh = new Object3D();
  readonly duration = 4;
  readonly currentTime = 2;
  readonly pulse = 50;
  readonly hasSound = false;
  paused = false;
  disposed = false;
  pause = () => (this.paused = true);
  dispose = () => (this.disposed = true);
}

let clip: FakeClip;
let player: VolumePlayer;
let element: V3dPlayerElement;
let drawn: number;
let resets: number;

/** An element that plays `clip`, with stage and controls that only count calls. */
beforeEach(async () => {
  vi.stubGlobal('HTMLElement', FakeElement);
  const { V3dPlayerElement: Element } = await import('../player/src/player_element');
  clip = new FakeClip();
  player = new VolumePlayer();
  Object.assign(player as object, { clip });
  drawn = resets = 0;
  element = new Element();
  Object.assign(element as object, { player, stage: { redraw: () => ++drawn }, controlBar: { reset: () => ++resets } });
  player.addEventListener('pause', () => element.dispatchEvent({ type: 'pause' } as Event));
});
afterEach(() => vi.unstubAllGlobals());

const fake = () => element as unknown as FakeElement;

it('stops and becomes empty when its attribute src is removed', () => {
  element.attributeChangedCallback('src');
  expect([clip.paused, clip.disposed]).toEqual([true, true]);
  expect([element.paused, element.pulse, element.duration]).toEqual([true, -1, 0]);
  expect(fake().events).toEqual(['pause']);
  expect([drawn > 0, resets > 0]).toEqual([true, true]);
});

it('shows nothing of a source that arrives after its attribute src was removed', async () => {
  let arrive = (_: Clip) => {};
  Object.assign(player as object, { open: () => new Promise<Clip>((done) => (arrive = done)) });
  fake().attributes.set('src', 'kendo/');
  element.attributeChangedCallback('src');
  fake().attributes.delete('src');
  element.attributeChangedCallback('src');
  const late = new FakeClip();
  arrive(late as unknown as Clip);
  await new Promise((done) => setTimeout(done));
  expect([late.disposed, element.pulse]).toEqual([true, -1]);
});
