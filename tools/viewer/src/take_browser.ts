// The takes of the studio with small pictures, a search field and filters.
import { ItemList } from './item_list';
import { find, press } from './page';
import { ALL_TAKES, passes, scenesOf, type TakeFilter } from './take_filter';
import { fetchScenes, sceneItem, type Take, takeItem } from './take_list';

/** Calls of the browser to its page. */
export interface TakeBrowserPage {
  open(name: string): void;
  /** Shows this take beside the open one. */
  compare(name: string): void;
}

export class TakeBrowser {
  private takes: Take[] = [];
  private filter: TakeFilter = ALL_TAKES;
  /** An unchanged take keeps its picture. */
  private readonly items = new ItemList<Take>(() => find('takes'), ({ name }) => name, (take) => this.itemOf(take));
  private open: Take | null = null;

  constructor(private readonly page: TakeBrowserPage) {
    const read = () => {
      this.filter = {
        words: find<HTMLInputElement>('take-words').value,
        scene: find<HTMLSelectElement>('take-scene').value,
        mark: find<HTMLSelectElement>('take-mark').value as TakeFilter['mark'],
        state: find<HTMLSelectElement>('take-state').value as TakeFilter['state'],
      };
      this.draw();
    };
    for (const id of ['take-words', 'take-scene', 'take-mark', 'take-state']) find(id).addEventListener('input', read);
  }

  /** Lists these takes, the newest first. */
  list(takes: Take[]): void {
    this.takes = takes;
    this.offerScenes();
    this.draw();
  }

  /** Marks the open take; null: none is open. Only takes with meshes are compared. */
  mark(open: Take | null): void {
    this.open = open;
    for (const item of find('takes').children) this.markItem(item as HTMLElement);
  }

  private offerScenes(): void {
    const select = find<HTMLSelectElement>('take-scene');
    const scenes = scenesOf(this.takes);
    if (this.filter.scene && !scenes.includes(this.filter.scene)) scenes.push(this.filter.scene);
    const options = [new Option('all scenes', ''), ...scenes.map((scene) => new Option(`scene ${scene}`, scene))];
    if (options.length === select.options.length && options.every((o, n) => o.value === select.options[n].value)) return;
    select.replaceChildren(...options);
    select.value = this.filter.scene;
  }

  private draw(): void {
    const passing = this.takes.filter((take) => passes(take, this.filter));
    this.items.show(passing);
    this.mark(this.open);
    find('take-filter').hidden = this.takes.length === 0;
    find('takes-note').textContent = this.noteOf(passing.length);
  }

  private noteOf(shown: number): string {
    if (this.takes.length === 0) return 'No takes yet. Record one with v3dctl arm, start and stop.';
    return shown === this.takes.length ? '' : `${shown} of ${this.takes.length} takes`;
  }

  private itemOf(take: Take): HTMLLIElement {
    const item = takeItem(take, (name) => this.page.open(name));
    const picture = document.createElement('img');
    picture.loading = 'lazy';
    picture.alt = '';
    picture.addEventListener('error', () => picture.remove()); // a take without raw frames
    picture.src = `api/takes/${encodeURIComponent(take.name)}/thumbnail.jpg`;
    item.querySelector('button')!.prepend(picture);
    const compare = document.createElement('button');
    compare.className = 'compare';
    compare.dataset.compare = take.name;
    compare.textContent = 'Compare';
    compare.title = 'Show this take beside the open one, in step';
    compare.addEventListener('click', () => this.page.compare(take.name));
    item.append(compare);
    item.dataset.meshes = String(take.meshes ?? 0);
    return item;
  }

  private markItem(item: HTMLElement): void {
    const button = item.querySelector<HTMLElement>('[data-take]')!;
    const isOpen = button.dataset.take === this.open?.name;
    press(button, isOpen);
    const comparable = !isOpen && (this.open?.meshes ?? 0) > 0 && item.dataset.meshes !== '0';
    item.querySelector<HTMLElement>('.compare')!.hidden = !comparable;
  }
}

/** The scenes of the studio; `open` opens one. */
export class SceneList {
  private readonly items: ItemList<string>;

  constructor(open: (name: string) => void) {
    this.items = new ItemList(() => find('scenes'), (name) => name, (name) => sceneItem(name, open));
  }

  /** Lists the scenes. The last list stays, with the reason, when there is no new one. */
  async list(): Promise<void> {
    try {
      this.items.show(await fetchScenes());
      find('scenes-note').textContent = '';
    } catch (error) {
      find('scenes-note').textContent = (error as Error).message;
    }
  }
}
