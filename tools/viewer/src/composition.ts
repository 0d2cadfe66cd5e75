// A scene on the stage: a worker for each take, models and the backdrop, shown at one time.
import { type BufferGeometry, Group, Mesh, MeshBasicMaterial, MeshLambertMaterial, type Material, type MeshStandardMaterial } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { entryAt } from '../player/src/mesh_file';
import { type AuxiliaryContent, repeatable } from './auxiliary_content';
import { startWorker } from './page_worker';
import { type Performer, place } from './performer';
import { PerformerViews, takeOfMeshes, type ViewsState } from './performer_views';
import { cameraAt, pulseAt, soundAt } from './scene_clock';
import type { SceneFile, SceneModel, SceneTake } from './scene_file';
import { wantsViews } from './shading';
import { fetchSound } from './sound_file';
import { type SoundOutput, SoundPlayer } from './sound_player';
import type { Stage } from './stage';
import { completed, indicesOfOne } from '../player/src/surface';
import type { ShownFrame, ToWorker, TrackedSegment } from '../player/src/worker_messages';

/** A take of the scene, fetched and decoded in its own worker. */
class Actor {
  readonly performer: Performer;
  private readonly worker: Worker;
  private readonly views: PerformerViews;
  private entries: { pulse: number }[] = [];
  private wanted = -1;
  private seconds = 0;
  private playing = false;
  private frame: ShownFrame | null = null;
  private segment: TrackedSegment | null = null;
  private sound: SoundPlayer | null = null;
  private ended = false;

  constructor(
    private readonly stage: Stage,
    output: SoundOutput,
    readonly take: SceneTake,
    readonly url: string,
    readonly rate: number,
    private readonly changed: () => void,
    trouble: (source: string, text: string) => void,
    auxiliary: AuxiliaryContent,
  ) {
    this.performer = stage.addPerformer();
    this.views = new PerformerViews(takeOfMeshes(url), this.performer, () => wantsViews(stage.look), changed);
    this.worker = startWorker((message) => {
      if (message.kind === 'opened') this.entries = message.pulses.map((pulse) => ({ pulse }));
      else if (message.kind === 'trouble' || message.kind === 'motion-trouble') trouble(`scene: ${url}`, `${take.take}: ${message.text}`);
      else if (message.kind === 'segment') this.segment = message.segment;
      else if (message.kind === 'frame') {
        const { frame } = message;
        trouble(`scene: ${url}`, '');
        this.frame = frame.tracked && this.segment ? completed(frame, this.segment) : frame;
        this.show();
      }
      changed();
    }, (text) => trouble('page: worker', text));
    this.send({ kind: 'views', wanted: wantsViews(stage.look) });
    this.send({ kind: 'take', take: 0, url });
    auxiliary.load(`sound of ${take.take}`, () => fetchSound(takeOfMeshes(url)), (sources) => {
      if (sources.length && !this.ended) this.sound = new SoundPlayer(output, sources, rate, (text) => trouble(`sound files of ${url}`, text));
    });
  }

  get hasSound(): boolean {
    return this.sound !== null;
  }

  /** To call for every picture; `seconds`: the exact time of the scene at `now`. */
  playSound(seconds: number, playing: boolean, speed: number, now: number): void {
    const { sound, take, entries } = this;
    if (!sound || entries.length === 0) return;
    const at = soundAt(take, this.rate, entries[0].pulse, entries[entries.length - 1].pulse, seconds);
    sound.gain = 10 ** (take.sound_gain_db / 20);
    sound.follow({ exact: 0, outPulse: 0, ...at, playing: playing && take.sound && at !== null, speed: speed * take.speed }, now);
  }

  /** Number of the shown frame; -1: none. */
  get shown(): number {
    return this.frame?.number ?? -1;
  }

  /** Shows the last frame; to call when another performer is wanted. */
  show(): void {
    if (!this.frame) return;
    const { performer } = this.take;
    const indices = performer === null ? this.frame.indices : indicesOfOne(this.frame, performer);
    this.shownPerformer = performer;
    this.stage.show({ ...this.frame, indices }, this.performer);
    this.views.show(this.frame.tracked ? -1 : this.frame.pulse, this.next(), this.frame.views);
  }
  private shownPerformer: number | null = null;

