// Requests of the page to its server. What is absent (404) differs from a server that is busy, refuses or does not answer.

import { bodyOf, BUSY, fetchWithin, Unavailable } from '../player/src/byte_source';

const NO_RESPONSE = 'The studio does not answer. Is v3d-viewd running?';

/** It is not known what is at an address: a later request may succeed. The message is for the user. */
export class NotFetched extends Error {}

/** The server refused a request, or is busy. The message is its line of text. */
export class Refusal extends NotFetched {}

/** The file is larger than the page can read. */
export class TooLarge extends Error {}

function lineOf(text: string, status: number): string {
  const line = text.split('\n')[0].trim();
  return line && !line.startsWith('<') ? line.slice(0, 300) : `The server answered ${status}.`;
}

type Use<T> = (response: Response, progress: () => void) => Promise<T>;

async function fetchOrNull<T>(url: string, init: RequestInit, use: Use<T>): Promise<T | null> {
  try {
    return await fetchWithin(url, init, Infinity, async (response, progress) => {
      if (response.ok) return use(response, progress);
      if (response.status === 404) return null;
      throw new Refusal(lineOf(await response.text(), response.status));
    });
  } catch (error) {
    if (error instanceof NotFetched || error instanceof TooLarge) throw error;
    throw new NotFetched(NO_RESPONSE);
  }
}

/** The text of a response. Throws TooLarge for more than `limit` bytes. */
async function textOf(response: Response, limit: number, progress: () => void): Promise<string> {
  const bytes = Number(response.headers.get('Content-Length') ?? 0);
  if (bytes <= limit) return new TextDecoder().decode(await bodyOf(response, limit, progress));
  void response.body?.cancel();
  throw new TooLarge(`has ${bytes} bytes; a browser can read at most ${limit}.`);
}

/** The JSON at an address; null: there is none. Throws a message for the user, a Refusal if it is from the server. */
export const fetchJson = <T>(url: string, init: RequestInit = {}) =>
  fetchOrNull(url, init, async (response, progress) => JSON.parse(await textOf(response, Infinity, progress)) as T);

/** The text at an address; null: there is none. Throws like fetchJson(), and TooLarge for more than `limit` bytes. */
export const fetchText = (url: string, limit = Infinity) =>
  fetchOrNull(url, { cache: 'no-cache' }, (response, progress) => textOf(response, limit, progress));

/** Whether there is a file at an address. Throws like fetchJson(). */
export const isThere = async (url: string) => (await fetchOrNull(url, { method: 'HEAD', cache: 'no-cache' }, async () => true)) ?? false;

/** The server gives up making a picture after 60 s. */
const PICTURE_SILENCE_MS = 70_000;

/**
 * `use` of the picture or view at an address; null: there is none. Throws Unavailable when the server is busy or silent, and a Refusal for
 * other responses.
 */
export const fetchThere = <T>(url: string, signal: AbortSignal, use: Use<T>): Promise<T | null> =>
  fetchWithin(url, { signal }, Infinity, async (response, progress) => {
    if (response.status === 404) return null;
    if (response.ok) return use(response, progress);
    const line = lineOf(await response.text(), response.status);
    throw response.status === BUSY ? new Unavailable(line) : new Refusal(line);
  }, PICTURE_SILENCE_MS);
