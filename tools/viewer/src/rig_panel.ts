// The buttons of the studio's cameras, from which a view can be seen.
import { buttonsOf, find, press } from './page';
import type { RigCamera } from './rig';

export class RigPanel {
  private rig: RigCamera[] = [];
  private name: string | null = null;

  /** `stand` moves the view to a camera. */
  constructor(private readonly stand: (camera: RigCamera) => void) {}

  /** The camera at which the view stands. */
  get standing(): string | null {
    return this.name;
  }

  show(rig: RigCamera[]): void {
    this.rig = rig;
    find('rig-head').hidden = rig.length === 0;
    find('rig').replaceChildren(...buttonsOf(rig, 'camera', ({ name }) => name, (camera) => this.standAt(camera)));
  }

  /** Stands at the camera that is so many places after the present one. */
  standNext(steps: number): void {
    if (this.rig.length === 0) return;
    const at = this.rig.findIndex((camera) => camera.name === this.name);
    const from = at < 0 && steps < 0 ? 0 : at;
    this.standAt(this.rig[(from + steps + this.rig.length) % this.rig.length]);
  }

  /** Marks the camera at which the view stands; null: it stands at none. */
  mark(name: string | null): void {
    this.name = name;
    for (const button of find('rig').children) press(button, (button as HTMLElement).dataset.camera === name);
  }

  private standAt(camera: RigCamera): void {
    this.stand(camera);
    this.mark(camera.name);
  }
}
