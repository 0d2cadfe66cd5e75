// Rings around a joint: dragging one turns the joint.
import { type Camera, Object3D, type Scene } from 'three';
import { TransformControls } from 'three/addons/controls/TransformControls.js';
import { inverse, product, type Quaternion } from './pose';

const SIZE = 0.7;

export class BendHandle {
  private readonly controls: TransformControls;
  private readonly joint = new Object3D();
  private rest: Quaternion = [1, 0, 0, 0];

  /** `dragging`: called when a drag begins and ends; `changed`: the rings have to be drawn again. */
  constructor(scene: Scene, eye: Camera, canvas: HTMLElement, dragging: (on: boolean) => void, changed: () => void) {
    this.controls = new TransformControls(eye, canvas);
    this.controls.setMode('rotate');
    this.controls.setSpace('local');
    this.controls.setSize(SIZE);
    scene.add(this.joint, this.controls.getHelper());
    this.controls.addEventListener('dragging-changed', ({ value }) => dragging(value as boolean));
    this.controls.addEventListener('change', changed);
    this.controls.addEventListener('objectChange', () => this.onTurn(this.turn()));
  }

  /** Called while a ring is dragged, with the turn of the joint in its own frame. */
  onTurn: (turn: Quaternion) => void = () => undefined;

  /** Shows the rings at a joint with the rotation `rest` and a turn in its frame. While one is dragged, nothing changes. */
  show(position: readonly number[], rest: Quaternion, turn: Quaternion): void {
    if (this.controls.dragging) return;
    this.rest = rest;
    this.joint.position.set(position[0], position[1], position[2]);
    const [w, x, y, z] = product(rest, turn);
    this.joint.quaternion.set(x, y, z, w);
    this.joint.updateMatrixWorld();
    if (!this.controls.object) this.controls.attach(this.joint);
  }

  hide(): void {
    this.controls.detach();
  }

  /** True while the pointer is on a ring. */
  get isHit(): boolean {
    return this.controls.object !== undefined && this.controls.axis !== null;
  }

  private turn(): Quaternion {
    const { x, y, z, w } = this.joint.quaternion;
    return product(inverse(this.rest), [w, x, y, z]);
  }
}
