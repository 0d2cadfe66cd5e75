import { afterEach, describe, expect, it, vi } from 'vitest';
import { Unavailable } from '../player/src/byte_source';
import { decoderModule } from '../player/src/decoder_module';
import { startWorker } from '../src/page_worker';

afterEach(() => vi.unstubAllGlobals());

/** The smallest module: magic and version. */
const MODULE = Uint8Array.of(0, 0x61, 0x73, 0x6d, 1, 0, 0, 0);
const answers = (...responses: (() => Response)[]) => {
  const fetched = vi.fn(async () => (responses.shift() ?? (() => new Response(MODULE, { headers: { 'Content-Type': 'application/wasm' } })))());
  vi.stubGlobal('fetch', fetched);
  return fetched;
};

describe('the decoder', () => {
  it('is fetched once', async () => {
    const fetched = answers();
    const module = decoderModule('v3d_decoder.wasm');
    const [first, second] = await Promise.all([module(), module()]);
    expect(first).toBeInstanceOf(WebAssembly.Module);
    expect(second).toBe(first);
    expect(fetched).toHaveBeenCalledTimes(1);
  });

  it('is fetched again after a busy server and after a gap of the network', async () => {
    answers(() => new Response(null, { status: 503 }), () => {
      throw new TypeError('Failed to fetch');
    });
    const module = decoderModule('v3d_decoder.wasm');
    for (let n = 0; n < 2; ++n) await expect(module()).rejects.toThrow(Unavailable);
    expect(await module()).toBeInstanceOf(WebAssembly.Module);
  });

  it('that is no longer on the server asks for a reload of the page', async () => {
    answers(() => new Response(null, { status: 404 }));
    const error = await decoderModule('v3d_decoder.wasm')().catch((thrown: Error) => thrown);
    expect(error).not.toBeInstanceOf(Unavailable);
    expect(error).toMatchObject({ message: 'The decoder cannot be loaded (The server answered 404.); reload the page.' });
  });
});

describe('a worker of the page', () => {
  it('that cannot start asks for a reload of the page', () => {
    let made: { onerror?: () => void; onmessage?: (event: { data: unknown }) => void } = {};
    vi.stubGlobal('Worker', class {
      constructor() {
        made = this;
      }
    });
    const messages: unknown[] = [], failures: string[] = [];
    startWorker((message) => messages.push(message), (text) => failures.push(text));
    made.onmessage!({ data: { kind: 'opened' } });
    expect(messages).toEqual([{ kind: 'opened' }]);
    made.onerror!();
    expect(failures).toEqual(['A worker of this page could not start, or has failed: reload the page.']);
  });
});
