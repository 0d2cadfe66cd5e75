import { afterEach, describe, expect, it, vi } from 'vitest';
import { AuxiliaryContent } from '../src/auxiliary_content';
import { fetchJson, fetchThere, isThere, Refusal } from '../src/request';
import { fetchRig } from '../src/rig';
import { fetchSound } from '../src/sound_file';
import { fetchScenes, fetchTakes } from '../src/take_list';

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});
const answer = (status: number, text = '') => vi.stubGlobal('fetch', async () => new Response(text, { status }));

describe('a request of the page', () => {
  it('distinguishes absent content from a busy server', async () => {
    answer(404, 'there is no such take\n');
    expect(await fetchRig('api/rig')).toEqual([]);
    expect(await fetchSound('kendo-07')).toEqual([]);
    expect(await isThere('motion.v3d')).toBe(false);
    answer(503, 'too many open files; try again\n');
    for (const fetched of [fetchRig('api/rig'), fetchSound('kendo-07'), isThere('motion.v3d'), fetchScenes(), fetchTakes()]) {
      await expect(fetched).rejects.toThrow('too many open files; try again');
    }
  });

  it('reports what the server cannot read, and does not show it as absent', async () => {
    answer(500, 'a file cannot be read; see the log of v3d-viewd\n');
    const picture = fetchThere('api/takes/a/views/1', new AbortController().signal, async () => 1);
    for (const fetched of [fetchRig('api/rig'), fetchSound('kendo-07'), picture]) {
      await expect(fetched).rejects.toThrow('a file cannot be read; see the log of v3d-viewd');
    }
  });

  it('has the reason of a refusal, and no page of a proxy', async () => {
    answer(401, 'This studio requires a token: open this address with ?token=TOKEN appended, once.\n');
    await expect(fetchTakes()).rejects.toThrow(Refusal);
    await expect(fetchTakes()).rejects.toThrow('requires a token');
    answer(502, '<html><h1>Bad Gateway</h1></html>');
    await expect(fetchTakes()).rejects.toThrow('The server answered 502.');
  });

  it('that gets no answer ends after 15 s', async () => {
    vi.useFakeTimers();
    vi.stubGlobal('fetch', (_: string, { signal }: { signal: AbortSignal }) =>
      new Promise((_done, fail) => signal.addEventListener('abort', () => fail(signal.reason))));
    const errors: Error[] = [];
    for (const request of [fetchRig('api/rig'), isThere('motion.v3d')]) request.catch((error: Error) => errors.push(error));
    await vi.advanceTimersByTimeAsync(14_000);
    expect(errors).toEqual([]);
    await vi.advanceTimersByTimeAsync(1500);
    expect(errors.map(({ message }) => message)).toEqual(Array(2).fill('The studio does not answer. Is v3d-viewd running?'));
  });

  it('without an answer is no refusal', async () => {
    vi.stubGlobal('fetch', () => Promise.reject(new TypeError('Failed to fetch')));
    const error = await fetchJson('api/takes').catch((thrown: Error) => thrown);
    expect(error).not.toBeInstanceOf(Refusal);
    expect(error).toMatchObject({ message: 'The studio does not answer. Is v3d-viewd running?' });
  });
});

describe('items of the auxiliary content', () => {
  const settled = () => new Promise((done) => setTimeout(done));

  it('are fetched again until they are there', async () => {
    const shown: [string, string][] = [];
    const used: number[] = [];
    const content = new AuxiliaryContent((item, text) => shown.push([item, text]));
    let calls = 0;
    content.load('Sound', async () => {
      if (++calls < 3) throw new Refusal('too many open files; try again');
      return calls;
    }, (value) => used.push(value));
    await settled();
    expect(shown).toEqual([['Sound', 'Sound: too many open files; try again']]);
    for (let n = 0; n < 5; ++n) {
      content.again();
      await settled();
    }
    expect(calls).toBe(3);
    expect(used).toEqual([3]);
    expect(shown.at(-1)).toEqual(['Sound', '']);
  });

  it('that are invalid are reported and not fetched again', async () => {
    const shown: string[] = [];
    const content = new AuxiliaryContent((_, text) => shown.push(text));
    let calls = 0;
    content.load('duel/scene.json', async () => ++calls, () => {
      throw new Error('seconds: expected a number');
    });
    await settled();
    content.again();
    await settled();
    expect(calls).toBe(1);
    expect(shown.at(-1)).toBe('duel/scene.json: seconds: expected a number');
  });

  it('are forgotten when something else is opened', async () => {
    const shown: string[] = [];
    const used: number[] = [];
    const content = new AuxiliaryContent((_, text) => shown.push(text));
    let arrive = (_: number) => {}, calls = 0;
    content.load('Cameras', () => new Promise<number>((done) => (arrive = done)), (value) => used.push(value));
    content.load('Sound', async () => {
      ++calls;
      throw new Error('The studio does not answer.');
    }, () => undefined);
    await settled();
    content.clear();
    arrive(1);
    content.again();
    await settled();
    expect(used).toEqual([]);
    expect(calls).toBe(1);
    expect(shown).toEqual(['The studio does not answer.']);
  });
});
