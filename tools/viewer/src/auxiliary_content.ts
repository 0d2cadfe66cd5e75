// Auxiliary content of the open take or scene: items that are fetched beside its frames, such as sound and cameras.
import { isThere, NotFetched, Refusal } from './request';

export class AuxiliaryContent {
  /** Attempts to repeat. */
  private readonly failed = new Set<() => void>();
  private opened = 0;

  /** `trouble` shows the error of an item; '' removes it. */
  constructor(private readonly trouble: (item: string, text: string) => void) {}

  /** Forgets all items: something else is opened. */
  clear(): void {
    ++this.opened;
    this.failed.clear();
  }

  /** Fetches an item and uses it. A failure is shown. Only a failed fetch is repeated, by again(). */
  load<T>(item: string, fetchItem: () => Promise<T>, use: (value: T) => void): void {
    const { opened } = this;
    const attempt = async () => {
      let value: T;
      try {
        value = await fetchItem();
      } catch (error) {
        if (opened !== this.opened) return;
        this.failed.add(attempt);
        const text = (error as Error).message;
        return this.trouble(item, error instanceof Refusal ? `${item}: ${text}` : text);
      }
      if (opened !== this.opened) return;
      this.trouble(item, '');
      try {
        use(value);
      } catch (error) {
        this.trouble(item, `${item}: ${(error as Error).message}`);
      }
    };
    void attempt();
  }

  /** Fetches the items again that could not be fetched. */
  again(): void {
    const attempts = [...this.failed];
    this.failed.clear();
    for (const attempt of attempts) attempt();
  }
}

/**
 * `load` of the file at `url` by a library whose errors do not tell why. Each call tries once. Null: there is no such file, it is
 * invalid, or `isLate()`. Throws NotFetched where a later call may succeed. A file that exists is invalid only after the second failure,
 * because the server may have been busy at the first.
 */
export function repeatable<T>(load: () => Promise<T>, url: string, isLate: () => boolean): () => Promise<T | null> {
  let failures = 0;
  const explained = async () => {
    if (!(await isThere(url)) || ++failures > 1) return null;
    throw new NotFetched(`${decodeURIComponent(new URL(url).pathname.split('/').at(-1)!)} could not be loaded. It is tried again.`);
  };
  return async () => {
    if (isLate()) return null;
    try {
      return await load().catch(explained);
    } catch (error) {
      if (isLate()) return null;
      throw error;
    }
  };
}
