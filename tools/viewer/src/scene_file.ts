// Reader and writer of scene files (docs/scene.md). Pure. tools/v3dctl/scene/scene_file.cc has the same rules and messages.

import { type Field, parseJson, type Vector } from '../player/src/json_field';

export type { Vector };

export interface Placement {
  /** Metres, z up. */
  move: Vector;
  /** Rotation about the world's x, then y, then z. */
  turn_deg: Vector;
  scale: number;
}

export const OUTSIDES = ['hold', 'hide', 'loop'] as const;
export type Outside = (typeof OUTSIDES)[number];

export interface SceneTake extends Placement {
  /** Folder of the take, relative to that of the scene. */
  take: string;
  start_s: number;
  speed: number;
  in_pulse: number | null;
  out_pulse: number | null;
  outside: Outside;
  /** The only performer that is shown; null: all. */
  performer: number | null;
  /** Whether its sound is in a rendered video, how much later than its pictures, and how loud. */
  sound: boolean;
  sound_shift_s: number;
  sound_gain_db: number;
}

export interface SceneModel extends Placement {
  model: string;
}

export interface SceneBackground {
  colour: string;
  /** At most one of these three. */
  image: string;
  video: string;
  sphere: string;
  turn_deg: number;
}

export interface CameraKey {
  at_s: number;
  eye: Vector;
  look: Vector;
  fov_deg: number;
}

export interface SceneFile {
  rate_hz: number;
  seconds: number;
  background: SceneBackground;
  floor: boolean;
  takes: SceneTake[];
  models: SceneModel[];
  camera: { keys: CameraKey[] };
}

/** A take that is added: all of it, as it was recorded. */
export const WHOLE_TAKE = {
  start_s: 0, speed: 1, in_pulse: null, out_pulse: null, outside: 'hold', performer: null,
  sound: true, sound_shift_s: 0, sound_gain_db: 0,
} as const;

const MAX_SECONDS = 36_000;

function readPlace(field: Field): Placement {
  return {
    move: field.find('move')?.vector() ?? [0, 0, 0],
    turn_deg: field.find('turn_deg')?.vector() ?? [0, 0, 0],
    scale: field.find('scale')?.positive() ?? 1,
  };
}

function readOutside(field: Field): Outside {
  const name = field.text() as Outside;
  return OUTSIDES.includes(name) ? name : field.reject('expected hold, hide or loop');
}

function readTake(field: Field): SceneTake {
  field.expectObject(['take', 'move', 'turn_deg', 'scale', 'start_s', 'speed', 'in_pulse', 'out_pulse', 'outside', 'performer',
    'sound', 'sound_shift_s', 'sound_gain_db']);
  const outside = field.find('outside');
  const performer = field.find('performer');
  const take: SceneTake = {
    take: field.at('take').path(),
    ...readPlace(field),
    start_s: field.find('start_s')?.number(-MAX_SECONDS, MAX_SECONDS) ?? 0,
    speed: field.find('speed')?.positive() ?? 1,
    in_pulse: field.find('in_pulse')?.pulse() ?? null,
    out_pulse: field.find('out_pulse')?.pulse() ?? null,
    outside: outside ? readOutside(outside) : 'hold',
    performer: performer ? performer.performer() : null,
    sound: field.find('sound')?.flag() ?? true,
    sound_shift_s: field.find('sound_shift_s')?.number(-10, 10) ?? 0,
    sound_gain_db: field.find('sound_gain_db')?.number(-60, 24) ?? 0,
  };
  if (take.in_pulse !== null && take.out_pulse !== null && take.out_pulse < take.in_pulse) {
    field.at('out_pulse').reject('expected no pulse before in_pulse');
  }
  return take;
}

function readModel(field: Field): SceneModel {
  field.expectObject(['model', 'move', 'turn_deg', 'scale']);
  return { model: field.at('model').path(), ...readPlace(field) };
}

const DARK = '#101216';
export const PLAIN: SceneBackground = { colour: DARK, image: '', video: '', sphere: '', turn_deg: 0 };

function readBackground(field: Field): SceneBackground {
  field.expectObject(['colour', 'image', 'video', 'sphere', 'turn_deg']);
  const background: SceneBackground = {
    colour: field.find('colour')?.colour() ?? DARK,
    image: field.find('image')?.path() ?? '',
    video: field.find('video')?.path() ?? '',
    sphere: field.find('sphere')?.path() ?? '',
    turn_deg: field.find('turn_deg')?.number(-360, 360) ?? 0,
  };
  const pictures = [background.image, background.video, background.sphere].filter(Boolean);
  if (pictures.length > 1) field.reject('expected one of image, video and sphere');
  return background;
}

function readKey(field: Field): CameraKey {
  field.expectObject(['at_s', 'eye', 'look', 'fov_deg']);
  const key: CameraKey = {
    at_s: field.at('at_s').number(0, MAX_SECONDS),
    eye: field.at('eye').vector(),
    look: field.at('look').vector(),
    fov_deg: field.find('fov_deg')?.number(1, 150) ?? 40,
  };
  if (Math.hypot(...key.eye.map((c, n) => key.look[n] - c)) < 1e-3) field.reject('eye and look are the same place');
  return key;
}

