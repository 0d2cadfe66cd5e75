// The buttons that choose the look of the surface.
import { press } from './page';
import { type Look, LOOKS, wantsViews } from './shading';

const buttonOf = (look: Look) => document.querySelector<HTMLElement>(`[data-look=${look}]`)!;

export class LookButtons {
  private look: Look = 'colour';

  /** `chosen`: called with each chosen look. */
  constructor(private readonly chosen: (look: Look) => void) {
    for (const look of LOOKS) buttonOf(look).addEventListener('click', () => this.choose(look));
  }

  /** A look that is not offered is not chosen. */
  choose(look: Look): void {
    if (buttonOf(look).hidden) return;
    this.look = look;
    for (const each of LOOKS) press(buttonOf(each), each === look);
    this.chosen(look);
  }

  /** Whether looks that need the views of cameras are offered: takes without meshes have none. */
  offerViews(on: boolean): void {
    for (const look of LOOKS.filter(wantsViews)) buttonOf(look).hidden = !on;
    if (!on && wantsViews(this.look)) this.choose('colour');
  }
}
