// Buffers of a surface on the graphics card.
import { BufferAttribute, BufferGeometry } from 'three';

/** Values of one attribute, `size` of each vertex. */
export interface AttributeValues {
  values: Float32Array | Uint8Array | Uint16Array;
  size: number;
  normalized?: boolean;
}

/** A geometry whose surface changes. Its object in the scene must not be culled, because bounds are computed on demand only. */
export class SurfaceGeometry {
  readonly geometry = new BufferGeometry();
  /** Number of surfaces whose triangles were uploaded. */
  indexUploads = 0;

  /** Shows a surface. The same array of indices is not uploaded again, nor are the same values of an attribute. */
  show(indices: Uint32Array, attributes: Record<string, AttributeValues>): void {
    const { geometry } = this;
    if (geometry.getIndex()?.array === indices) {
      for (const [name, { values }] of Object.entries(attributes)) this.update(name, values);
    } else {
      geometry.dispose(); // frees the buffers on the graphics card; new ones are made for the new arrays
      for (const [name, { values, size, normalized }] of Object.entries(attributes)) {
        geometry.setAttribute(name, new BufferAttribute(values, size, normalized));
      }
      geometry.setIndex(new BufferAttribute(indices, 1));
      ++this.indexUploads;
    }
    geometry.boundingBox = null;
    geometry.boundingSphere = null;
  }

  /** Uploads new values into the buffer on the graphics card. */
  private update(name: string, values: AttributeValues['values']): void {
    const attribute = this.geometry.getAttribute(name) as BufferAttribute;
    if (attribute.array === values) return;
    attribute.array = values;
    attribute.needsUpdate = true;
  }

  dispose(): void {
    this.geometry.dispose();
  }
}
