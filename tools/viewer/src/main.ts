// The viewer page: shows takes, scenes of several takes, and the live picture.
import { Composition } from './composition';
import { parseAddress } from './address';
import { AuxiliaryContent } from './auxiliary_content';
import { ErrorTexts } from './error_texts';
import { factsHtml, FrameMeter, linkText, liveTexts, scanText, sceneFacts } from './facts';
import { bindKeys } from './keys';
import { LookButtons } from './look_buttons';
import { PerformerList } from './performer_list';
import { MotionPanel } from './motion_panel';
import { startWorker } from './page_worker';
import { bindToggle, download, find, press, showStartError } from './page';
import { CONFIDENCE_IN_WORDS, Pictures } from './pictures';
import { Playback } from '../player/src/playback';
import { ProxyChoice } from './proxy_choice';
import { socketUrl } from './reconnecting_socket';
import { fetchText } from './request';
import { fetchRig, type RigCamera } from './rig';
import { RigPanel } from './rig_panel';
import { newScene, parseScene, pictureCount, type SceneFile, setKey, sideBySide, writeScene } from './scene_file';
import { ScenePanel } from './scene_panel';
import { type Look, wantsViews } from './shading';
import { SkeletonPanel } from './skeleton_panel';
import { SoundControl } from './sound_control';
import { Stage } from './stage';
import { SceneList, TakeBrowser } from './take_browser';
import { fetchTakes, type Take } from './take_list';
import { Transport } from './transport';
import type { FromWorker, ShownFrame, ToWorker } from '../player/src/worker_messages';

const TAKES_EVERY_MS = 5000;
const APART_M = 1.5; // between two compared takes

class Viewer {
  private readonly stage: Stage;
  private readonly transport = new Transport();
  private readonly worker = startWorker((message) => this.onMessage(message), (text) => this.errors.set('page: worker', text));
  private takes: Take[] = [];
  private readonly rig = new RigPanel((camera) => this.stand(camera));
  /** The open content: a take, the live picture, or a scene. */
  private open: { take: Take | null; scene: string | null; number: number } | null = null;
  private composition: Composition | null = null;
  private readonly panel: ScenePanel;
  private readonly browser = new TakeBrowser({ open: (name) => this.openTake(name), compare: (name) => this.compare(name) });
  private readonly scenes = new SceneList((name) => this.openScene(name, NaN));
  private readonly pictures: Pictures;
  private playback: Playback | null = null;
  private opened = 0;
  private wanted = -1;
  private shown: ShownFrame | null = null;
  private readonly performers = new PerformerList(find('performers'), () => this.draw());
  private readonly motion: MotionPanel;
  private readonly skeleton: SkeletonPanel;
  private readonly proxy = new ProxyChoice(find('proxy'), () => this.changeFile(this.playback?.pulse ?? this.startAt));
  private readonly errors = new ErrorTexts((text) => {
    find('trouble').textContent = text;
    find('trouble').hidden = text === '';
  });
  private readonly auxiliary = new AuxiliaryContent((item, text) => this.errors.set(item, text));
  private readonly sound = new SoundControl(find('sound'), find('canvas'), this.auxiliary, (text) => this.errors.set('sound', text));
  private readonly looks = new LookButtons((look) => this.setLook(look));
  private readonly meter = new FrameMeter();
  private shownCount = 0;
  private last = 0;

