// The undistorted photograph of a camera over the view from the same camera.
import {
  BufferAttribute, BufferGeometry, DataTexture, GLSL3, LinearFilter, Matrix3, Mesh, NoColorSpace, ShaderMaterial, Texture,
} from 'three';
import { coefficientsOf, LENS_GLSL, maxRadius2, tiltOf } from './lens';
import type { RigCamera } from './rig';

// One triangle over the whole screen; a ray through each of its points.
const vertexShader = `
out vec3 ray;
void main() {
  vec4 near = inverse(projectionMatrix) * vec4(position.xy, -1.0, 1.0);
  ray = near.xyz / near.w;
  gl_Position = vec4(position.xy, 0.0, 1.0);
}`;
const fragmentShader = `
precision highp float;
${LENS_GLSL}
uniform sampler2D photograph;
uniform float amount;
in vec3 ray;
out vec4 colour;
void main() {
  vec2 at = inImage(vec2(ray.x, -ray.y) / -ray.z);
  if (any(lessThan(at, vec2(0.0))) || any(greaterThan(at, vec2(1.0)))) discard;
  colour = vec4(texture(photograph, at).rgb, amount);
}`;

export class Photograph {
  private readonly material = new ShaderMaterial({
    vertexShader, fragmentShader, glslVersion: GLSL3, transparent: true, depthTest: false, depthWrite: false,
    uniforms: {
      lens: { value: new Array<number>(14).fill(0) }, tilt: { value: new Matrix3() }, matrix: { value: new Matrix3() },
      imageSize: { value: [1, 1] }, maxRadius2: { value: 1 }, amount: { value: 0 },
      photograph: { value: new DataTexture(new Uint8Array(4), 1, 1) as Texture },
    },
  });
  readonly mesh: Mesh;
  private there = false;

  constructor() {
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    this.mesh = new Mesh(geometry, this.material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 1000;
    this.update();
  }

  /** Opacity, 0 to 1. */
  get amount(): number {
    return this.material.uniforms.amount.value as number;
  }
  set amount(amount: number) {
    this.material.uniforms.amount.value = amount;
    this.update();
  }

  /** Sets the camera that took the photograph. */
  of(camera: RigCamera): void {
    const { uniforms } = this.material;
    uniforms.lens.value = coefficientsOf(camera);
    uniforms.tilt.value = tiltOf(camera);
    const [a, b, c] = camera.matrix;
    uniforms.matrix.value = new Matrix3(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2]);
    uniforms.imageSize.value = [camera.width, camera.height];
    uniforms.maxRadius2.value = maxRadius2(camera);
  }

  /** Shows a picture; null: none. The caller keeps ownership and must keep it until the next is shown. */
  show(picture: ImageBitmap | null): void {
    const { uniforms } = this.material;
    if (picture && this.there && (uniforms.photograph.value as Texture).image === picture) return;
    this.there = picture !== null;
    if (picture) {
      (uniforms.photograph.value as Texture).dispose();
      const texture = new Texture(picture);
      texture.flipY = false;
      texture.generateMipmaps = false;
      texture.minFilter = texture.magFilter = LinearFilter;
      texture.colorSpace = NoColorSpace; // bytes are shown unchanged, like those of the surface
      texture.needsUpdate = true;
      uniforms.photograph.value = texture;
    }
    this.update();
  }

  private update(): void {
    this.mesh.visible = this.there && this.amount > 0;
  }
}
