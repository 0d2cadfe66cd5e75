// Fly controls: W A S D to move, Q and E for down and up, mouse or finger to turn.
import { PerspectiveCamera, Vector3 } from 'three';
import { takesText } from './page';

const SPEED = 1.6; // metres a second
const FAST_FACTOR = 3; // with Shift
const TURN = 0.0032; // radians for a pixel
const KEYS: Record<string, [number, number, number]> = {
  KeyW: [0, 0, -1], KeyS: [0, 0, 1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyQ: [0, -1, 0], KeyE: [0, 1, 0],
};

export class Fly {
  on = false;
  private readonly held = new Set<string>();
  private turned = false;

  constructor(
    private readonly eye: PerspectiveCamera,
    canvas: HTMLCanvasElement,
  ) {
    addEventListener('keydown', (event) => {
      if (this.on && event.code in KEYS && !takesText(event.target) && !event.ctrlKey && !event.metaKey) this.held.add(event.code);
      if (event.key === 'Shift') this.held.add('Shift');
    });
    addEventListener('keyup', (event) => {
      this.held.delete(event.code);
      if (event.key === 'Shift') this.held.delete('Shift');
    });
    addEventListener('blur', () => this.held.clear());
    canvas.addEventListener('pointermove', (event) => {
      if (this.on && event.buttons === 1) this.turn(event.movementX, event.movementY);
    });
  }

  /** Moves the viewpoint; returns true when it has moved. */
  move(seconds: number): boolean {
    const way = new Vector3();
    for (const code of this.held) if (code in KEYS) way.add(new Vector3(...KEYS[code]));
    const moved = way.lengthSq() > 0;
    if (moved) {
      const metres = SPEED * (this.held.has('Shift') ? FAST_FACTOR : 1) * Math.min(seconds, 0.1);
      this.eye.position.add(way.normalize().applyQuaternion(this.eye.quaternion).multiplyScalar(metres));
    }
    const changed = moved || this.turned;
    this.turned = false;
    return changed;
  }

  /** The point at this distance in front of the viewpoint. */
  ahead(metres: number): Vector3 {
    return new Vector3(0, 0, -metres).applyQuaternion(this.eye.quaternion).add(this.eye.position);
  }

  /** Turns the view and keeps the horizon level. */
  private turn(x: number, y: number): void {
    const ahead = this.ahead(1).sub(this.eye.position);
    const azimuth = Math.atan2(ahead.y, ahead.x) - x * TURN;
    const steepest = Math.PI / 2 - 0.02;
    const height = Math.min(steepest, Math.max(-steepest, Math.asin(Math.min(1, Math.max(-1, ahead.z))) - y * TURN));
    const at = new Vector3(Math.cos(height) * Math.cos(azimuth), Math.cos(height) * Math.sin(azimuth), Math.sin(height));
    this.eye.lookAt(at.add(this.eye.position));
    this.turned = true;
  }
}
