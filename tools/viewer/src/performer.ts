// A performer on the stage: its present surface, placement and camera views.
import {
  type Box3, type Camera, DataArrayTexture, MathUtils, Matrix4, Mesh, NoColorSpace, type Object3D,
  type Raycaster, type ShaderMaterial, Vector3,
} from 'three';
import type { Placement } from './scene_file';
import { NO_VIEWS } from './shading';
import type { Surface } from '../player/src/surface';
import { SurfaceGeometry } from '../player/src/surface_geometry';
import { ROW, type VertexViews } from '../player/src/camera_views';

export class Performer {
  private readonly surface = new SurfaceGeometry();
  private readonly geometry = this.surface.geometry;
  private views: VertexViews | null = null;
  private texture: DataArrayTexture | null = null;
  readonly mesh: Mesh;

  /** The material belongs to the stage and is shared by all performers. */
  constructor(private readonly material: ShaderMaterial) {
    this.mesh = new Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
    this.mesh.onBeforeRender = (_renderer, _scene, camera) => this.tellShading(camera);
  }

  /** Shows a surface. Its camera views are unknown until setViews(). The same array of indices is not uploaded again. */
  show(surface: Surface): void {
    const tint = surface.colours ?? new Uint8Array(surface.positions.length).fill(180);
    this.surface.show(surface.indices, {
      position: { values: surface.positions, size: 3 },
      normal: { values: surface.normals, size: 3 },
      tint: { values: tint, size: 3, normalized: true },
    });
    this.mesh.visible = true;
    this.setViews(null);
  }

  /** Number of surfaces whose triangles were uploaded. */
  get indexUploads(): number {
    return this.surface.indexUploads;
  }

  /** Number of the vertex that is nearest to the first point of the surface on the ray; null: the ray misses it. */
  vertexAt(ray: Raycaster): number | null {
    const hit = this.mesh.visible ? ray.intersectObject(this.mesh, false)[0] : undefined;
    if (!hit?.face) return null;
    const point = this.mesh.worldToLocal(hit.point.clone());
    const positions = this.geometry.getAttribute('position');
    const away = (vertex: number) => new Vector3().fromBufferAttribute(positions, vertex).distanceTo(point);
    const corners = [hit.face.a, hit.face.b, hit.face.c];
    return corners.reduce((best, vertex) => (away(vertex) < away(best) ? vertex : best));
  }

  /** Sets the camera views of the shown surface. Views of another surface are ignored. */
  setViews(views: VertexViews | null): void {
    const fits = views !== null && views.vertices === this.geometry.getAttribute('position')?.count;
    if (fits && views === this.views) return;
    this.texture?.dispose();
    this.texture = null;
    this.views = fits ? views : null;
    if (!this.views) return;
    this.texture = new DataArrayTexture(this.views.texels, ROW, this.views.rows, this.views.cameras.length);
    this.texture.colorSpace = NoColorSpace;
    this.texture.needsUpdate = true;
  }

  get hasViews(): boolean {
    return this.views !== null;
  }

  /** Sets the uniforms of this performer. The view direction is transformed into the frame of its take. */
  private tellShading(camera: Camera): void {
    const { uniforms } = this.material;
    uniforms.views.value = this.texture ?? NO_VIEWS;
    uniforms.viewCount.value = this.views?.cameras.length ?? 0;
    const own = new Matrix4().copy(this.mesh.matrixWorld).invert();
    camera.getWorldDirection(uniforms.eyeAxis.value as Vector3).transformDirection(own);
    this.views?.cameras.forEach(({ axis }, n) => (uniforms.axes.value as Vector3[])[n].set(...axis));
    this.material.uniformsNeedUpdate = true;
  }

  get triangles(): number {
    return this.mesh.visible ? (this.geometry.getIndex()?.count ?? 0) / 3 : 0;
  }

  addTo(box: Box3): void {
    if (this.triangles === 0) return;
    this.geometry.computeBoundingBox();
    this.mesh.updateMatrixWorld();
    box.union(this.geometry.boundingBox!.clone().applyMatrix4(this.mesh.matrixWorld));
  }

  dispose(): void {
    this.setViews(null);
    this.surface.dispose();
  }
}

export function place(object: Object3D, at: Placement): void {
  object.position.set(...at.move);
  const [x, y, z] = at.turn_deg.map(MathUtils.degToRad);
  object.rotation.set(x, y, z, 'ZYX'); // three.js orders the axes as in the matrix product
  object.scale.setScalar(at.scale);
}