function readCamera(field: Field): CameraKey[] {
  field.expectObject(['keys']);
  const keys = field.at('keys');
  const camera: CameraKey[] = [];
  for (const entry of keys.list()) {
    const key = readKey(entry);
    if (camera.length && camera[camera.length - 1].at_s >= key.at_s) {
      entry.at('at_s').reject('expected a time after that of the key before');
    }
    camera.push(key);
  }
  if (camera.length === 0) keys.reject('expected at least one key');
  return camera;
}

/** Parses a scene. The message of a thrown error names the field and the expected value. */
export function parseScene(text: string): SceneFile {
  const field = parseJson(text);
  field.expectObject(['v3d_scene', 'rate_hz', 'seconds', 'background', 'floor', 'takes', 'models', 'camera']);
  const version = field.at('v3d_scene');
  if (version.number(1, 1e6) !== 1) version.reject('this version is not known; expected 1');
  const background = field.find('background');
  return {
    rate_hz: field.find('rate_hz')?.number(1, 240) ?? 25,
    seconds: field.at('seconds').number(0.04, MAX_SECONDS),
    background: background ? readBackground(background) : { ...PLAIN },
    floor: field.find('floor')?.flag() ?? false,
    takes: field.find('takes')?.list().map(readTake) ?? [],
    models: field.find('models')?.list().map(readModel) ?? [],
    camera: { keys: readCamera(field.at('camera')) },
  };
}

/** Writes a scene, rounded to millimetres and milliseconds. Default values are omitted. */
export function writeScene(scene: SceneFile): string {
  const round = (n: number) => Number(n.toFixed(3));
  const vector = (v: Vector) => v.map(round);
  const place = (p: Placement) => ({
    ...(p.move.some(Boolean) && { move: vector(p.move) }),
    ...(p.turn_deg.some(Boolean) && { turn_deg: vector(p.turn_deg) }),
    ...(p.scale !== 1 && { scale: p.scale }),
  });
  const { background } = scene;
  const file = {
    v3d_scene: 1,
    rate_hz: scene.rate_hz,
    seconds: scene.seconds,
    background: {
      colour: background.colour,
      ...(background.image && { image: background.image }),
      ...(background.video && { video: background.video }),
      ...(background.sphere && { sphere: background.sphere }),
      ...(background.turn_deg && { turn_deg: background.turn_deg }),
    },
    floor: scene.floor,
    takes: scene.takes.map((take) => ({
      take: take.take,
      ...place(take),
      ...(take.start_s && { start_s: take.start_s }),
      ...(take.speed !== 1 && { speed: take.speed }),
      ...(take.in_pulse !== null && { in_pulse: take.in_pulse }),
      ...(take.out_pulse !== null && { out_pulse: take.out_pulse }),
      ...(take.outside !== 'hold' && { outside: take.outside }),
      ...(take.performer !== null && { performer: take.performer }),
      ...(!take.sound && { sound: false }),
      ...(take.sound_shift_s && { sound_shift_s: take.sound_shift_s }),
      ...(take.sound_gain_db && { sound_gain_db: take.sound_gain_db }),
    })),
    models: scene.models.map((model) => ({ model: model.model, ...place(model) })),
    camera: {
      keys: scene.camera.keys.map((key) => ({
        at_s: round(key.at_s), eye: vector(key.eye), look: vector(key.look), fov_deg: round(key.fov_deg),
      })),
    },
  };
  // Put vectors of three numbers on one line.
  const text = JSON.stringify(file, null, 2);
  return `${text.replace(/\[\s+([-\d.e]+),\s+([-\d.e]+),\s+([-\d.e]+)\s+\]/g, '[$1, $2, $3]')}\n`;
}

/** Number of pictures of a scene. */
export const pictureCount = (scene: SceneFile) => Math.max(1, Math.floor(scene.seconds * scene.rate_hz + 1e-6));

/** A scene of one take, or of none, with one camera key. */
export function newScene(take: { name: string; rate_hz: number } | null, seconds: number, key: CameraKey): SceneFile {
  return {
    rate_hz: take?.rate_hz ?? 25, seconds, background: { ...PLAIN }, floor: true, models: [],
    takes: take ? [{ take: `../${take.name}`, move: [0, 0, 0], turn_deg: [0, 0, 0], scale: 1,
      ...WHOLE_TAKE }] : [],
    camera: { keys: [key] },
  };
}

/**
 * A scene of two takes in step: both begin at second 0. The second stands `apart` metres beside the first, to the right for
 * the camera `key`. The sound is that of the first, and pulses follow at its rate.
 */
export function sideBySide(first: { name: string; rate_hz: number; seconds: number }, second: { name: string; seconds: number },
  key: CameraKey, apart: number): SceneFile {
  const scene = newScene(first, Math.max(first.seconds, second.seconds), key);
  const [x, y] = [key.look[0] - key.eye[0], key.look[1] - key.eye[1]];
  const scale = apart / (Math.hypot(x, y) || 1);
  const millimetres = (metres: number) => Math.round(1000 * metres) / 1000;
  scene.takes.push({ ...scene.takes[0], take: `../${second.name}`, move: [millimetres(y * scale), millimetres(-x * scale), 0], sound: false });
  return scene;
}

/** Adds a key to a camera path, in place of one at the same time. */
export function setKey(keys: CameraKey[], key: CameraKey): void {
  const at = keys.findIndex((k) => Math.abs(k.at_s - key.at_s) < 1e-3);
  if (at >= 0) keys[at] = key;
  else keys.push(key);
  keys.sort((a, b) => a.at_s - b.at_s);
}