  constructor() {
    this.stage = new Stage(find<HTMLCanvasElement>('canvas'));
    this.stage.onLeave = () => {
      this.rig.mark(null);
      this.pictures.stand(null);
      this.setFollowing(false);
    };
    this.motion = new MotionPanel(this.stage, (message) => this.send(message), () => this.draw(), this.auxiliary);
    this.skeleton = new SkeletonPanel({
      stage: this.stage,
      transport: this.transport,
      auxiliary: this.auxiliary,
      playback: () => (this.open?.take ? this.playback : null),
      redraw: () => this.draw(),
      shows: (performer) => this.performers.shows(performer),
      showMotion: () => this.motion.isOn || this.motion.toggle(),
    });
    this.stage.onTrouble = (text) => this.errors.set('scene: background', text);
    this.stage.onGraphics = (text) => this.errors.set('page: graphics', text);
    this.pictures = new Pictures(this.stage, (tookMs) => this.playback?.ahead(2, tookMs / 1000) ?? [],
      () => this.composition?.viewsState ?? null, () => this.composition?.viewsTrouble ?? '');
    find('confidence-note').textContent = CONFIDENCE_IN_WORDS;
    this.panel = new ScenePanel(find('scene-panel'), {
      change: () => this.sceneChanged(),
      keyHere: () => this.keyHere(),
      seek: (seconds) => this.seekScene(seconds),
      save: () => download(new Blob([writeScene(this.composition!.scene)], { type: 'application/json' }), 'scene.json'),
      takes: () => this.takes.filter((take) => (take.meshes ?? 0) > 0).map((take) => take.name),
      pathOf: (take) => `../${take}`,
    });
    this.bindButtons();
    bindKeys({
      transport: (action) => this.transport.act(action),
      look: (look) => this.looks.choose(look),
      wireframe: () => find('wireframe').click(),
      cameras: () => find('cameras').click(),
      proxy: () => this.proxy.toggle(),
      fly: () => find('fly').click(),
      frameAll: () => this.stage.frameAll(),
      follow: () => this.setFollowing(true),
      stand: (steps) => this.rig.standNext(steps),
      photograph: () => this.pictures.toggle(),
      blend: (by) => this.pictures.step(by),
      help: () => find<HTMLDialogElement>('keys').showModal(),
      motion: () => this.motion.toggle(),
      sound: () => this.sound.toggle(),
      freeze: () => this.motion.toggleFreeze(),
      skeleton: () => this.skeleton.toggle(),
      angles: () => this.skeleton.toggleAngles(),
      similar: () => this.skeleton.toggleSimilar(),
      bend: () => this.skeleton.toggleBend(),
      live: () => this.openLive(),
      flying: () => this.stage.flying,
    });
    find('save-mesh').addEventListener('click', () => void this.performers.save(this.shown));
    this.looks.choose('colour');
    addEventListener('hashchange', () => this.followAddress());
  }

  begin(): void {
    requestAnimationFrame((now) => this.turn(now));
    this.followAddress();
    void this.list();
    setInterval(() => void this.list(), TAKES_EVERY_MS);
  }

  private followAddress(): void {
    const { live, take, pulse, mesh, scene, at } = parseAddress(location.hash);
    if (live) this.openLive();
    else if (!this.listed) return; // the first list follows it
    else if (scene && this.open?.scene !== scene) this.openScene(scene, at);
    else if (scene) this.transport.seek(at * (this.playback?.rate ?? NaN));
    else if (take && this.open?.take?.name !== take) this.openTake(take, pulse, mesh);
    else if (take) this.goTo(pulse, mesh);
  }

  /** Shows a pulse of the open take, or of the other file of it. NaN, null: as it is. */
  private goTo(pulse: number, mesh: string | null): void {
    const { file } = this.proxy;
    this.proxy.open(this.open!.take, mesh);
    this.startAt = Number.isNaN(pulse) ? this.playback?.pulse ?? this.startAt : pulse; // if the file is not read yet
    this.transport.seek(pulse);
    if (this.proxy.file !== file) this.changeFile(this.startAt);
  }

  /** What cannot be listed stays as it was. */
  private async list(): Promise<void> {
    await this.listTakes();
    await this.scenes.list();
    this.markOpen();
  }

  private async listTakes(): Promise<void> {
    try {
      this.takes = await fetchTakes();
    } catch (error) {
      find('takes-note').textContent = (error as Error).message;
      return;
    }
    this.browser.list(this.takes);
    this.auxiliary.again();
    if (this.listed && !this.unknown) return;
    this.listed = true;
    this.followAddress();
  }
  private listed = false;
  /** The address names a take that the last list does not have; a later one may. */
  private unknown = false;

