// Error texts of the page, one for each source. A source replaces only its own text.

export class ErrorTexts {
  private readonly texts = new Map<string, string>();

  /** `show` gets the texts of all sources, a line for each; '' when there is none. It is not called without a change. */
  constructor(private readonly show: (text: string) => void) {}

  /** Sets the text of a source; '': it has no error. */
  set(source: string, text: string): void {
    if ((this.texts.get(source) ?? '') === text) return;
    if (text) this.texts.set(source, text);
    else this.texts.delete(source);
    this.changed();
  }

  has(source: string): boolean {
    return this.texts.has(source);
  }

  /**
   * Removes the texts of all sources whose names begin with `prefix`. Those of the page itself, which begin with "page:", stay when
   * something else is opened.
   */
  clear(prefix = ''): void {
    const sources = [...this.texts.keys()].filter((source) => source.startsWith(prefix) && !source.startsWith('page:'));
    for (const source of sources) this.texts.delete(source);
    if (sources.length) this.changed();
  }

  private changed(): void {
    this.show([...new Set(this.texts.values())].join('\n'));
  }
}
