// The viewer: takes and the live picture, on one stage.
import { bindKeys } from './keys';
import { Playback } from './playback';
import { fetchRig, type RigCamera } from './rig';
import { type Look, Stage } from './stage';
import { fetchTakes, formatBytes, type Take, takeItem } from './take_list';
import { Transport } from './transport';
import type { FromWorker, ShownFrame, ToWorker } from './worker_messages';

const find = <E extends HTMLElement>(id: string) => document.getElementById(id) as E;
const press = (button: Element, on: boolean) => button.setAttribute('aria-pressed', String(on));

const TAKES_EVERY_MS = 5000;

class Viewer {
  private readonly stage: Stage;
  private readonly transport = new Transport();
  private readonly worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module' });
  private takes: Take[] = [];
  private rig: RigCamera[] = [];
  /** What is open: the name of a take, or live. */
  private open: { take: Take | null; number: number } | null = null;
  private playback: Playback | null = null;
  private opened = 0;
  private wanted = -1;
  private shown: ShownFrame | null = null;
  private shownTimes: number[] = [];
  private latency: number | null = null;
  private last = 0;

  constructor() {
    this.stage = new Stage(find<HTMLCanvasElement>('canvas'));
    this.stage.onLeave = () => this.markStanding(null);
    this.worker.onmessage = (event: MessageEvent<FromWorker>) => this.hear(event.data);
    this.bindButtons();
    bindKeys({
      transport: (action) => this.transport.act(action),
      look: (look) => this.setLook(look),
      wireframe: () => find('wireframe').click(),
      cameras: () => find('cameras').click(),
      fly: () => find('fly').click(),
      frameAll: () => this.stage.frameAll(),
      stand: (steps) => this.standNext(steps),
      help: () => find<HTMLDialogElement>('keys').showModal(),
      live: () => this.openLive(),
      flying: () => this.stage.flying,
    });
    this.setLook('colour');
    addEventListener('hashchange', () => this.followAddress());
  }

  async begin(): Promise<void> {
    requestAnimationFrame((now) => this.turn(now));
    await this.listTakes();
    this.followAddress();
    setInterval(() => this.listTakes(), TAKES_EVERY_MS);
  }

  /** #live, #take=kendo-07, #take=kendo-07&pulse=12 */
  private followAddress(): void {
    const wish = new URLSearchParams(location.hash.slice(1));
    const name = wish.get('take');
    if (wish.has('live')) this.openLive();
    else if (name && this.open?.take?.name !== name) this.openTake(name, Number(wish.get('pulse') ?? NaN));
  }

  private async listTakes(): Promise<void> {
    const note = find('takes-note');
    try {
      this.takes = await fetchTakes();
      note.textContent = this.takes.length ? '' : 'No takes yet. v3dctl arm, start and stop make one.';
    } catch {
      note.textContent = 'The studio does not answer. Is v3d-viewd running?';
      return;
    }
    find('takes').replaceChildren(...this.takes.map((take) => takeItem(take, (name) => this.openTake(name))));
    this.markOpen();
  }

