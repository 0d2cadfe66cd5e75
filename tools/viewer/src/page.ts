// Elements of the page.

/** The element with this id. */
export const find = <E extends HTMLElement>(id: string) => document.getElementById(id) as E;

/** Whether an element takes typed text, so that keys are no shortcuts. */
export const takesText = (element: EventTarget | null) => ['INPUT', 'TEXTAREA', 'SELECT'].includes((element as Element | null)?.tagName ?? '');

export const press = (button: Element, on: boolean) => button.setAttribute('aria-pressed', String(on));

/** A click on the button changes a state, which `flip` returns. After a click of a pointer, the canvas has the focus. */
export function bindToggle(id: string, flip: () => boolean): void {
  find(id).addEventListener('click', (event) => {
    press(find(id), flip());
    if (event.detail > 0) find('canvas').focus();
  });
}

/** Buttons that carry their text as data-NAME. */
export function buttonsOf<T>(things: readonly T[], name: string, textOf: (thing: T) => string, click: (thing: T) => void): HTMLElement[] {
  return things.map((thing) => {
    const button = document.createElement('button');
    button.textContent = button.dataset[name] = textOf(thing);
    button.addEventListener('click', () => click(thing));
    return button;
  });
}

/** Reports on the page that it could not start. */
export function showStartError(error: unknown): void {
  const lacks = error instanceof Error && error.message === 'no WebGL 2';
  find('trouble').textContent = lacks
    ? 'This browser has no WebGL 2, which the viewer needs. Browsers since 2021 have it, if the graphics driver supports it.'
    : `The viewer could not start: ${error instanceof Error ? error.message : String(error)}`;
  find('trouble').hidden = false;
}

/** Saves a file as a download of the browser. */
export function download(file: Blob, name: string): void {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(file);
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}
