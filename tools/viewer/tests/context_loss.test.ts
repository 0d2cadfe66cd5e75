import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { watchContext } from '../player/src/context_loss';

describe('a lost WebGL context', () => {
  let canvas: EventTarget;
  let calls: string[];
  let end: () => void;

  beforeEach(() => {
    vi.useFakeTimers();
    canvas = new EventTarget();
    calls = [];
    end = watchContext(canvas, 5000, () => calls.push('lost'), () => calls.push('restored'));
  });
  afterEach(() => vi.useRealTimers());
  const happens = (event: string) => canvas.dispatchEvent(new Event(event));

  it('is reported after a while, and everything is drawn again when it is back', () => {
    happens('webglcontextlost');
    vi.advanceTimersByTime(4999);
    expect(calls).toEqual([]);
    vi.advanceTimersByTime(1);
    expect(calls).toEqual(['lost']);
    happens('webglcontextrestored');
    expect(calls).toEqual(['lost', 'restored']);
  });

  it('that comes back soon is not reported', () => {
    happens('webglcontextlost');
    vi.advanceTimersByTime(1000);
    happens('webglcontextrestored');
    vi.advanceTimersByTime(60_000);
    expect(calls).toEqual(['restored']);
  });

  it('of a player that was removed is not reported', () => {
    happens('webglcontextlost');
    end();
    vi.advanceTimersByTime(60_000);
    happens('webglcontextrestored');
    expect(calls).toEqual([]);
  });
});
