// The stage: the mesh, the floor, the studio's cameras, and the eye that looks at them.
import {
  BufferAttribute, BufferGeometry, Color, DoubleSide, GridHelper, GLSL3, LineBasicMaterial, LineSegments, Matrix4, Mesh,
  PerspectiveCamera, Scene, ShaderMaterial, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { Fly } from './fly';
import { imageOnScreen, projectionOf, worldFromCamera, type RigCamera } from './rig';
import type { Surface } from './surface';

export type Look = 'colour' | 'normals' | 'clay';
const LOOKS: Look[] = ['colour', 'normals', 'clay'];

const NEAR = 0.02;
const FAR = 200;
const BACKGROUND = new Color(0x101216);

// Colours are shown as they are, to the byte: they are sRGB, and so is the screen.
const vertexShader = `
in vec3 tint;
out vec3 vTint; out vec3 vNormal; out vec3 vToEye;
void main() {
  vTint = tint;
  vNormal = normal;
  vToEye = cameraPosition - position;
  gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
}`;
const fragmentShader = `
precision highp float;
uniform int look;
in vec3 vTint; in vec3 vNormal; in vec3 vToEye;
out vec4 colour;
void main() {
  vec3 n = normalize(vNormal);
  if (look == 0) colour = vec4(vTint, 1.0);
  else if (look == 1) colour = vec4(0.5 + 0.5 * n, 1.0);
  else {
    float front = max(dot(n, normalize(vToEye)), 0.0);
    float sky = 0.5 + 0.5 * n.z;
    colour = vec4(vec3(0.80, 0.79, 0.77) * (0.25 + 0.55 * front + 0.25 * sky), 1.0);
  }
}`;

export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly geometry = new BufferGeometry();
  private readonly material = new ShaderMaterial({
    vertexShader, fragmentShader, glslVersion: GLSL3, side: DoubleSide, uniforms: { look: { value: 0 } },
  });
  private readonly mesh = new Mesh(this.geometry, this.material);
  private readonly rigLines = new LineSegments(
    new BufferGeometry(), new LineBasicMaterial({ color: 0x5b6675, transparent: true, opacity: 0.8 }));
  private readonly eye = new PerspectiveCamera(40, 1, NEAR, FAR);
  private readonly orbit: OrbitControls;
  private readonly fly: Fly;
  private standing: RigCamera | null = null;
  private framed = false;
  private changed = true;
  /** Called when the one who looks moves away from where a camera stands. */
  onLeave: () => void = () => undefined;

  /** Throws where the browser has no WebGL 2. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    const context = canvas.getContext('webgl2', { antialias: true });
    if (!context) throw new Error('no WebGL 2');
    this.renderer = new WebGLRenderer({ canvas, context, antialias: true });
    this.renderer.setClearColor(BACKGROUND);
    this.scene.add(this.mesh, makeFloor(), this.rigLines);
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.rigLines.visible = false;
    this.eye.up.set(0, 0, 1);
    this.eye.position.set(3.2, -3.2, 1.9);
    this.orbit = new OrbitControls(this.eye, canvas);
    this.orbit.target.set(0, 0, 1);
    this.orbit.enableDamping = true;
    this.orbit.dampingFactor = 0.12;
    this.orbit.addEventListener('start', () => this.leave());
    this.orbit.addEventListener('change', () => (this.changed = true));
    this.fly = new Fly(this.eye, canvas);
  }

  show(surface: Surface): void {
    this.geometry.dispose(); // the buffers on the graphics card; others are made for the new arrays
    this.geometry.setAttribute('position', new BufferAttribute(surface.positions, 3));
    this.geometry.setAttribute('normal', new BufferAttribute(surface.normals, 3));
    const tint = surface.colours ?? new Uint8Array(surface.positions.length).fill(180);
    this.geometry.setAttribute('tint', new BufferAttribute(tint, 3, true));
    this.geometry.setIndex(new BufferAttribute(surface.indices, 1));
    this.mesh.visible = true;
    this.changed = true;
    if (!this.framed) this.frameAll();
  }

  /** Nothing is there until the next show(), which is framed. */
  clear(): void {
    this.mesh.visible = false;
    this.framed = false;
    this.changed = true;
  }

  /** The eye stands off as far as the performer is tall, from where it stood. */
  frameAll(): void {
    this.leave();
    if (!this.mesh.visible || this.geometry.getIndex()!.count === 0) return;
    this.framed = true;
    this.geometry.computeBoundingBox();
    const box = this.geometry.boundingBox!;
    const middle = box.getCenter(new Vector3());
    const half = box.getSize(new Vector3()).length() / 2;
    const away = (1.1 * half) / Math.sin((this.eye.fov * Math.PI) / 360);
    const from = new Vector3(0.75, -1, 0.32).normalize();
    this.eye.position.copy(middle).addScaledVector(from, away);
    this.orbit.target.copy(middle);
    this.orbit.update();
    this.changed = true;
  }

  get look(): Look {
    return LOOKS[this.material.uniforms.look.value as number];
  }
  set look(look: Look) {
    this.material.uniforms.look.value = LOOKS.indexOf(look);
    this.changed = true;
  }
  get wireframe(): boolean {
    return this.material.wireframe;
  }
  set wireframe(on: boolean) {
    this.material.wireframe = on;
    this.changed = true;
  }
  get flying(): boolean {
    return this.fly.on;
  }
  set flying(on: boolean) {
    this.leave();
    this.fly.on = on;
    this.orbit.enabled = !on;
    if (!on) this.orbit.target.copy(this.fly.ahead(2.5));
    this.changed = true;
  }
  get rigShown(): boolean {
    return this.rigLines.visible;
  }
  set rigShown(on: boolean) {
    this.rigLines.visible = on;
    this.changed = true;
  }

  setRig(rig: RigCamera[]): void {
    this.rigLines.geometry.dispose();
    this.rigLines.geometry = new BufferGeometry().setFromPoints(rig.flatMap(pyramid));
    this.changed = true;
  }

  /** Looks as the camera does, until the one who looks moves. */
  standAt(camera: RigCamera): void {
    if (this.flying) this.flying = false;
    this.standing = camera;
    const pose = worldFromCamera(camera);
    pose.decompose(this.eye.position, this.eye.quaternion, this.eye.scale);
    this.orbit.target.copy(this.fly.ahead(2.5));
    this.changed = true;
  }

  /** Where the image of the camera that we stand at lies on the canvas; null when we stand at none. */
  imageFrame(): { left: number; top: number; width: number; height: number } | null {
    return this.standing && imageOnScreen(this.standing, this.canvas.clientWidth, this.canvas.clientHeight);
  }

  private leave(): void {
    if (!this.standing) return;
    this.standing = null;
    this.changed = true;
    this.onLeave();
  }

  /** Draws where anything has changed. */
  render(seconds: number): void {
    this.fitCanvas();
    if (this.fly.on) this.changed = this.fly.move(seconds) || this.changed;
    else if (!this.standing) this.orbit.update();
    if (!this.changed) return;
    this.changed = false;
    this.eye.aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    this.eye.updateProjectionMatrix();
    if (this.standing) this.setProjection(this.standing);
    this.renderer.render(this.scene, this.eye);
  }

  private setProjection(camera: RigCamera): void {
    const projection = projectionOf(camera, this.canvas.clientWidth, this.canvas.clientHeight, NEAR, FAR);
    this.eye.projectionMatrix.copy(projection);
    this.eye.projectionMatrixInverse.copy(new Matrix4().copy(projection).invert());
  }

  private fitCanvas(): void {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = Math.min(window.devicePixelRatio, 2);
    if (this.canvas.width === Math.floor(clientWidth * ratio) && this.canvas.height === Math.floor(clientHeight * ratio)) return;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.changed = true;
  }
}

function makeFloor(): GridHelper {
  const floor = new GridHelper(6, 12, 0x39414d, 0x22272f);
  floor.rotateX(Math.PI / 2); // z is up
  return floor;
}

/** A camera of the studio as eight lines: from its centre to the corners of its image, and round them. */
function pyramid(camera: RigCamera): Vector3[] {
  const depth = 0.18;
  const pose = worldFromCamera(camera);
  const [fx, fy] = [camera.matrix[0][0], camera.matrix[1][1]];
  const [cx, cy] = [camera.matrix[0][2], camera.matrix[1][2]];
  const corner = (u: number, v: number) =>
    new Vector3(((u - cx) / fx) * depth, -((v - cy) / fy) * depth, -depth).applyMatrix4(pose);
  const corners = [corner(0, 0), corner(camera.width, 0), corner(camera.width, camera.height), corner(0, camera.height)];
  const center = new Vector3().setFromMatrixPosition(pose);
  return corners.flatMap((c, n) => [center, c, c, corners[(n + 1) % 4]]);
}
