// The 3D view: performers, models, the floor, the studio's cameras, and the viewpoint.
import {
  Box3, BufferGeometry, Color, DirectionalLight, GridHelper, Group, HemisphereLight, LineBasicMaterial, LineSegments, Matrix4,
  PerspectiveCamera, Raycaster, Scene, Vector2, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { Backdrop } from './backdrop';
import { BendHandle } from './bend_handle';
import { onClicks } from './click';
import { Fly } from './fly';
import { Performer } from './performer';
import { Photograph } from './photograph';
import { imageOnScreen, projectionOf, worldFromCamera, type RigCamera } from './rig';
import type { CameraKey, Vector } from './scene_file';
import { type Look, LOOKS, makeShading } from './shading';
import { type DrawnSkeleton, SkeletonOverlay } from './skeleton_overlay';
import { watchContext } from '../player/src/context_loss';
import type { Surface } from '../player/src/surface';
import { type DrawnTrail, Trails } from './trails';

const NEAR = 0.02;
const FAR = 200;
/** Vertical field of view, degrees, unless a scene's camera sets another. */
const FOV = 40;
const BACKGROUND = new Color(0x101216);
const CONTEXT_LOST = 'The graphics card has lost the picture. Reload the page if it does not come back.';

export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly material = makeShading();
  /** Performer of a take or of the live picture. */
  private readonly single = new Performer(this.material);
  /** Photograph over the view, while the viewpoint is that of a camera. */
  readonly photograph = new Photograph();
  private readonly trails = new Trails();
  private readonly skeletons = new SkeletonOverlay();
  /** Rings that turn a joint. */
  readonly handle: BendHandle;
  private readonly performers = new Set([this.single]);
  /** Backdrop of a scene. */
  private readonly models = new Group();
  private readonly floor = makeFloor();
  readonly backdrop: Backdrop;
  private readonly rigLines = new LineSegments(
    new BufferGeometry(), new LineBasicMaterial({ color: 0x5b6675, transparent: true, opacity: 0.8 }));
  private readonly eye = new PerspectiveCamera(FOV, 1, NEAR, FAR);
  private readonly orbit: OrbitControls;
  private readonly fly: Fly;
  private standing: RigCamera | null = null;
  private framed = false;
  /** The first surface of each performer of the scene sets the view. */
  private framesScene = false;
  private changed = true;
  private following = false;
  /** Called when the user moves the viewpoint away from a camera or from the path of a scene. */
  onLeave: () => void = () => undefined;

  /** Throws when the browser has no WebGL 2. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    const context = canvas.getContext('webgl2', { antialias: true });
    if (!context) throw new Error('no WebGL 2');
    this.renderer = new WebGLRenderer({ canvas, context, antialias: true });
    this.renderer.setClearColor(BACKGROUND);
    watchContext(canvas, 0, () => this.onGraphics(CONTEXT_LOST), () => {
      this.renderer.setClearColor(BACKGROUND); // the renderer starts again with its defaults
      this.redraw();
      this.onGraphics('');
    });
    this.scene.add(this.single.mesh, this.models, this.floor, this.rigLines, this.photograph.mesh, this.trails.group,
      this.skeletons.group, ...makeLights());
    this.backdrop = new Backdrop(this.scene, () => (this.changed = true), (text) => this.onTrouble(text));
    this.rigLines.visible = false;
    this.eye.up.set(0, 0, 1);
    this.eye.position.set(3.2, -3.2, 1.9);
    onClicks(canvas, (across, down) => (this.handle.isHit ? null : this.rayAt(across, down)), (ray) => {
      if (!ray || this.onRay(ray)) return;
      const vertex = this.single.vertexAt(ray);
      if (vertex !== null) this.onClick(vertex);
    });
    this.orbit = new OrbitControls(this.eye, canvas);
    this.orbit.target.set(0, 0, 1);
    this.orbit.enableDamping = true;
    this.orbit.dampingFactor = 0.12;
    this.orbit.addEventListener('start', () => {
      this.framesScene = false;
      this.leave();
    });
    this.orbit.addEventListener('change', () => (this.changed = true));
    this.fly = new Fly(this.eye, canvas);
    this.handle = new BendHandle(this.scene, this.eye, canvas, (on) => (this.orbit.enabled = !on && !this.fly.on),
      () => (this.changed = true));
  }

  onTrouble: (text: string) => void = () => undefined;
  /** Called when the graphics card has lost the picture, and with '' when it is there again. */
  onGraphics: (text: string) => void = () => undefined;
  /** Called first for a click; true: it hit something, and the surface is not clicked. */
  onRay: (ray: Raycaster) => boolean = () => false;
  /** Called for a click on the permanent performer, with the nearest vertex. */
  onClick: (vertex: number) => void = () => undefined;

  /** The ray through a point of the canvas, given by 0 to 1 of its width and height. */
  private rayAt(across: number, down: number): Raycaster {
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(2 * across - 1, 1 - 2 * down), this.eye);
    return ray;
  }

  /** Shows a frame on the permanent performer, or on one of a scene. */
  show(surface: Surface, performer = this.single): void {
    const isFirst = performer.indexUploads === 0;
    performer.show(surface);
    this.canvas.dataset.uploads = String(this.single.indexUploads); // for tests
    Object.assign(this.canvas, { positions: surface.positions }); // for tests
    const isUnframed = performer === this.single ? !this.framed : isFirst && this.framesScene;
    if (isUnframed) this.frameAll();
    this.changed = true;
  }

  /** Draws these trails instead of the last ones. */
  showTrails(trails: DrawnTrail[]): void {
    this.trails.show(trails);
    this.canvas.dataset.trails = `${trails.length} ${(trails[0]?.path.length ?? 0) / 3}`; // for tests
    this.changed = true;
  }

  /** Draws these skeletons instead of the last ones. */
  showSkeletons(skeletons: DrawnSkeleton[]): void {
    this.skeletons.show(skeletons);
    this.canvas.dataset.skeletons = String(skeletons.length); // for tests
    this.changed = true;
  }

  /** The joint of a drawn skeleton that a click means; null: none. */
  jointAt(ray: Raycaster): { skeleton: number; joint: number } | null {
    return this.skeletons.jointAt(ray.ray);
  }

  /** The permanent performer. */
  get performer(): Performer {
    return this.single;
  }

  addPerformer(): Performer {
    const performer = new Performer(this.material);
    this.performers.add(performer);
    this.scene.add(performer.mesh);
    return performer;
  }

  removePerformer(performer: Performer): void {
    this.performers.delete(performer);
    this.scene.remove(performer.mesh);
    performer.dispose();
    this.changed = true;
  }

  setModels(models: Group[]): void {
    this.models.clear();
    if (models.length) this.models.add(...models);
    this.changed = true;
  }

  set floorShown(on: boolean) {
    this.floor.visible = on;
    this.changed = true;
  }

  /** To call after an object on the stage was moved. */
  redraw(): void {
    this.changed = true;
  }

  get triangles(): number {
    return [...this.performers].reduce((sum, performer) => sum + performer.triangles, 0);
  }

  /** Resets the stage to its state without a scene. It is empty until the next show(), which also sets the view. */
  clear(): void {
    this.single.mesh.visible = false;
    this.setModels([]);
    this.backdrop.clear();
    this.floorShown = true;
    this.framed = false;
    this.framesScene = false;
    this.leave();
    this.eye.fov = FOV;
    this.changed = true;
  }

  /** Moves the viewpoint, in its present direction, to a distance that shows everything. */
  frameAll(): void {
    this.leave();
    const box = new Box3();
    for (const performer of this.performers) performer.addTo(box);
    if (this.models.children.length) box.expandByObject(this.models);
    if (box.isEmpty()) return;
    this.framed = true;
    const middle = box.getCenter(new Vector3());
    const half = box.getSize(new Vector3()).length() / 2;
    const away = (1.1 * half) / Math.sin((this.eye.fov * Math.PI) / 360);
    const from = new Vector3(0.75, -1, 0.32).normalize();
    this.eye.position.copy(middle).addScaledVector(from, away);
    this.orbit.target.copy(middle);
    this.orbit.update();
    this.changed = true;
  }

  /** Shows all of the scene, as soon as its performers have surfaces, until the user moves the viewpoint. */
  frameScene(): void {
    this.framesScene = true;
    this.frameAll();
  }

  /** Sets the viewpoint of a scene's camera path, until the user moves it. */
  follow(key: CameraKey): void {
    this.framesScene = false;
    if (this.flying) this.flying = false;
    if (this.standing) this.leave();
    this.following = true;
    this.eye.position.set(...key.eye);
    this.orbit.target.set(...key.look);
    this.eye.lookAt(this.orbit.target);
    this.eye.fov = key.fov_deg;
    this.changed = true;
  }

  /** The present viewpoint as a key of a camera path. */
  eyeAsKey(at_s: number): CameraKey {
    const look = this.fly.on ? this.fly.ahead(2.5) : this.orbit.target;
    const vector = (v: Vector3) => [v.x, v.y, v.z] as Vector;
    return { at_s, eye: vector(this.eye.position), look: vector(look), fov_deg: this.eye.fov };
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
    this.framesScene = false;
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

  /** Sets the viewpoint of the camera, until the user moves it. */
  standAt(camera: RigCamera): void {
    this.framesScene = false;
    if (this.flying) this.flying = false;
    this.leave();
    this.standing = camera;
    const pose = worldFromCamera(camera);
    pose.decompose(this.eye.position, this.eye.quaternion, this.eye.scale);
    this.orbit.target.copy(this.fly.ahead(2.5));
    this.changed = true;
  }

  /** The rectangle of the camera's image on the canvas; null when the viewpoint is not that of a camera. */
  private imageFrame(): { left: number; top: number; width: number; height: number } | null {
    return this.standing && imageOnScreen(this.standing, this.canvas.clientWidth, this.canvas.clientHeight);
  }

  /** Lays `frame` around the image of the camera that the view is from, with its name; hides it without one. */
  placeImageFrame(frame: HTMLElement, camera: string | null): void {
    const image = this.imageFrame();
    frame.hidden = image === null;
    if (!image) return;
    for (const side of ['left', 'top', 'width', 'height'] as const) frame.style[side] = `${image[side]}px`;
    frame.firstElementChild!.textContent = camera;
  }

  private leave(): void {
    if (!this.standing && !this.following) return;
    this.standing = null;
    this.following = false;
    this.changed = true;
    this.onLeave();
  }

  /** Draws if anything has changed. */
  render(seconds: number): void {
    this.fitCanvas();
    if (this.fly.on) this.changed = this.fly.move(seconds) || this.changed;
    else if (!this.standing && !this.following) this.orbit.update();
    if (!this.changed) return;
    this.changed = false;
    this.eye.aspect = this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight);
    this.eye.updateProjectionMatrix();
    if (this.standing) this.setProjection(this.standing);
    this.backdrop.fit(this.canvas.clientWidth, this.canvas.clientHeight);
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

/** Light for models: a sun, and a sky brighter than the ground (docs/scene.md). Performers have their own light. */
function makeLights() {
  const grey = (brightness: number) => new Color().setScalar(brightness);
  const sky = new HemisphereLight(grey(0.65), grey(0.35), Math.PI);
  sky.position.set(0, 0, 1);
  const sun = new DirectionalLight(grey(0.5), Math.PI);
  sun.position.set(-0.4, -0.6, 1);
  return [sky, sun];
}

/** A camera of the studio as eight lines: from its centre to the corners of its image, and around the image. */
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
