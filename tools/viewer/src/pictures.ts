// Photographs and camera views of the open take: the photograph over the view from a camera, and the notes about them on the
// page.
import { find } from './page';
import { bodyOf } from '../player/src/byte_source';
import { type CodedViews, MAX_CAMERAS } from '../player/src/camera_views';
import { PerformerViews, type ViewsState } from './performer_views';
import { PulseStore } from '../player/src/pulse_store';
import { fetchThere } from './request';
import type { RigCamera } from './rig';
import { AGREEING, CONFIDENCE_COLOURS, wantsViews } from './shading';
import type { Stage } from './stage';

/** Opacity of the photograph when it is switched on. */
const HALF = 0.5;

const MAX_PHOTOGRAPH_BYTES = 64 << 20;

function fetchPhotograph(take: string, pulse: number, camera: string, signal: AbortSignal): Promise<ImageBitmap | null> {
  const url = `api/takes/${encodeURIComponent(take)}/photographs/${pulse}/${encodeURIComponent(camera)}.jpg`;
  return fetchThere(url, signal, async (response, progress) => {
    const jpeg = new Blob([await bodyOf(response, MAX_PHOTOGRAPH_BYTES, progress)], { type: 'image/jpeg' });
    return createImageBitmap(jpeg, { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
  });
}

export class Pictures {
  private take: string | null = null;
  private views: PerformerViews | null = null;
  private camera: RigCamera | null = null;
  private photographs: PulseStore<ImageBitmap> | null = null;
  private shown = -1;
  private tracked = false;
  /** Pulse of the photograph over the view; -1: none. */
  private photographed = -1;
  private last = HALF;
  private readonly slider = find<HTMLInputElement>('blend-amount');

  constructor(
    private readonly stage: Stage,
    /** The next pulses in playback, later ones if fetching takes longer; empty when it is paused. */
    private readonly ahead: (tookMs: number) => number[],
    /** The worst state of all takes of the open scene; null without a scene. */
    private readonly sceneState: () => ViewsState | null,
    /** Why the views of the open scene cannot be fetched; ''. */
    private readonly sceneTrouble: () => string,
  ) {
    this.slider.addEventListener('input', () => this.setAmount(Number(this.slider.value) / 100));
    this.slider.addEventListener('change', () => this.slider.blur()); // keys act on the page again
    find('legend-bar').style.background =
      `linear-gradient(to right, ${CONFIDENCE_COLOURS.map((c, n) => `${c} ${(100 * n) / (CONFIDENCE_COLOURS.length - 1)}%`).join(', ')})`;
    this.updateNotes();
  }

  /** Null: no take with photographs is open. */
  open(take: string | null): void {
    this.views?.end();
    this.take = take;
    this.shown = -1;
    this.tracked = false;
    this.views = take === null ? null
      : new PerformerViews(take, this.stage.performer, () => wantsViews(this.stage.look), () => this.stage.redraw());
    this.stand(null);
  }

  /** Sets the camera of the viewpoint; null: none. */
  stand(camera: RigCamera | null): void {
    if (camera && camera === this.camera) return;
    this.camera = camera;
    this.photographs?.end();
    this.photographs = null;
    this.photographed = -1;
    this.stage.photograph.show(null);
    const { take } = this;
    if (camera && take !== null) {
      this.stage.photograph.of(camera);
      this.photographs = new PulseStore<ImageBitmap>({
        fetch: (pulse, signal) => fetchPhotograph(take, pulse, camera.name, signal),
        ready: (pulse) => {
          if (pulse === this.shown) this.lay();
        },
        dispose: (picture) => picture.close(),
      });
    }
    this.lay();
  }

  /**
   * To call when the surface of this pulse is shown. `tracked`: it is no mesh, so that it has no views. `coded`: the views of
   * its compact frame.
   */
  show(pulse: number, tracked: boolean, coded: CodedViews = null): void {
    this.shown = pulse;
    this.tracked = tracked;
    this.views?.show(tracked ? -1 : pulse, tracked ? [] : this.ahead(this.views.tookMs), tracked ? null : coded);
    this.lay();
  }

  /** To call when the look has changed, or playback has started or stopped. */
  look(): void {
    this.views?.apply();
    this.updateNotes();
  }

  toggle(): void {
    this.setAmount(this.amount > 0 ? 0 : this.last);
  }
  step(by: number): void {
    this.setAmount(Math.round(10 * (this.amount + by)) / 10);
  }
  private get amount(): number {
    return this.stage.photograph.amount;
  }
  private setAmount(amount: number): void {
    this.stage.photograph.amount = Math.min(1, Math.max(0, amount));
    if (this.amount > 0) this.last = this.amount;
    this.slider.value = String(Math.round(100 * this.amount));
    this.lay();
  }

  /** True when all photographs and views of the shown pulse are on the stage or do not exist. */
  get settled(): boolean {
    const photograph = !this.photographs || this.amount === 0 || this.photographs.get(this.shown) !== undefined;
    return photograph && (!this.views || this.tracked || !wantsViews(this.stage.look) || this.views.state !== 'coming');
  }

  /** Shows the photograph of the pulse. Until it has arrived, the previous one is shown, with a note. */
  private lay(): void {
    if (this.photographs && this.amount > 0 && this.shown >= 0) {
      this.photographs.want(this.shown, this.ahead(this.photographs.tookMs));
      const picture = this.photographs.get(this.shown);
      if (picture !== undefined) {
        this.photographed = picture ? this.shown : -1;
        this.stage.photograph.show(picture);
      }
    }
    this.stage.redraw();
    this.updateNotes();
  }

  /** Updates the notes about the picture. */
  updateNotes(): void {
    find('blend').hidden = this.camera === null;
    find('blend-note').textContent = this.blendText();
    this.slider.disabled = this.take === null;
    find('legend').hidden = this.stage.look !== 'confidence' || (this.sceneState() ?? this.views?.state) !== 'here';
    const note = this.lookText();
    find('look-note').textContent = note;
    find('look-note').hidden = note === '';
  }

  private blendText(): string {
    if (!this.camera) return '';
    if (this.take === null) return 'Photographs exist for recorded takes only.';
    if (this.amount === 0 || this.shown < 0) return '';
    const here = this.photographs?.get(this.shown);
    if (here === null) return `${this.camera.name} has no photograph at this pulse.`;
    if (here === undefined && this.photographs?.trouble) return `The photograph cannot be fetched: ${this.photographs.trouble}`;
    if (here === undefined) return this.photographed < 0 ? 'The photograph is coming …' : `photograph of pulse ${this.photographed}`;
    return '';
  }

  private lookText(): string {
    if (!wantsViews(this.stage.look)) return '';
    const instead = this.stage.look === 'view' ? 'Colours as from everywhere' : 'Shape alone';
    if (this.tracked) return `${instead}: what each camera sees is known of meshes only. Switch off Motion to see it.`;
    const state = this.sceneState() ?? (this.views && this.shown >= 0 ? this.views.state : null);
    if (state === 'here') return '';
    const trouble = this.sceneState() === null ? (this.views?.trouble ?? '') : this.sceneTrouble();
    if (state === 'coming' && trouble) return `${instead}: what each camera sees cannot be fetched: ${trouble}`;
    if (state === 'coming') return this.ahead(0).length ? '' : `${instead}, until it is known what each camera sees …`;
    if (state === 'too many') return `${instead}: this look supports at most ${MAX_CAMERAS} cameras.`;
    if (state === 'none') return `${instead}: the raw frames, which show what each camera sees, are not on this PC, and the take keeps no colours of cameras.`;
    return this.views ? '' : `${instead}: what each camera sees is known of recorded takes only.`;
  }
}

/** Text for the help dialog. */
export const CONFIDENCE_IN_WORDS =
  'Confidence is the number of cameras that see a point of the surface and agree on its colour: their colours lie within '
  + `${Math.round(255 * AGREEING)} (of 255, in red, green and blue together) of the mean of all cameras that see it. Grey points are `
  + 'seen by no camera: shape and colour are estimates there. A single camera cannot agree with another. Where many cameras agree, '
  + 'the surface is right. Where many see a point and few agree, the true surface lies elsewhere, as in a concavity that no '
  + 'silhouette shows.';
