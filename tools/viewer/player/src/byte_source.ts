/** Source of bytes that are read in parts. */
export interface ByteSource {
  /** Total number of bytes. */
  size(): Promise<number>;
  /** Reads bytes [first, first + size); fewer only at the end. */
  read(first: number, size: number): Promise<Uint8Array>;
}

/** The server has no file at the address. */
export class NoSuchFile extends Error {}

/** The server is busy or does not answer: the same request may succeed later. */
export class Unavailable extends Error {}

/** Pause before a request is repeated. */
const AGAIN_MS = 1000;

/** Repeats a request every second while it is Unavailable, which `trouble` gets. Null after `ended()`. */
export async function repeated<T>(request: () => Promise<T>, ended: () => boolean, trouble: (error: unknown) => void): Promise<T | null> {
  while (!ended()) {
    try {
      return await request();
    } catch (error) {
      if (ended()) break;
      if (!(error instanceof Unavailable)) throw error;
      trouble(error);
      await new Promise((done) => setTimeout(done, AGAIN_MS));
    }
  }
  return null;
}

export const BUSY = 503;

export const statusError = (status: number, instead = '') =>
  (status === BUSY ? new Unavailable('The server is busy (503).') : new Error(`The server answered ${status}${instead}.`));

/** The longest time between two bytes of a response without a deadline, ms. The server gives up after 10 s. */
const SILENCE_MS = 15_000;

/**
 * fetch(), and `use` of its response, which calls `progress` when bytes have arrived. Throws Unavailable when the network fails or when
 * it takes longer than `deadlineMs`; if that is Infinity, when no byte arrives for `silenceMs`.
 */
export async function fetchWithin<T>(
  url: string, init: RequestInit, deadlineMs: number, use: (response: Response, progress: () => void) => Promise<T>, silenceMs = SILENCE_MS,
): Promise<T> {
  const endless = deadlineMs === Infinity;
  const limitMs = endless ? silenceMs : deadlineMs;
  const request = new AbortController();
  let late = false;
  const wait = () => setTimeout(() => {
    late = true;
    request.abort();
  }, limitMs);
  let timer = wait();
  const progress = () => {
    if (!endless) return;
    clearTimeout(timer);
    timer = wait();
  };
  const end = () => request.abort();
  init.signal?.addEventListener('abort', end);
  if (init.signal?.aborted) end();
  try {
    const response = await fetch(url, { ...init, signal: request.signal });
    progress();
    return await use(response, progress);
  } catch (error) {
    if (late) throw new Unavailable(`The server ${endless ? 'sent nothing for' : 'did not answer within'} ${limitMs / 1000} s.`);
    if (error instanceof TypeError) throw new Unavailable(`The server does not answer (${error.message}).`);
    throw error;
  } finally {
    clearTimeout(timer);
    init.signal?.removeEventListener('abort', end);
  }
}

/** The body of a response. Throws a message when it has more than `limit` bytes. */
export async function bodyOf(response: Response, limit: number, progress: () => void = () => undefined): Promise<Uint8Array<ArrayBuffer>> {
  const parts: Uint8Array[] = [];
  let size = 0;
  const reader = response.body!.getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    progress();
    size += part.value.length;
    if (size > limit) {
      void reader.cancel();
      throw new Error(`The server sent more than ${limit} bytes.`);
    }
    parts.push(part.value);
  }
  const bytes = new Uint8Array(size);
  parts.reduce((at, part) => (bytes.set(part, at), at + part.length), 0);
  return bytes;
}

/** A whole file of at most `limit` bytes. Throws a message. */
export function fetchFile(url: string, limit: number, deadlineMs: number): Promise<Uint8Array> {
  return fetchWithin(url, { cache: 'no-cache' }, deadlineMs, (response, progress) => {
    if (!response.ok) throw statusError(response.status);
    return bodyOf(response, limit, progress);
  });
}

/** File of a web server that supports range requests. */
export class HttpSource implements ByteSource {
  /** `deadlineMs`: the longest time for each response. `signal` ends all requests. */
  constructor(
    private readonly url: string,
    private readonly deadlineMs = Infinity,
    private readonly signal: AbortSignal | null = null,
  ) {}

  size(): Promise<number> {
    return fetchWithin(this.url, { method: 'HEAD', cache: 'no-cache', signal: this.signal }, this.deadlineMs, async (response) => {
      if (response.status === 404) throw new NoSuchFile('The server answered 404.');
      if (!response.ok) throw statusError(response.status);
      const length = response.headers.get('Content-Length');
      if (length === null) throw new Error('The server does not state the length of the file (Content-Length).');
      return Number(length);
    });
  }

  read(first: number, size: number): Promise<Uint8Array> {
    const range = `bytes=${first}-${first + size - 1}`;
    return fetchWithin(this.url, { headers: { Range: range }, signal: this.signal }, this.deadlineMs, async (response, progress) => {
      if (response.status === 416) throw new Error('The file on the server is shorter than before: it was replaced; open it again.');
      if (response.status !== 206) throw statusError(response.status, ' instead of 206 (partial content)');
      return bodyOf(response, size, progress);
    });
  }
}
