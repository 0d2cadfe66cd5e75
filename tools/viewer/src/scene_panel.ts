// Panel to edit a scene. Every change modifies the scene object and calls change().
import { Field } from '../player/src/json_field';
import { OUTSIDES, type Outside, type Placement, type SceneFile, type SceneTake, type Vector, WHOLE_TAKE } from './scene_file';

type Change = () => void;

function part<K extends keyof HTMLElementTagNameMap>(name: K, text = '', className = ''): HTMLElementTagNameMap[K] {
  const element = document.createElement(name);
  element.textContent = text;
  element.className = className;
  return element;
}

function labelled(label: string, ...controls: HTMLElement[]): HTMLElement {
  const row = part('label', '', 'field');
  row.append(part('span', label), ...controls);
  return row;
}

function button(text: string, name: string, press: () => void): HTMLButtonElement {
  const made = part('button', text);
  made.dataset.edit = name;
  made.addEventListener('click', press);
  return made;
}

/** A path that the user types, such that parseScene() accepts it. Null: the user cancelled, or was shown why the path is invalid. */
export function askPath(question: string): string | null {
  const file = prompt(question)?.trim();
  if (!file) return null;
  try {
    return new Field(file, '').path();
  } catch (error) {
    alert(`${file}: ${(error as Error).message}`);
    return null;
  }
}

interface Limits {
  step: number;
  min?: number;
  max?: number;
}

const MAX_PULSE = 1e9;

/** A number field. An input outside the limits is reset to the last value. */
function number(name: string, value: number, limits: Limits, set: (value: number) => void): HTMLInputElement {
  const input = part('input');
  Object.assign(input, { type: 'number', step: limits.step, value, min: limits.min ?? '', max: limits.max ?? '' });
  input.dataset.edit = name;
  let last = value;
  input.addEventListener('change', () => {
    const typed = input.valueAsNumber;
    const right = typed >= (limits.min ?? -Infinity) && typed <= (limits.max ?? Infinity);
    if (right) set((last = typed));
    else input.valueAsNumber = last;
  });
  return input;
}

/** A field for a whole number; null when it is empty. */
function wholeNumber(name: string, value: number | null, min: number, max: number, set: (value: number | null) => void): HTMLInputElement {
  const input = part('input');
  Object.assign(input, { type: 'number', step: 1, min, max, value: value ?? '', placeholder: 'all' });
  input.dataset.edit = name;
  input.addEventListener('change', () =>
    set(input.value === '' ? null : Math.min(max, Math.max(min, Math.round(input.valueAsNumber)))));
  return input;
}

function choice(name: string, options: readonly (readonly [string, string])[], value: string, set: (value: string) => void): HTMLSelectElement {
  const select = part('select');
  select.dataset.edit = name;
  for (const [key, text] of options) select.add(new Option(text, key, false, key === value));
  select.addEventListener('change', () => set(select.value));
  return select;
}

function vector(name: string, value: Vector, limits: Limits, change: Change): HTMLElement[] {
  return ['x', 'y', 'z'].map((axis, k) =>
    number(`${name}-${axis}`, value[k], limits, (n) => {
      value[k] = n;
      change();
    }));
}

function placeFields(place: Placement, change: Change): HTMLElement[] {
  return [
    labelled('Move, m', ...vector('move', place.move, { step: 0.05, min: -1e6, max: 1e6 }, change)),
    labelled('Turn, °', ...vector('turn', place.turn_deg, { step: 5, min: -1e6, max: 1e6 }, change)),
    labelled('Scale', number('scale', place.scale, { step: 0.05, min: 0.001, max: 1000 }, (n) => {
      place.scale = n;
      change();
    })),
  ];
}

function takeFields(take: SceneTake, change: Change): HTMLElement[] {
  return [
    ...placeFields(take, change),
    labelled('Starts, s', number('start', take.start_s, { step: 0.04, min: -36000, max: 36000 }, (n) => {
      take.start_s = n;
      change();
    })),
    labelled('Speed', number('speed', take.speed, { step: 0.1, min: 0.001, max: 1000 }, (n) => {
      take.speed = n;
      change();
    })),
    labelled('Pulses',
      wholeNumber('in', take.in_pulse, 0, MAX_PULSE, (n) => {
        take.in_pulse = n;
        if (n !== null && take.out_pulse !== null) take.out_pulse = Math.max(n, take.out_pulse);
        change();
      }),
      wholeNumber('out', take.out_pulse, 0, MAX_PULSE, (n) => {
        take.out_pulse = n === null ? null : Math.max(n, take.in_pulse ?? 0);
        change();
      })),
    labelled('Outside', choice('outside', OUTSIDES.map((o) => [o, o] as const), take.outside, (o) => {
      take.outside = o as Outside;
      change();
    })),
    labelled('Performer', wholeNumber('performer', take.performer, 1, 255, (n) => {
      take.performer = n;
      change();
    })),
  ];
}

function item(title: string, fields: HTMLElement[], remove: () => void): HTMLElement {
  const box = part('details', '', 'item');
  box.append(part('summary', title), ...fields, button('Remove', 'remove', remove));
  return box;
}

export interface SceneActions {
  /** Called after a change of the scene, to show it. */
  change(): void;
  /** Adds the present viewpoint as a key of the camera path, at the shown time. */
  keyHere(): void;
  seek(seconds: number): void;
  save(): void;
  /** Names of takes with meshes, and the path to one from the scene. */
  takes(): string[];
  pathOf(take: string): string;
}

