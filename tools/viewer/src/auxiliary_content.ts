// Auxiliary content of the open take or scene: items that are fetched beside its frames, such as sound and cameras.
import { Refusal } from './request';

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