  private send(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private openTake(name: string, pulse = NaN, mesh: string | null = null): void {
    const take = this.takes.find((t) => t.name === name);
    this.unknown = !take;
    if (!take) return this.errors.set('take', `There is no take ${name}.`);
    this.openAs({ take, scene: null }, `take=${name}`, `api/takes/${name}/rig`);
    this.startAt = pulse;
    this.proxy.open(take, mesh);
    this.sendTake(name);
  }
  private startAt = NaN;

  private sendTake(name: string): void {
    this.send({ kind: 'take', take: this.opened, url: new URL(`takes/${name}/${this.proxy.file}`, location.href).href });
  }

  /** Shows the other file of the open take at a pulse. */
  private changeFile(pulse: number): void {
    const name = this.open?.take?.name;
    if (!name) return;
    this.startAt = pulse;
    this.open!.number = ++this.opened;
    this.performers.clear();
    this.wanted = -1;
    this.sendTake(name);
    this.motion.resume();
  }

  private openLive(): void {
    if (this.open && !this.open.take && this.open.scene === null) return;
    this.openAs({ take: null, scene: null }, 'live', 'api/rig');
    this.send({ kind: 'live', take: this.opened, url: socketUrl('api/live') });
  }

  /** A scene of the studio: scene.json in a folder beside the takes. */
  private openScene(name: string, at: number): void {
    const url = new URL(`takes/${encodeURIComponent(name)}/scene.json`, location.href).href;
    this.openAs({ take: null, scene: name }, `scene=${name}`, null);
    this.auxiliary.load(`${name}/scene.json`, () => fetchText(url), (text) => {
      if (text === null) throw new Error('there is no such scene.');
      this.showScene(parseScene(text), at, url);
    });
  }

  /** A file of this computer. Its paths are relative to the takes of the studio. */
  private openFile(file: File): void {
    this.openAs({ take: null, scene: '' }, '', null);
    this.auxiliary.load(file.name, () => file.text(), (text) => {
      this.showScene(parseScene(text));
      find('title').textContent = file.name;
    });
  }

  /** A scene of the open take, with the present view as its camera key. */
  private newScene(): void {
    const { take } = this.open ?? {};
    const seconds = take && this.playback ? (this.playback.last - this.playback.first + 1) / take.rate_hz : 10;
    const scene = newScene(take ?? null, seconds, this.stage.eyeAsKey(0));
    this.openAs({ take: null, scene: '' }, '', null);
    this.showScene(scene);
  }

  /** A scene of the open take and another one beside it, in step. */
  private compare(name: string): void {
    const first = this.open?.take;
    const second = this.takes.find((take) => take.name === name);
    if (!first || !second) return;
    const scene = sideBySide(first, second, this.stage.eyeAsKey(0), APART_M);
    this.openAs({ take: null, scene: '' }, '', null);
    this.showScene(scene);
    this.setFollowing(false);
    this.stage.frameScene();
    find('title').textContent = `${first.name} and ${second.name}`;
  }

  /** `url`: of its file; an unsaved scene is shown as if its folder were beside the takes. */
  private showScene(scene: SceneFile, at = NaN, url = new URL('takes/unsaved/scene.json', location.href).href): void {
    const rateOf = (name: string) => this.takes.find((take) => take.name === name)?.rate_hz ?? null;
    const trouble = (source: string, text: string) => this.errors.set(source, text);
    this.composition = new Composition(this.stage, this.sound.output, scene, url, rateOf, trouble, this.auxiliary);
    this.setScenePlayback(Number.isNaN(at) ? 0 : at);
    this.playback!.playing = Number.isNaN(at);
    this.panel.show(scene);
    this.setFollowing(true);
  }

  private setScenePlayback(seconds: number): void {
    const { scene } = this.composition!;
    const pictures = Array.from({ length: pictureCount(scene) }, (_, n) => ({ pulse: n }));
    this.playback = new Playback(pictures, scene.rate_hz);
    this.seekScene(seconds);
    this.transport.set(this.playback);
  }

  private seekScene(seconds: number): void {
    this.playback?.seek(Math.floor(seconds * this.playback.rate + 1e-6));
  }

  private get sceneSeconds(): number {
    return this.playback ? this.playback.frame / this.playback.rate : 0;
  }

  private sceneChanged(): void {
    const composition = this.composition;
    if (!composition || !this.playback) return;
    const { scene } = composition;
    if (pictureCount(scene) - 1 !== this.playback.last || scene.rate_hz !== this.playback.rate) {
      const playing = this.playback.playing;
      this.setScenePlayback(this.sceneSeconds);
      this.playback.playing = playing;
    }
    composition.apply();
  }

  private keyHere(): void {
    setKey(this.composition!.scene.camera.keys, this.stage.eyeAsKey(this.sceneSeconds));
    this.setFollowing(true);
  }

  private setFollowing(on: boolean): void {
    find('follow').hidden = this.composition === null;
    press(find('follow'), on && this.composition !== null);
    if (!this.composition) return;
    this.composition.following = on;
    if (on) {
      this.composition.setTime(this.sceneSeconds);
      press(find('fly'), false);
    }
  }

  private openAs(what: { take: Take | null; scene: string | null }, address: string, rigUrl: string | null): void {
    const { take, scene } = what;
    this.auxiliary.clear();
    this.errors.clear();
    this.unknown = false;
    this.open = { ...what, number: ++this.opened };
    this.composition?.end();
    this.composition = null;
    this.panel.show(null);
    this.send({ kind: 'nothing' });
    if (location.hash.slice(1).split('&')[0] !== address) history.replaceState(null, '', `#${address}`);
    this.playback = null;
    this.sound.open(take);
    this.shown = null;
    this.performers.clear();
    this.meter.latencyMs = null;
    this.wanted = -1;
    this.transport.set(null);
    this.stage.clear();
    this.proxy.open(null);
    this.pictures.open(take?.name ?? null);
    this.looks.offerViews(true);
    const folder = take && new URL(`takes/${take.name}/`, location.href).href;
    this.motion.open(folder && `${folder}motion.v3d`);
    this.skeleton.open(folder);
    find('title').textContent = take?.name ?? (scene === null ? 'Live' : scene || 'New scene');
    this.markOpen();
    this.showRig([]);
    if (rigUrl !== null) this.auxiliary.load('Cameras', () => fetchRig(rigUrl), (rig) => this.showRig(rig));
  }

  private markOpen(): void {
    this.browser.mark(this.open?.take ?? null);
    for (const button of document.querySelectorAll<HTMLElement>('[data-scene]')) {
      press(button, button.dataset.scene === this.open?.scene);
    }
    const live = this.open !== null && this.open.take === null && this.open.scene === null;
    press(find('open-live'), live);
    if (!live) {
      delete find('open-live').dataset.link;
      find('live-text').textContent = 'live picture of the studio';
    }
  }

  private onMessage(message: FromWorker): void {
    if (message.take !== this.opened) return;
    switch (message.kind) {
      case 'opened': {
        this.errors.set('frames', '');
        if (!this.playback?.isOf(message.pulses)) this.setTakePlayback(message.pulses);
        if (message.tracked) {
          this.motion.setAlone();
          this.pictures.open(null);
        }
        this.looks.offerViews(!message.tracked && !this.proxy.isOn);
        break;
      }
      case 'scan':
        this.errors.set('frames', scanText(this.proxy.file, message.part));
        break;
      case 'trouble':
        this.errors.set('frames', this.proxy.isOn ? `proxy.v3d: ${message.text} Switch Proxy off to see mesh.v3d.` : message.text);
        break;
      case 'link':
        find('open-live').dataset.link = message.link;
        find('live-text').textContent = message.link === 'open' ? 'connected' : 'connecting …';
        this.meter.latencyMs = null;
        this.errors.set('frames', linkText(message.link, this.shown !== null));
        break;
      case 'frame':
        this.show(message.frame);
        break;
      case 'no-surface': break;
      default:
        this.motion.onMessage(message);
    }
  }

  private setTakePlayback(pulses: number[]): void {
    const before = this.playback; // of the other file of the take
    this.playback = new Playback(pulses.map((pulse) => ({ pulse })), this.open?.take?.rate_hz ?? 25);
    this.playback.playing = before?.playing ?? Number.isNaN(this.startAt);
    if (!Number.isNaN(this.startAt)) this.playback.seek(this.startAt);
    this.transport.set(this.playback);
  }

  private show(frame: ShownFrame): void {
    this.shown = frame;
    find('canvas').dataset.shown = String(++this.shownCount);
    this.errors.set('frames', '');
    this.performers.add(frame, frame.live?.take ?? null);
    this.draw();
    this.meter.add(performance.now());
    if (!frame.live) return;
    const { edgeMs } = frame.live;
    requestAnimationFrame(() => { // the refresh that draws the mesh; it is visible from the next one on
      this.send({ kind: 'drawn' });
      if (edgeMs !== null) requestAnimationFrame(() => {
        this.meter.latencyMs = performance.timeOrigin + performance.now() - edgeMs;
        find('canvas').dataset.latency = `${frame.pulse} ${this.meter.latencyMs}`; // for tools/bench/latency
      });
    });
  }

  /** Draws the last frame as the panels want it. */
  private draw(): void {
    if (!this.shown) return;
    this.shown = this.motion.complete(this.shown);
    this.stage.show(this.skeleton.show(this.performers.visible(this.shown)));
    this.pictures.show(this.shown.pulse, this.shown.tracked !== null, this.shown.views);
  }

  private showRig(rig: RigCamera[]): void {
    this.stage.setRig(rig);
    this.rig.show(rig);
  }

  private stand(camera: RigCamera): void {
    this.stage.standAt(camera);
    this.pictures.stand(camera);
    press(find('fly'), false);
  }

  private setLook(look: Look): void {
    this.stage.look = look;
    this.composition?.lookChanged();
    this.send({ kind: 'views', wanted: wantsViews(look) });
    this.pictures.look();
  }

  private bindButtons(): void {
    find('open-live').addEventListener('click', () => this.openLive());
    find('help').addEventListener('click', () => find<HTMLDialogElement>('keys').showModal());
    find('new-scene').addEventListener('click', () => this.newScene());
    find('follow').addEventListener('click', () => this.setFollowing(true));
    const file = find<HTMLInputElement>('scene-file');
    file.addEventListener('change', () => {
      if (file.files?.[0]) this.openFile(file.files[0]);
      file.value = '';
    });
    find('frame-all').addEventListener('click', () => this.stage.frameAll());
    bindToggle('wireframe', () => (this.stage.wireframe = !this.stage.wireframe));
    bindToggle('cameras', () => (this.stage.rigShown = !this.stage.rigShown));
    bindToggle('fly', () => (this.stage.flying = !this.stage.flying));
  }

  private turn(now: number): void {
    requestAnimationFrame((next) => this.turn(next));
    const seconds = Math.min(0.5, (now - this.last) / 1000);
    this.last = now;
    if (this.playback) {
      this.playback.advance(seconds);
      this.sound.follow(this.playback, this.composition, now);
      this.transport.update();
      if (this.playback.frame !== this.wanted) {
        this.wanted = this.playback.frame;
        if (this.composition) this.composition.setTime(this.sceneSeconds);
        else this.send({ kind: 'want', frame: this.wanted });
      }
    }
    this.skeleton.turn(now);
    this.stage.render(seconds);
    find('canvas').dataset.settled = String(this.composition?.settled ?? (this.shown !== null && this.pictures.settled));
    this.stage.placeImageFrame(find('image-frame'), this.rig.standing);
    this.updateFacts(now);
  }

  private factsUpdated = 0;
  private updateFacts(now: number): void {
    if (now - this.factsUpdated < 250) return;
    this.factsUpdated = now;
    this.pictures.updateNotes();
    const frame = this.shown;
    const facts = this.composition && this.playback
      ? sceneFacts(this.sceneSeconds, this.composition.scene.takes.length, this.stage.triangles)
      : frame ? this.meter.facts(frame, now) : [];
    find('facts').innerHTML = factsHtml(facts);
    if (!frame?.live) return;
    const { title, trouble } = liveTexts(frame.live.take, this.meter.ageMs(now));
    find('title').textContent = title;
    this.errors.set('live', find('open-live').dataset.link === 'open' && !this.errors.has('frames') ? trouble : '');
  }
}

try {
  new Viewer().begin();
} catch (error) {
  showStartError(error);
}
