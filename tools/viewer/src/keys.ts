// Keyboard shortcuts and their list in the help dialog.
import { type Look, LOOKS } from './shading';
import type { Action } from './transport';

export interface KeyActions {
  transport(action: Action): void;
  look(look: Look): void;
  wireframe(): void;
  cameras(): void;
  /** proxy() changes between the meshes and their proxy. */
  proxy(): void;
  fly(): void;
  frameAll(): void;
  stand(steps: number): void;
  /** photograph() switches the photograph over the view; blend() changes its opacity. */
  photograph(): void;
  blend(by: number): void;
  /** motion() switches tracked surfaces on and off, freeze() their texture. */
  motion(): void;
  freeze(): void;
  /** skeleton() draws bones and joints, angles() plots a joint, similar() marks similar poses, bend() bends a joint. */
  skeleton(): void;
  angles(): void;
  similar(): void;
  bend(): void;
  sound(): void;
  live(): void;
  help(): void;
  follow(): void;
  /** While flying, W A S D Q E belong to the fly controls. */
  flying(): boolean;
}

interface Key {
  keys: string[];
  shown: string;
  does: string;
  run(actions: KeyActions, key: string): void;
}

const KEYS: Key[] = [
  { keys: [' ', 'k'], shown: 'Space', does: 'play and pause', run: (d) => d.transport('play') },
  { keys: ['ArrowLeft', 'ArrowRight'], shown: '← →', does: 'a frame back, on',
    run: (d, key) => d.transport(key === 'ArrowLeft' ? 'back' : 'forward') },
  { keys: ['Shift+ArrowLeft', 'Shift+ArrowRight'], shown: 'Shift ← →', does: 'a second back, on',
    run: (d, key) => d.transport(key === 'Shift+ArrowLeft' ? 'second-back' : 'second-on') },
  { keys: ['Home', 'End'], shown: 'Home End', does: 'to the in point, the out point',
    run: (d, key) => d.transport(key === 'Home' ? 'first' : 'last') },
  { keys: ['i', 'o'], shown: 'I O', does: 'in point, out point here', run: (d, key) => d.transport(key === 'i' ? 'in' : 'out') },
  { keys: ['p'], shown: 'P', does: 'play the whole take again', run: (d) => d.transport('clear') },
  { keys: ['l'], shown: 'L', does: 'loop', run: (d) => d.transport('loop') },
  { keys: ['[', ']'], shown: '[ ]', does: 'slower, faster', run: (d, key) => d.transport(key === '[' ? 'slower' : 'faster') },
  { keys: ['1', '2', '3'], shown: '1 2 3', does: 'colour, normals, clay', run: (d, key) => d.look(LOOKS[Number(key) - 1]) },
  { keys: ['4'], shown: '4', does: 'colours for your viewpoint: cameras with a similar direction count most', run: (d) => d.look('view') },
  { keys: ['5'], shown: '5', does: 'confidence: how many cameras see it and agree', run: (d) => d.look('confidence') },
  { keys: ['x'], shown: 'X', does: 'wireframe', run: (d) => d.wireframe() },
  { keys: ['c'], shown: 'C', does: 'show the cameras of the studio', run: (d) => d.cameras() },
  { keys: ['z'], shown: 'Z', does: 'coarser meshes of the proxy, or the full ones', run: (d) => d.proxy() },
  { keys: [',', '.'], shown: ', .', does: 'view from the previous, the next camera',
    run: (d, key) => d.stand(key === ',' ? -1 : 1) },
  { keys: ['b'], shown: 'B', does: "that camera's photograph over the view, or not", run: (d) => d.photograph() },
  { keys: ['-', '+', '='], shown: '- +', does: 'less, more of the photograph', run: (d, key) => d.blend(key === '-' ? -0.1 : 0.1) },
  { keys: ['f'], shown: 'F', does: 'see all of the performer', run: (d) => d.frameAll() },
  { keys: ['v'], shown: 'V', does: 'fly (W A S D, Q E, drag; Shift is faster), or orbit', run: (d) => d.fly() },
  { keys: ['r'], shown: 'R', does: "look along the scene's camera path", run: (d) => d.follow() },
  { keys: ['m'], shown: 'M', does: 'tracked surface of the take, or its meshes', run: (d) => d.motion() },
  { keys: ['t'], shown: 'T', does: 'freeze the texture of the tracked surface, or not', run: (d) => d.freeze() },
  { keys: ['j'], shown: 'J', does: 'bones and joints of the skeleton, or not', run: (d) => d.skeleton() },
  { keys: ['g'], shown: 'G', does: 'plot of the angles of a joint', run: (d) => d.angles() },
  { keys: ['y'], shown: 'Y', does: 'marks of similar poses in the time line', run: (d) => d.similar() },
  { keys: ['h'], shown: 'H', does: 'bend the chosen joint', run: (d) => d.bend() },
  { keys: ['u'], shown: 'U', does: 'sound of the take, or silence', run: (d) => d.sound() },
  { keys: ['0'], shown: '0', does: 'live', run: (d) => d.live() },
  { keys: ['?'], shown: '?', does: 'this list', run: (d) => d.help() },
];

const FLOWN = new Set(['w', 'a', 's', 'd', 'q', 'e']);

function nameOf(event: KeyboardEvent): string {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  return event.shiftKey && key.startsWith('Arrow') ? `Shift+${key}` : key;
}

const PRESSED = ['BUTTON', 'SUMMARY'];
const presses = (key: string) => key === ' ' || key === 'Enter';

/**
 * Whether a key is for the element with the focus, and no shortcut. Space and Enter press a control which the user has reached by
 * the keyboard. After a click it still has the focus, and Space plays.
 */
export function isForElement(key: string, tagName: string, isByKeyboard: boolean): boolean {
  if (tagName === 'INPUT') return true;
  if (tagName === 'SELECT') return presses(key) || key.startsWith('Arrow');
  return presses(key) && isByKeyboard && PRESSED.includes(tagName);
}

/** Whether the focus was moved by the keyboard last, not by a click. */
class FocusOrigin {
  isByKeyboard = false;

  constructor() {
    addEventListener('keydown', (event) => event.key === 'Tab' && (this.isByKeyboard = true), { capture: true });
    addEventListener('pointerdown', () => (this.isByKeyboard = false), { capture: true });
  }
}

export function bindKeys(actions: KeyActions): void {
  const list = document.getElementById('key-list')!;
  for (const key of KEYS) {
    const term = document.createElement('dt');
    term.textContent = key.shown;
    const does = document.createElement('dd');
    does.textContent = key.does;
    list.append(term, does);
  }
  const focus = new FocusOrigin();
  addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || document.querySelector('dialog[open]')) return;
    const name = nameOf(event);
    if (actions.flying() && FLOWN.has(name)) return;
    const element = event.target as HTMLElement;
    if (isForElement(name, element.tagName, focus.isByKeyboard)) return;
    if (presses(name) && PRESSED.includes(element.tagName)) element.blur(); // else the key presses it, too
    const key = KEYS.find((k) => k.keys.includes(name));
    if (!key) return;
    event.preventDefault();
    key.run(actions, name);
  });
}
