/** Source of bytes that are read in parts. */
export interface ByteSource {
  /** Total number of bytes. */
  size(): Promise<number>;
  /** Reads bytes [first, first + size); fewer only at the end. */
  read(first: number, size: number): Promise<Uint8Array>;
}

/** The server has no file at the address. */
export class NoSuchFile extends Error {}

/** File of a web server that supports range requests. */
export class HttpSource implements ByteSource {
  constructor(private readonly url: string) {}

  async size(): Promise<number> {
    const answer = await fetch(this.url, { method: 'HEAD', cache: 'no-cache' });
    if (answer.status === 404) throw new NoSuchFile('The server answered 404.');
    if (!answer.ok) throw new Error(`The server answered ${answer.status}.`);
    return Number(answer.headers.get('Content-Length') ?? 0);
  }

  async read(first: number, size: number): Promise<Uint8Array> {
    const range = `bytes=${first}-${first + size - 1}`;
    const answer = await fetch(this.url, { headers: { Range: range } });
    if (answer.status !== 206) throw new Error(`The server answered ${answer.status} instead of 206 (partial content).`);
    return new Uint8Array(await answer.arrayBuffer());
  }
}
