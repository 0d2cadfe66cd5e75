import { describe, expect, it } from 'vitest';
import { liveTexts, MAX_LIVE_AGE_MS } from '../src/live_age';

describe('the live picture', () => {
  it('is called live while meshes arrive', () => {
    expect(liveTexts('kendo-06', 0)).toEqual({ title: 'Live: kendo-06', trouble: '' });
    expect(liveTexts('kendo-06', MAX_LIVE_AGE_MS).trouble).toBe('');
  });

  it('is not called live after its take has ended', () => {
    const { title, trouble } = liveTexts('kendo-06', MAX_LIVE_AGE_MS + 1);
    expect(title).toBe('Last live mesh: kendo-06');
    expect(trouble).toContain('kendo-06');
    expect(trouble).toContain('has ended');
  });
});
