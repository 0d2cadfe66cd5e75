// A sequence of surfaces on the stage, and where it stands there.
import { type Box3, BufferAttribute, BufferGeometry, MathUtils, Mesh, type Object3D, type ShaderMaterial } from 'three';
import type { Placement } from './scene_file';
import type { Surface } from './surface';

export class Performer {
  private readonly geometry = new BufferGeometry();
  readonly mesh: Mesh;

  /** The material is the stage's: all performers have the same. */
  constructor(material: ShaderMaterial) {
    this.mesh = new Mesh(this.geometry, material);
    this.mesh.frustumCulled = false;
    this.mesh.visible = false;
  }

  show(surface: Surface): void {
    this.geometry.dispose(); // the buffers on the graphics card; others are made for the new arrays
    this.geometry.setAttribute('position', new BufferAttribute(surface.positions, 3));
    this.geometry.setAttribute('normal', new BufferAttribute(surface.normals, 3));
    const tint = surface.colours ?? new Uint8Array(surface.positions.length).fill(180);
    this.geometry.setAttribute('tint', new BufferAttribute(tint, 3, true));
    this.geometry.setIndex(new BufferAttribute(surface.indices, 1));
    this.geometry.boundingBox = null;
    this.mesh.visible = true;
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
    this.geometry.dispose();
  }
}

export function place(object: Object3D, at: Placement): void {
  object.position.set(...at.move);
  const [x, y, z] = at.turn_deg.map(MathUtils.degToRad);
  object.rotation.set(x, y, z, 'ZYX'); // three names axes in the order of the product
  object.scale.setScalar(at.scale);
}
