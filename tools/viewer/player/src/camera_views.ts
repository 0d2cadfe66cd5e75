// Colours of vertices in every camera, as the shader of view-dependent colours reads them.

/** Maximum number of cameras in the shader. */
export const MAX_CAMERAS = 64;
/** Width of a texture with one vertex a texel; WebGL 2 supports twice this width. */
export const ROW = 1024;

export interface ViewingCamera {
  name: string;
  /** Unit vector of its optical axis, world: the paper's V_c. */
  axis: [number, number, number];
}

/** Colour and visibility of the vertices of a mesh in every camera. */
export interface VertexViews {
  pulse: number;
  vertices: number;
  cameras: ViewingCamera[];
  rows: number;
  /**
   * For each camera `rows` rows of ROW texels: red, green, blue, and the visibility of the vertex in the camera: 0 not,
   * 128 at the rim of the silhouette, where the colour may be the background's, 255 inside.
   */
  texels: Uint8Array;
}

/** 'unread': the frame has views that were not decoded; null: it has none. */
export type CodedViews = VertexViews | 'unread' | null;
