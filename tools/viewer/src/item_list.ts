// A list of the page that is filled again and again, without changing the elements that a user may be pressing.

/** Makes these the children of an element. Only what differs is moved: an element that stays keeps the focus and a press. */
export function arrange(parent: Element, children: readonly Element[]): void {
  const stay = new Set(children);
  for (const child of [...parent.children]) if (!stay.has(child)) child.remove();
  children.forEach((child, n) => {
    const there = parent.children[n] ?? null;
    if (there !== child) parent.insertBefore(child, there);
  });
}

interface Item {
  /** The thing that it shows. */
  json: string;
  element: HTMLElement;
}

/** Items of things by their names, each with a button first. */
export class ItemList<T> {
  private items = new Map<string, Item>();

  constructor(
    private readonly list: () => Element,
    private readonly nameOf: (thing: T) => string,
    private readonly make: (thing: T) => HTMLElement,
  ) {}

  /** Shows these things. The item of an unchanged one stays; that of a changed one is filled again, and keeps its button. */
  show(things: readonly T[]): void {
    const items = new Map(things.map((thing) => [this.nameOf(thing), this.itemOf(thing)]));
    this.items = items;
    arrange(this.list(), [...items.values()].map(({ element }) => element));
  }

  private itemOf(thing: T): Item {
    const json = JSON.stringify(thing);
    const known = this.items.get(this.nameOf(thing));
    if (known?.json === json) return known;
    const made = this.make(thing);
    if (!known) return { json, element: made };
    const [button, filled] = [known.element, made].map((element) => element.querySelector('button')!);
    button.className = filled.className;
    button.title = filled.title;
    button.replaceChildren(...filled.childNodes);
    Object.assign(known.element.dataset, made.dataset);
    return { json, element: known.element };
  }
}
