// Shading of performers. The cameras' views of each vertex are in a texture with a layer for each camera
// (vertex_views.ts), so any number of cameras uses one texture unit.
import { DataArrayTexture, DoubleSide, GLSL3, ShaderMaterial, Vector3 } from 'three';
import { MAX_CAMERAS } from '../player/src/camera_views';

/** In the order of their keys. */
export const LOOKS = ['colour', 'normals', 'clay', 'view', 'confidence'] as const;
export type Look = (typeof LOOKS)[number];

/** True when the look needs the camera views. */
export const wantsViews = (look: Look) => look === 'view' || look === 'confidence';

/** m of equation (7), the value of the paper and of recon/texture/texture.h. */
const SHARPNESS = 10;
/** Cameras agree on a colour within this distance of their mean, in red, green and blue from 0 to 1. */
export const AGREEING = 0.15;
/** Colours for 0, 1, ... agreeing cameras; the last is for all higher numbers. */
export const CONFIDENCE_COLOURS = ['#55585f', '#46327e', '#365c8d', '#277f8e', '#1fa187', '#8fd744', '#fde725'];

const vec3Of = (hex: string) => `vec3(${[1, 3, 5].map((at) => (parseInt(hex.slice(at, at + 2), 16) / 255).toFixed(4)).join(', ')})`;

// Colour bytes are shown unchanged: colours and screen are both sRGB.
const vertexShader = `
uniform int look;
uniform highp sampler2DArray views;
uniform int viewCount; // 0: the camera views are unknown
uniform vec3 axes[${MAX_CAMERAS}];
uniform vec3 eyeAxis;
in vec3 tint;
out vec3 vTint; out vec3 vNormal; out vec3 vToEye; out float vAgreeing;

const int INNER = 2, RIM = 1;
vec4 viewOf(int camera) {
  int row = textureSize(views, 0).x;
  return texelFetch(views, ivec3(gl_VertexID % row, gl_VertexID / row, camera), 0);
}
int visibilityOf(vec4 view) {
  return int(view.a * 2.0 + 0.5);
}
// Algorithm 2: weight of a camera for the view direction.
float weightOf(int camera) {
  return pow((dot(eyeAxis, axes[camera]) + 2.0) / 3.0, ${SHARPNESS}.0);
}
// Equation (7) over the cameras that see the vertex. Rims of silhouettes count only if no other camera sees it.
vec3 blended(bool forEye, out int visibility) {
  vec4 inner = vec4(0.0), rim = vec4(0.0);
  for (int camera = 0; camera < viewCount; ++camera) {
    vec4 view = viewOf(camera);
    vec4 part = vec4(view.rgb, 1.0) * (forEye ? weightOf(camera) : 1.0);
    if (visibilityOf(view) == INNER) inner += part;
    else if (visibilityOf(view) == RIM) rim += part;
  }
  visibility = inner.a > 0.0 ? INNER : rim.a > 0.0 ? RIM : 0;
  vec4 sum = visibility == INNER ? inner : rim;
  return visibility > 0 ? sum.rgb / sum.a : tint;
}
float agreeing() {
  int visibility;
  vec3 mean = blended(false, visibility);
  if (visibility == 0) return 0.0;
  int count = 0;
  for (int camera = 0; camera < viewCount; ++camera) {
    vec4 view = viewOf(camera);
    if (visibilityOf(view) == visibility && distance(view.rgb, mean) <= ${AGREEING}) ++count;
  }
  return float(count);
}
void main() {
  int visibility;
  vTint = look == ${LOOKS.indexOf('view')} && viewCount > 0 ? blended(true, visibility) : tint;
  vAgreeing = look == ${LOOKS.indexOf('confidence')} && viewCount > 0 ? agreeing() : -1.0;
  vec4 world = modelMatrix * vec4(position, 1.0);
  vNormal = mat3(modelMatrix) * normal; // rotation and uniform scale only
  vToEye = cameraPosition - world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

const fragmentShader = `
precision highp float;
uniform int look;
in vec3 vTint; in vec3 vNormal; in vec3 vToEye; in float vAgreeing;
out vec4 colour;
const vec3 SURE[${CONFIDENCE_COLOURS.length}] = vec3[](${CONFIDENCE_COLOURS.map(vec3Of).join(', ')});
vec3 sure(float cameras) {
  float at = clamp(cameras, 0.0, ${CONFIDENCE_COLOURS.length - 1}.0);
  int below = min(int(at), ${CONFIDENCE_COLOURS.length - 2});
  return mix(SURE[below], SURE[below + 1], at - float(below));
}
void main() {
  vec3 n = normalize(vNormal);
  float front = max(dot(n, normalize(vToEye)), 0.0);
  if (look == ${LOOKS.indexOf('colour')} || look == ${LOOKS.indexOf('view')}) colour = vec4(vTint, 1.0);
  else if (look == ${LOOKS.indexOf('normals')}) colour = vec4(0.5 + 0.5 * n, 1.0);
  else if (vAgreeing >= 0.0) colour = vec4(sure(vAgreeing) * (0.6 + 0.4 * front), 1.0);
  else {
    float sky = 0.5 + 0.5 * n.z;
    colour = vec4(vec3(0.80, 0.79, 0.77) * (0.25 + 0.55 * front + 0.25 * sky), 1.0);
  }
}`;

export const NO_VIEWS = new DataArrayTexture(new Uint8Array(4), 1, 1, 1);
NO_VIEWS.needsUpdate = true;

/** One material for all performers. Each sets its camera views before it is drawn. */
export function makeShading(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader, fragmentShader, glslVersion: GLSL3, side: DoubleSide,
    uniforms: {
      look: { value: 0 }, views: { value: NO_VIEWS }, viewCount: { value: 0 }, eyeAxis: { value: new Vector3(0, 0, -1) },
      axes: { value: Array.from({ length: MAX_CAMERAS }, () => new Vector3()) },
    },
  });
}
