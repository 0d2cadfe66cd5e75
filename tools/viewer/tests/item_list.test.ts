import { describe, expect, it } from 'vitest';
import { arrange, ItemList } from '../src/item_list';

/** An element, as far as a list uses it. Counts how often it was put into a place. */
class FakeElement {
  children: FakeElement[] = [];
  parent: FakeElement | null = null;
  placed = 0;
  className = '';
  title = '';
  dataset: Record<string, string> = {};
  constructor(readonly text = '') {}
  get childNodes(): FakeElement[] {
    return [...this.children];
  }
  append(child: FakeElement): void {
    this.insertBefore(child, null);
  }
  insertBefore(child: FakeElement, next: FakeElement | null): void {
    child.remove();
    this.children.splice(next ? this.children.indexOf(next) : this.children.length, 0, child);
    child.parent = this;
    ++child.placed;
  }
  remove(): void {
    if (this.parent) this.parent.children = this.parent.children.filter((child) => child !== this);
    this.parent = null;
  }
  replaceChildren(...children: FakeElement[]): void {
    for (const child of [...this.children]) child.remove();
    for (const child of children) this.append(child);
  }
  querySelector = () => this.children[0];
}
const real = <T>(element: FakeElement) => element as unknown as T;

describe('a list that is filled again', () => {
  it('moves only what differs', () => {
    const list = new FakeElement();
    const [a, b, c, d] = ['a', 'b', 'c', 'd'].map((text) => new FakeElement(text));
    const show = (...children: FakeElement[]) => {
      arrange(real(list), children.map((child) => real(child)));
      expect(list.children).toEqual(children);
    };
    show(b, c);
    show(a, b, c);
    show(a, b, c);
    show(a, c);
    show(d, a, c);
    expect([a, b, c, d].map(({ placed }) => placed)).toEqual([1, 1, 1, 1]);
    show(c, a);
    expect(list.children).toEqual([c, a]);
  });

  it('keeps the items of unchanged things, and the buttons of changed ones', () => {
    const list = new FakeElement();
    interface Thing {
      name: string;
      state: string;
    }
    const items = new ItemList<Thing>(() => real(list), ({ name }) => name, ({ name, state }) => {
      const item = new FakeElement(), button = new FakeElement();
      item.append(button);
      item.dataset.state = button.title = state;
      button.append(new FakeElement(`${name} ${state}`));
      return real(item);
    });
    const kendo = { name: 'kendo', state: 'complete' };
    items.show([{ name: 'fight', state: 'recording' }, kendo]);
    const before = list.children.flatMap((item) => [item, item.children[0]]);
    items.show([{ name: 'fight', state: 'complete' }, { ...kendo }]);
    expect(list.children.flatMap((item) => [item, item.children[0]])).toEqual(before);
    expect(before.every((element, n) => element === list.children[n >> 1] || element === list.children[n >> 1].children[0])).toBe(true);
    expect(before.map(({ placed }) => placed)).toEqual([1, 1, 1, 1]);
    const [fight] = list.children;
    expect([fight.dataset.state, fight.children[0].title, fight.children[0].children.map(({ text }) => text)])
      .toEqual(['complete', 'complete', ['fight complete']]);
  });
});
