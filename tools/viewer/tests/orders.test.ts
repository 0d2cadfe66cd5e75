import { afterEach, describe, expect, it, vi } from 'vitest';
import { send } from '../src/orders';

describe('an order', () => {
  afterEach(() => {
    vi.unstubAllGlobals();
    vi.restoreAllMocks();
  });
  const answers = (answer: () => Promise<Response>) => vi.stubGlobal('fetch', answer);

  it('has a report, or the reason of a refusal', async () => {
    answers(async () => new Response('{"number": 7}', { status: 202 }));
    expect(await send({ do: 'stop' }, 'token')).toEqual({ report: { number: 7 } });
    answers(async () => new Response("this is not the operators' token\n", { status: 401 }));
    expect(await send({ do: 'stop' }, 'x')).toEqual({ refusal: "this is not the operators' token", wrongToken: true });
    answers(async () => new Response('', { status: 503 }));
    expect(await send({ do: 'stop' }, 'x')).toEqual({ refusal: 'The server answered 503.', wrongToken: false });
  });

  it('without an answer, or with half of one, is reported as unknown', async () => {
    answers(() => Promise.reject(new TypeError('Failed to fetch')));
    expect(await send({ do: 'stop' }, 'token')).toMatchObject({ refusal: expect.stringContaining('No answer') });
    answers(async () => new Response('{', { status: 202 }));
    expect(await send({ do: 'stop' }, 'token')).toMatchObject({ refusal: expect.stringContaining('No answer') });
  });

  it('is given up before the server would refuse it as too old', async () => {
    const late = vi.spyOn(AbortSignal, 'timeout').mockImplementation(() => AbortSignal.abort());
    vi.stubGlobal('fetch', async (_: string, { signal }: RequestInit) => {
      if (signal?.aborted) throw new DOMException('', 'TimeoutError');
      return new Promise(() => undefined); // a network that hangs
    });
    expect(await send({ do: 'stop' }, 'token')).toMatchObject({ refusal: expect.stringContaining('No answer') });
    expect(late.mock.calls[0][0]).toBeLessThan(10_000);
  });
});
