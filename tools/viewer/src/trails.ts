// Trails: the paths of vertices of a tracked surface over the last pulses, each with a dot at its vertex.
import { BufferGeometry, Color, Float32BufferAttribute, Group, Points, PointsMaterial } from 'three';
import { LineMaterial } from 'three/addons/lines/LineMaterial.js';
import { LineSegments2 } from 'three/addons/lines/LineSegments2.js';
import { LineSegmentsGeometry } from 'three/addons/lines/LineSegmentsGeometry.js';

export interface DrawnTrail {
  /** Selects the colour. */
  number: number;
  /** x, y, z of each point, the newest last: metres. */
  path: Float32Array;
}

/** Brightness of the oldest point; the newest has 1. */
const OLDEST = 0.25;
/** Hues of consecutive numbers differ by the golden ratio. */
const GOLDEN = 0.381966;

const colourOf = (number: number) => new Color().setHSL((0.11 + number * GOLDEN) % 1, 0.95, 0.6);

/** Draws points as discs instead of squares. */
export function roundPoints(material: PointsMaterial): void {
  material.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace('#include <clipping_planes_fragment>',
      'if (length(gl_PointCoord - 0.5) > 0.5) discard;');
  };
}

export class Trails {
  readonly group = new Group();
  // Drawn over the surface, because a vertex lies in it.
  private readonly lines = new LineSegments2(new LineSegmentsGeometry(),
    new LineMaterial({ linewidth: 3, vertexColors: true, depthTest: false, transparent: true }));
  private readonly dots = new Points(new BufferGeometry(),
    new PointsMaterial({ size: 9, sizeAttenuation: false, vertexColors: true, depthTest: false, transparent: true }));

  constructor() {
    roundPoints(this.dots.material);
    for (const part of [this.lines, this.dots]) {
      part.frustumCulled = false;
      part.renderOrder = 2;
    }
    this.group.add(this.lines, this.dots);
    this.group.visible = false;
  }

  show(trails: DrawnTrail[]): void {
    this.group.visible = trails.length > 0;
    const ends: number[] = [], endColours: number[] = [];
    const between: number[] = [], betweenColours: number[] = [];
    for (const { number, path } of trails) {
      const colour = colourOf(number);
      const count = path.length / 3;
      if (count === 0) continue;
      const tint = (n: number) => colour.clone().multiplyScalar(OLDEST + ((1 - OLDEST) * n) / (count - 1)).toArray();
      for (let n = 0; n + 1 < count; ++n) {
        between.push(...path.subarray(3 * n, 3 * n + 6));
        betweenColours.push(...tint(n), ...tint(n + 1));
      }
      ends.push(...path.subarray(-3));
      endColours.push(...colour.toArray());
    }
    this.lines.visible = between.length > 0;
    this.lines.geometry.dispose();
    this.lines.geometry = new LineSegmentsGeometry();
    if (between.length) this.lines.geometry.setPositions(between).setColors(betweenColours);
    this.dots.geometry.dispose();
    this.dots.geometry = new BufferGeometry();
    this.dots.geometry.setAttribute('position', new Float32BufferAttribute(ends, 3));
    this.dots.geometry.setAttribute('color', new Float32BufferAttribute(endColours, 3));
  }
}