  private send(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private openTake(name: string, pulse = NaN): void {
    const take = this.takes.find((t) => t.name === name);
    if (!take) return this.trouble(`There is no take ${name}.`);
    this.openAs(take, `take=${name}`, `api/takes/${name}/rig`);
    this.startAt = pulse;
    this.send({ kind: 'take', take: this.opened, url: new URL(`takes/${name}/mesh.v3d`, location.href).href });
  }
  private startAt = NaN;

  private openLive(): void {
    if (this.open && !this.open.take) return;
    this.openAs(null, 'live', 'api/rig');
    const url = new URL('api/live', location.href);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    this.send({ kind: 'live', take: this.opened, url: url.href });
  }

  private openAs(take: Take | null, address: string, rigUrl: string): void {
    this.open = { take, number: ++this.opened };
    if (location.hash.slice(1).split('&')[0] !== address) history.replaceState(null, '', `#${address}`);
    this.playback = null;
    this.shown = null;
    this.latency = null;
    this.wanted = -1;
    this.transport.set(null);
    this.stage.clear();
    this.trouble('');
    find('title').textContent = take?.name ?? 'Live';
    this.markOpen();
    const number = this.opened;
    fetchRig(rigUrl).then((rig) => {
      if (number === this.opened) this.setRig(rig);
    });
  }

  private markOpen(): void {
    for (const button of document.querySelectorAll<HTMLElement>('[data-take]')) {
      press(button, button.dataset.take === this.open?.take?.name);
    }
    press(find('open-live'), this.open !== null && this.open.take === null);
    if (this.open?.take !== null) {
      delete find('open-live').dataset.link;
      find('live-text').textContent = 'what the studio sees now';
    }
  }

  private trouble(text: string): void {
    find('trouble').textContent = text;
    find('trouble').hidden = text === '';
  }

  private hear(message: FromWorker): void {
    if (message.take !== this.opened) return;
    switch (message.kind) {
      case 'opened': {
        const rate = this.open?.take?.rate_hz ?? 25;
        this.playback = new Playback(message.pulses.map((pulse) => ({ pulse })), rate);
        if (Number.isNaN(this.startAt)) this.playback.playing = true;
        else this.playback.seek(this.startAt);
        this.transport.set(this.playback);
        break;
      }
      case 'trouble':
        this.trouble(message.text);
        break;
      case 'link':
        find('open-live').dataset.link = message.link;
        find('live-text').textContent = message.link === 'open' ? 'connected' : 'connecting …';
        if (!this.shown) {
          this.trouble(message.link === 'open' ? 'Nothing is recorded at the moment. Meshes show here as soon as pulses run.'
            : 'The studio does not answer. Trying again every second.');
        }
        break;
      case 'frame':
        this.show(message.frame);
        break;
    }
  }

  private show(frame: ShownFrame): void {
    this.shown = frame;
    this.trouble('');
    this.stage.show(frame);
    this.shownTimes.push(performance.now());
    if (frame.live?.edgeMs != null) {
      // Drawn at the next refresh of the screen: that is when the pulse is seen.
      requestAnimationFrame(() => (this.latency = performance.timeOrigin + performance.now() - frame.live!.edgeMs!));
    }
  }

  private setRig(rig: RigCamera[]): void {
    this.rig = rig;
    this.stage.setRig(rig);
    find('rig-head').hidden = rig.length === 0;
    find('rig').replaceChildren(...rig.map((camera) => {
      const button = document.createElement('button');
      button.textContent = camera.name;
      button.dataset.camera = camera.name;
      button.addEventListener('click', () => this.stand(camera));
      return button;
    }));
  }

  private stand(camera: RigCamera): void {
    this.stage.standAt(camera);
    press(find('fly'), false);
    this.markStanding(camera.name);
  }

  private standNext(steps: number): void {
    if (this.rig.length === 0) return;
    const at = this.rig.findIndex((camera) => camera.name === this.standing);
    const from = at < 0 && steps < 0 ? 0 : at;
    this.stand(this.rig[(from + steps + this.rig.length) % this.rig.length]);
  }

  private standing: string | null = null;
  private markStanding(name: string | null): void {
    this.standing = name;
    for (const button of find('rig').children) press(button, (button as HTMLElement).dataset.camera === name);
  }

  private setLook(look: Look): void {
    this.stage.look = look;
    for (const button of document.querySelectorAll<HTMLElement>('[data-look]')) press(button, button.dataset.look === look);
  }

  private bindButtons(): void {
    find('open-live').addEventListener('click', () => this.openLive());
    find('help').addEventListener('click', () => find<HTMLDialogElement>('keys').showModal());
    find('frame-all').addEventListener('click', () => this.stage.frameAll());
    for (const button of document.querySelectorAll<HTMLElement>('[data-look]')) {
      button.addEventListener('click', () => this.setLook(button.dataset.look as Look));
    }
    const toggle = (id: string, flip: () => boolean) =>
      find(id).addEventListener('click', () => {
        press(find(id), flip());
        find('canvas').focus();
      });
    toggle('wireframe', () => (this.stage.wireframe = !this.stage.wireframe));
    toggle('cameras', () => (this.stage.rigShown = !this.stage.rigShown));
    toggle('fly', () => (this.stage.flying = !this.stage.flying));
  }

  private turn(now: number): void {
    requestAnimationFrame((next) => this.turn(next));
    const seconds = Math.min(0.5, (now - this.last) / 1000);
    this.last = now;
    if (this.playback) {
      this.playback.advance(seconds);
      this.transport.update();
      if (this.playback.frame !== this.wanted) {
        this.wanted = this.playback.frame;
        this.send({ kind: 'want', frame: this.wanted });
      }
    }
    this.stage.render(seconds);
    this.placeImageFrame();
    this.tellFacts(now);
  }

  private placeImageFrame(): void {
    const image = this.stage.imageFrame();
    const frame = find('image-frame');
    frame.hidden = image === null;
    if (!image) return;
    for (const side of ['left', 'top', 'width', 'height'] as const) frame.style[side] = `${image[side]}px`;
    frame.firstElementChild!.textContent = this.standing;
  }

  private toldFacts = 0;
  private tellFacts(now: number): void {
    if (now - this.toldFacts < 250) return;
    this.toldFacts = now;
    while (this.shownTimes.length && this.shownTimes[0] < now - 2000) this.shownTimes.shift();
    const frame = this.shown;
    const facts: string[] = [];
    if (frame) {
      facts.push(`pulse <b>${frame.pulse}</b>`, `${(frame.indices.length / 3).toLocaleString('en')} triangles`, formatBytes(frame.bytes));
      const perSecond = this.shownTimes.length / 2;
      if (perSecond > 0) facts.push(`<b>${perSecond.toFixed(0)}</b>/s`);
      if (!Number.isNaN(frame.quality)) facts.push(`quality ${(100 * frame.quality).toFixed(0)} %`);
    }
    if (frame?.live) {
      if (this.latency !== null) facts.push(`<b>${this.latency.toFixed(0)} ms</b> behind the pulse`);
      if (frame.live.missing.length) facts.push(`without ${frame.live.missing.length} cameras`);
      if (frame.live.skipped) facts.push(`${frame.live.skipped} skipped`);
    }
    find('facts').innerHTML = facts.join(' &nbsp; '); // numbers only: nothing that came from outside
    if (frame?.live) find('title').textContent = `Live: ${frame.live.take}`;
  }
}

try {
  void new Viewer().begin();
} catch (error) {
  const trouble = find('trouble');
  const lacks = error instanceof Error && error.message === 'no WebGL 2';
  trouble.textContent = lacks
    ? 'This browser has no WebGL 2, which the viewer draws with. Any browser since 2021 has it, where the graphics driver allows it.'
    : `The viewer could not begin: ${error instanceof Error ? error.message : String(error)}`;
  trouble.hidden = false;
}
