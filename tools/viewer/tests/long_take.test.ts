import { afterEach, describe, expect, it, vi } from 'vitest';
import { BendPanel } from '../src/bend_panel';
import { SearchPace } from '../src/pose';
import type { Pose, Skeleton } from '../src/skeleton_file';
import type { Stage } from '../src/stage';

afterEach(() => vi.restoreAllMocks().unstubAllGlobals());

describe('the skeleton of a long take', () => {
  it('is bent without a search through its frames for each pose', () => {
    const element = {
      addEventListener: () => undefined, replaceChildren: () => undefined, blur: () => undefined, hidden: false, value: '', textContent: '', disabled: false,
    };
    vi.stubGlobal('document', { getElementById: () => element });
    vi.stubGlobal('Option', class {});
    const stage = { handle: { hide: () => undefined, show: () => undefined, onTurn: () => undefined } } as unknown as Stage;
    const pulses = Array.from({ length: 90_000 }, (_, n) => 10 + n);
    const positions = new Float64Array([0, 0, 1]), rotations = new Float64Array([1, 0, 0, 0]);
    const poses = pulses.map((pulse) => ({ pulse, positions, rotations, confidences: new Float32Array(1) }) as unknown as Pose);
    const skeleton = { joints: [{ name: 'pelvis', parent: -1 }], poses, skins: [{ pulses, vertices: 0 }] } as unknown as Skeleton;
    const panel = new BendPanel(stage, () => undefined);
    panel.open(skeleton, null);
    panel.begin(0, 50_000, 25);
    const searches = (['indexOf', 'findIndex', 'includes', 'find'] as const).map((name) => vi.spyOn(Array.prototype, name));
    const bent = poses.filter((pose) => panel.bentPose(pose) !== pose);
    const calls = searches.reduce((sum, { mock }) => sum + mock.calls.length, 0);
    expect(bent.map(({ pulse }) => pulse).filter((_, n, all) => n === 0 || n === all.length - 1)).toEqual([49_987, 50_013]);
    expect(calls).toBe(0);
  });

  it('is searched for similar poses at intervals while it plays, and at once when it is paused', () => {
    const pace = new SearchPace(250);
    let searches = 0;
    for (let n = 0; n < 50; ++n) if (pace.isDue(n, true, 20 * n)) ++searches; // a second
    expect(searches).toBe(4);
    expect(pace.isDue(49, false, 990)).toBe(true); // paused: the marks are of an earlier pulse
    expect(pace.isDue(49, false, 2000)).toBe(false);
    expect(pace.isDue(50, false, 2001)).toBe(true);
    expect(pace.isDue(51, false, 2002)).toBe(true);
  });
});