export class ScenePanel {
  constructor(
    private readonly box: HTMLElement,
    private readonly actions: SceneActions,
  ) {}

  /** Shows the panel of a scene; null hides it. */
  show(scene: SceneFile | null): void {
    this.box.hidden = scene === null;
    if (!scene) return this.box.replaceChildren();
    const open = [...this.box.querySelectorAll('details')].map((details) => details.open);
    this.box.replaceChildren(
      part('h2', 'Scene'),
      ...scene.takes.map((take, n) => item(`${take.take.split('/').pop()}`, takeFields(take, () => this.actions.change()),
        () => this.remove(scene, scene.takes, n))),
      ...scene.models.map((model, n) => item(model.model, placeFields(model, () => this.actions.change()),
        () => this.remove(scene, scene.models, n))),
      this.addFields(scene), this.backgroundFields(scene), this.cameraFields(scene), this.wholeFields(scene),
      button('Save scene.json', 'save', () => this.actions.save()));
    [...this.box.querySelectorAll('details')].forEach((details, n) => (details.open = open[n] ?? false));
  }

  private again(scene: SceneFile): void {
    this.actions.change();
    this.show(scene);
  }

  private remove<T>(scene: SceneFile, list: T[], n: number): void {
    list.splice(n, 1);
    this.again(scene);
  }

  private addFields(scene: SceneFile): HTMLElement {
    const takes = this.actions.takes().map((name) => [name, name] as const);
    const fresh = (): Placement => ({ move: [0, 0, 0], turn_deg: [0, 0, 0], scale: 1 });
    const box = part('div', '', 'adds');
    box.append(
      choice('add-take', [['', 'Add a take …'], ...takes], '', (name) => {
        const take = this.actions.pathOf(name);
        scene.takes.push({ take, ...fresh(), ...WHOLE_TAKE });
        this.again(scene);
      }),
      button('Add a model …', 'add-model', () => {
        const file = askPath('File of the model (.glb), from the folder of the scene:');
        if (file === null) return;
        scene.models.push({ model: file, ...fresh() });
        this.again(scene);
      }));
    return box;
  }

  private backgroundFields(scene: SceneFile): HTMLElement {
    const { background } = scene;
    const kinds = ['image', 'video', 'sphere'] as const;
    const kind = kinds.find((k) => background[k]) ?? '';
    const colour = part('input');
    Object.assign(colour, { type: 'color', value: background.colour });
    colour.dataset.edit = 'colour';
    colour.addEventListener('input', () => {
      background.colour = colour.value;
      this.actions.change();
    });
    const texts = [['', 'colour alone'], ['image', 'still picture …'], ['video', 'video …'], ['sphere', 'all directions …']] as const;
    const select = choice('background', texts, kind, (chosen) => {
      const file = chosen ? askPath('File, from the folder of the scene:') : '';
      if (file === null) return this.show(scene); // the list shows the present background again
      for (const k of kinds) background[k] = k === chosen ? file : '';
      this.again(scene);
    });
    const box = part('details', '', 'item');
    box.append(part('summary', 'Background'), labelled('Behind', select), labelled('Colour', colour));
    if (kind) box.append(part('p', background[kind], 'note'));
    if (kind === 'sphere') {
      box.append(labelled('Turn, °', number('background-turn', background.turn_deg, { step: 5, min: -360, max: 360 }, (n) => {
        background.turn_deg = n;
        this.actions.change();
      })));
    }
    return box;
  }

  private cameraFields(scene: SceneFile): HTMLElement {
    const keys = scene.camera.keys;
    const box = part('details', '', 'item');
    box.append(part('summary', `Camera path, ${keys.length} ${keys.length === 1 ? 'key' : 'keys'}`));
    keys.forEach((key, n) => {
      const row = part('div', '', 'field');
      const angle = number('fov', key.fov_deg, { step: 1, min: 1, max: 150 }, (degrees) => {
        key.fov_deg = degrees;
        this.actions.change();
      });
      row.append(button(`${key.at_s.toFixed(2)} s`, 'key', () => this.actions.seek(key.at_s)), angle, part('span', '°'));
      if (keys.length > 1) row.append(button('✕', 'remove-key', () => this.remove(scene, keys, n)));
      box.append(row);
    });
    box.append(button('Key here', 'key-here', () => {
      this.actions.keyHere();
      this.again(scene);
    }));
    return box;
  }

  private wholeFields(scene: SceneFile): HTMLElement {
    const floor = part('input');
    Object.assign(floor, { type: 'checkbox', checked: scene.floor });
    floor.dataset.edit = 'floor';
    floor.addEventListener('change', () => {
      scene.floor = floor.checked;
      this.actions.change();
    });
    const box = part('div');
    box.append(
      labelled('Lasts, s', number('seconds', scene.seconds, { step: 0.5, min: 0.04, max: 36000 }, (n) => {
        scene.seconds = n;
        this.actions.change();
      })),
      labelled('Pictures/s', number('rate', scene.rate_hz, { step: 1, min: 1, max: 240 }, (n) => {
        scene.rate_hz = n;
        this.actions.change();
      })),
      labelled('Floor', floor));
    return box;
  }
}
