// Parts of the open content that are fetched beside its frames, such as sound and cameras.
import { Refusal } from './request';

export class Parts {
  /** Attempts to repeat. */
  private readonly failed = new Set<() => void>();
  private opened = 0;

  /** `trouble` shows the error of a part; '' removes it. */
  constructor(private readonly trouble: (part: string, text: string) => void) {}

  /** Forgets all parts: something else is opened. */
  clear(): void {
    ++this.opened;
    this.failed.clear();
  }

  /** Fetches a part and uses it. A failure is shown. Only a failed fetch is repeated, by again(). */
  load<T>(part: string, fetchPart: () => Promise<T>, use: (value: T) => void): void {
    const { opened } = this;
    const attempt = async () => {
      let value: T;
      try {
        value = await fetchPart();
      } catch (error) {
        if (opened !== this.opened) return;
        this.failed.add(attempt);
        const text = (error as Error).message;
        return this.trouble(part, error instanceof Refusal ? `${part}: ${text}` : text);
      }
      if (opened !== this.opened) return;
      this.trouble(part, '');
      try {
        use(value);
      } catch (error) {
        this.trouble(part, `${part}: ${(error as Error).message}`);
      }
    };
    void attempt();
  }

  /** Fetches the parts again that could not be fetched. */
  again(): void {
    const attempts = [...this.failed];
    this.failed.clear();
    for (const attempt of attempts) attempt();
  }
}