  /** To call after a change of the scene. */
  apply(): void {
    place(this.performer.mesh, this.take);
    if (this.shownPerformer !== this.take.performer) this.show();
  }

  private send(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  /** The next pulses in playback, after the time that fetching takes. */
  private next(): number[] {
    if (!this.playing) return [];
    const skip = Math.ceil((this.views.tookMs / 1000) * this.rate * this.take.speed);
    return this.entries.slice(this.shown + Math.max(1, skip)).slice(0, 2).map(({ pulse }) => pulse);
  }

  /** Null: the look needs no camera views. */
  get viewsState(): ViewsState | null {
    return wantsViews(this.stage.look) && this.performer.mesh.visible && !this.frame?.tracked ? this.views.state : null;
  }

  /** Why the camera views cannot be fetched; ''. */
  get viewsTrouble(): string {
    return this.viewsState === 'coming' ? this.views.trouble : '';
  }

  lookChanged(): void {
    this.send({ kind: 'views', wanted: wantsViews(this.stage.look) });
    this.views.apply();
  }

  /** Shows the given time. Returns true when all of it is on the stage. */
  setTime(seconds: number): boolean {
    this.playing = seconds > this.seconds;
    this.seconds = seconds;
    if (this.entries.length === 0) return false;
    const last = this.entries[this.entries.length - 1].pulse;
    const pulse = pulseAt(this.take, this.rate, this.entries[0].pulse, last, seconds);
    this.performer.mesh.visible = pulse !== null && this.shown >= 0;
    if (pulse === null) return true;
    const frame = entryAt(this.entries, pulse);
    if (frame !== this.wanted) this.send({ kind: 'want', frame: (this.wanted = frame) });
    return this.shown === frame && this.viewsState !== 'coming';
  }

  end(): void {
    this.ended = true;
    this.sound?.end();
    this.worker.terminate();
    this.views.end();
    this.stage.removePerformer(this.performer);
    this.changed();
  }
}

/** Uses the light of the stage only and removes gloss, as the native renderer does. */
function plain(material: Material): Material {
  if (material instanceof MeshBasicMaterial) return material;
  const { map, color, vertexColors, side } = material as MeshStandardMaterial;
  return new MeshLambertMaterial({ map, color, vertexColors, side });
}

async function loadModel(url: string): Promise<Group> {
  const { scene } = await new GLTFLoader().loadAsync(url);
  scene.traverse((node) => {
    if (node instanceof Mesh) node.material = Array.isArray(node.material) ? node.material.map(plain) : plain(node.material as Material);
  });
  scene.rotation.x = Math.PI / 2; // glTF has y up
  const model = new Group();
  model.add(scene);
  return model;
}

/** Frees its buffers on the graphics card. */
function disposeOf(model: Group): void {
  model.traverse((node) => {
    if (!(node instanceof Mesh)) return;
    (node.geometry as BufferGeometry).dispose();
    for (const material of [node.material].flat() as MeshLambertMaterial[]) {
      material.map?.dispose();
      material.dispose();
    }
  });
}

interface ShownModel {
  url: string;
  /** Source of its errors. */
  item: string;
  /** Null: it has not arrived, or there is none. */
  group: Group | null;
  /** It has arrived, or there is none. */
  settled: boolean;
}

export class Composition {
  private actors = new Map<SceneTake, Actor>();
  private models = new Map<SceneModel, ShownModel>();
  /** Sources of the errors of takes. */
  private sources = new Set<string>();
  private seconds = 0;
  private ended = false;
  /** True when everything of the present time is on the stage. */
  settled = false;
  /** True when the viewpoint follows the camera path. */
  following = true;

  constructor(
    private readonly stage: Stage,
    private readonly output: SoundOutput,
    readonly scene: SceneFile,
    /** URL of the scene file. */
    readonly base: string,
    /** Pulses per second of the take with this name; null: there is no such take. */
    private readonly rateOf: (take: string) => number | null,
    /** Shows the error of a source, which begins with "scene", "sound" or "page:"; '' removes it. */
    private readonly trouble: (source: string, text: string) => void,
    private readonly auxiliary: AuxiliaryContent,
  ) {
    this.apply();
  }

  private url(file: string): string {
    return new URL(file, this.base).href;
  }

