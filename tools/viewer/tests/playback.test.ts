import { describe, expect, it } from 'vitest';
import { Playback, timeCode } from '../player/src/playback';

const take = (pulses: number[] = Array.from({ length: 100 }, (_, n) => n)) =>
  new Playback(pulses.map((pulse) => ({ pulse })), 25);

describe('playback', () => {
  it('is of the same pulses alone', () => {
    expect(take([3, 4, 7]).isOf([3, 4, 7])).toBe(true);
    expect(take([3, 4, 7]).isOf([3, 5, 7])).toBe(false);
    expect(take([3, 4, 7]).isOf([3, 4])).toBe(false);
  });

  it('advances with the clock, at the rate of the take', () => {
    const p = take();
    p.advance(1);
    expect(p.pulse).toBe(0); // not playing
    p.toggle();
    for (let n = 0; n < 60; ++n) p.advance(1 / 60);
    expect([24, 25]).toContain(p.pulse);
    p.speed = 2;
    p.advance(1);
    expect(p.pulse).toBeGreaterThanOrEqual(74);
  });

  it('restarts at the in point, or stops at the out point', () => {
    const p = take();
    p.seek(20);
    p.setIn();
    p.seek(29);
    p.setOut();
    p.toggle();
    expect(p.pulse).toBe(20); // it was at the end
    p.advance(0.39);
    expect(p.pulse).toBe(29);
    p.advance(0.04);
    expect(p.pulse).toBe(20);
    p.loop = false;
    p.advance(10);
    expect([p.pulse, p.playing]).toEqual([29, false]);
  });

  it('steps from mesh to mesh, over pulses that have none', () => {
    const p = take([0, 1, 7, 8]);
    p.step(2);
    expect([p.pulse, p.frame]).toEqual([7, 2]);
    p.step(-1);
    expect(p.pulse).toBe(1);
    p.step(99);
    expect(p.pulse).toBe(8);
    p.step(-99);
    expect(p.pulse).toBe(0);
  });

  it('stays inside the take for every seek', () => {
    const p = take();
    p.seek(-5);
    expect(p.pulse).toBe(0);
    p.seek(1e9);
    expect(p.pulse).toBe(99);
    p.advance(1e6);
    expect(p.pulse).toBe(99);
  });

  it('never has an out point before the in point', () => {
    const p = take();
    p.seek(10);
    p.setOut();
    p.seek(50);
    p.setIn();
    expect([p.inPulse, p.outPulse]).toEqual([50, 99]);
    p.clearInOut();
    expect([p.inPulse, p.outPulse]).toEqual([0, 99]);
  });

  it('changes its speed in steps', () => {
    const p = take();
    p.faster(1);
    expect(p.speed).toBe(2);
    p.faster(-99);
    expect(p.speed).toBe(0.1);
  });

  it('formats time as minutes, seconds and pulses', () => {
    expect([0, 24, 25, 1510].map((pulse) => timeCode(pulse, 25))).toEqual(['0:00.00', '0:00.24', '0:01.00', '1:00.10']);
  });
});
