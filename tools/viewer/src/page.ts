// Elements of the page.

/** The element with this id. */
export const find = <E extends HTMLElement>(id: string) => document.getElementById(id) as E;

export const press = (button: Element, on: boolean) => button.setAttribute('aria-pressed', String(on));

/** Buttons that carry their text as data-NAME. */
export function buttonsOf<T>(things: readonly T[], name: string, textOf: (thing: T) => string, click: (thing: T) => void): HTMLElement[] {
  return things.map((thing) => {
    const button = document.createElement('button');
    button.textContent = button.dataset[name] = textOf(thing);
    button.addEventListener('click', () => click(thing));
    return button;
  });
}

/** Saves a file as a download of the browser. */
export function download(file: Blob, name: string): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