  /** To call after every change of the scene. */
  apply(): void {
    const { scene, stage } = this;
    for (const [take, actor] of this.actors) {
      if (scene.takes.includes(take) && actor.url === this.url(`${take.take}/mesh.v3d`)) continue;
      actor.end();
      this.actors.delete(take);
    }
    for (const take of scene.takes) {
      if (!this.actors.has(take)) this.begin(take);
      this.actors.get(take)?.apply();
    }
    stage.floorShown = scene.floor;
    stage.backdrop.set(scene.background, (file) => this.url(file), this.auxiliary);
    this.applyModels();
    this.clearErrorsOfRemoved();
    this.setTime(this.seconds);
  }

  private clearErrorsOfRemoved(): void {
    const sources = new Set(this.scene.takes.map((take) => `scene: ${this.url(`${take.take}/mesh.v3d`)}`));
    for (const source of this.sources) if (!sources.has(source)) this.trouble(source, '');
    this.sources = sources;
  }

  lookChanged(): void {
    for (const actor of this.actors.values()) actor.lookChanged();
    this.setTime(this.seconds);
  }

  /** The worst state of all takes on the stage. */
  get viewsState(): ViewsState {
    const states = [...this.actors.values()].map((actor) => actor.viewsState);
    return (['too many', 'none', 'coming'] as const).find((state) => states.includes(state)) ?? 'here';
  }

  /** Why the camera views of a take cannot be fetched; ''. */
  get viewsTrouble(): string {
    return [...this.actors.values()].map((actor) => actor.viewsTrouble).find(Boolean) ?? '';
  }

  private begin(take: SceneTake): void {
    const url = this.url(`${take.take}/mesh.v3d`);
    const name = takeOfMeshes(url);
    const rate = this.rateOf(name);
    if (rate === null) return this.trouble(`scene: ${url}`, `There is no take ${name}.`);
    this.actors.set(take, new Actor(this.stage, this.output, take, url, rate, () => this.setTime(this.seconds), this.trouble, this.auxiliary));
  }

  get hasSound(): boolean {
    return [...this.actors.values()].some((actor) => actor.hasSound);
  }

  /** To call for every picture; `seconds`: the exact time of the scene at `now`. */
  playSound(seconds: number, playing: boolean, speed: number, now: number): void {
    for (const actor of this.actors.values()) actor.playSound(seconds, playing, speed, now);
  }

  private applyModels(): void {
    const { models } = this.scene;
    for (const [model, shown] of this.models) {
      if (models.includes(model) && shown.url === this.url(model.model)) continue;
      this.models.delete(model);
      this.trouble(shown.item, '');
      if (shown.group) disposeOf(shown.group);
    }
    for (const model of models) if (!this.models.has(model)) this.beginModel(model);
    this.showModels();
  }

  private beginModel(model: SceneModel): void {
    const url = this.url(model.model);
    const shown: ShownModel = { url, item: `Model ${model.model}`, group: null, settled: false };
    this.models.set(model, shown);
    const isLate = () => this.models.get(model) !== shown;
    const load = repeatable(() => loadModel(url), url, isLate);
    this.auxiliary.load(shown.item, async () => {
      const group = await load();
      if (!group || !isLate()) return group;
      disposeOf(group);
      return null;
    }, (group) => {
      if (isLate()) return;
      Object.assign(shown, { group, settled: true });
      if (!group) this.trouble(shown.item, `The model ${model.model} does not exist or is not a glTF file.`);
      this.showModels();
      this.setTime(this.seconds);
    });
  }

  /** Shows the models that have arrived. */
  private showModels(): void {
    const groups: Group[] = [];
    for (const [model, { group }] of this.models) {
      if (!group) continue;
      place(group, model);
      groups.push(group);
    }
    this.stage.setModels(groups);
  }

  setTime(seconds: number): void {
    if (this.ended) return;
    this.seconds = seconds;
    const there = [...this.actors.values()].map((actor) => actor.setTime(seconds));
    this.settled = there.every(Boolean) && [...this.models.values()].every(({ settled }) => settled);
    this.stage.backdrop.setTime(seconds);
    if (this.following) this.stage.follow(cameraAt(this.scene.camera.keys, seconds));
    this.stage.redraw();
  }

  end(): void {
    this.ended = true;
    for (const actor of this.actors.values()) actor.end();
    this.actors.clear();
    for (const { group } of this.models.values()) if (group) disposeOf(group);
    this.models.clear(); // those that arrive later are late
  }
}
