// Decoder of compact frames (v3d_decoder.h, docs/compact-frame.md) and of motion files (docs/motion-format.md) for
// JavaScript: a wrapper of v3d_decoder.wasm without other dependencies. It runs in browsers, workers and node.

export const OK = 0;
/** No compact frame of version 2 to 5, or damaged. */
export const MALFORMED = 1;
/** Its reference is not the last decoded frame; continue at a key frame. */
export const NEEDS_REFERENCE = 2;
/** Memory was exhausted. The decoder starts anew: there is no current frame; continue at a key frame. */
export const OUT_OF_MEMORY = 3;

/**
 * What one camera sees of a frame.
 * @typedef {object} CameraView
 * @property {[number, number, number]} axis  viewing direction, world: a unit vector within 1e-4
 * @property {Uint8Array} colours  r, g, b of each vertex (sRGB), and 255; all 0 where it is not seen
 */

/**
 * @typedef {object} Frame
 * @property {number} pulse
 * @property {bigint} exposureNs  start of exposure, ns since 1970; 0: unknown
 * @property {number} keyPulse  pulse of the key frame where decoding of this frame starts
 * @property {number} quality  0 to 1, more is better; NaN: unknown
 * @property {number} livePasses  passes of the deformation within the live budget, 0 to 3
 * @property {number} stepM  step of the lattice of vertices, metres
 * @property {[number, number, number]} originM  origin of this lattice, world frame, metres
 * @property {string[]} cameras  names of the cameras that took part
 * @property {number} missingCameras
 * @property {Float32Array} positions  x, y, z of each vertex: metres, z up
 * @property {Uint8Array | null} colours  r, g, b of each vertex (sRGB); null: the mesh has none
 * @property {Uint8Array | null} labels  performer of each vertex, 0: unknown; null: the mesh has none
 * @property {CameraView[] | null} views  of each camera, in the order of the names; null: none, or not wanted
 * @property {Uint32Array} indices  three for each triangle, counter-clockwise seen from outside
 */

// Offsets of the fields of v3d_frame, bytes.
const PULSE = 0, EXPOSURE = 8, KEY_PULSE = 16, QUALITY = 24, STEP = 32, ORIGIN = 40, CAMERAS = 64, NAMES = 68,
  MISSING = 72, VERTICES = 76, POSITIONS = 80, COLOURS = 84, TRIANGLES = 88, INDICES = 92, LIVE_PASSES = 96, LABELS = 100, VIEWS = 104;
// Of v3d_camera_view.
const VIEW_BYTES = 32, VIEW_COLOURS = 24;

/** Decodes the frames of one sequence. */
export class Decoder {
  #module;
  #c;
  #decoder = 0;
  #viewsWanted = false;

  /** @param {WebAssembly.Module} module of v3d_decoder.wasm */
  constructor(module) {
    this.#module = module;
    this.#reset();
  }

  /** Makes a new decoder with new memory; also used after memory was exhausted. */
  #reset() {
    this.#c = instance_of(this.#module);
    this.#decoder = this.#c.v3d_decoder_new();
    this.wantViews(this.#viewsWanted);
  }

  /**
   * Whether the next frames are decoded with the views of cameras that they have, which takes more time and memory. At first
   * they are not. Views begin at the next key frame at the latest.
   * @param {boolean} wanted
   */
  wantViews(wanted) {
    this.#viewsWanted = wanted;
    this.#c.v3d_decoder_want_views(this.#decoder, wanted ? 1 : 0);
  }

  /**
   * Decodes one frame. MALFORMED and NEEDS_REFERENCE leave the current frame as it is; after OUT_OF_MEMORY there is none until
   * the next OK.
   * @param {Uint8Array} bytes one compact frame
   * @returns {number}
   */
  decode(bytes) {
    try {
      const at = this.#c.malloc(bytes.length);
      if (at !== 0) {
        new Uint8Array(this.#c.memory.buffer, at, bytes.length).set(bytes);
        const status = this.#c.v3d_decoder_decode(this.#decoder, at, bytes.length);
        this.#c.free(at);
        return status;
      }
    } catch (error) {
      if (!(error instanceof WebAssembly.RuntimeError)) throw error;
    }
    this.#reset();
    return OUT_OF_MEMORY;
  }

  /**
   * The last decoded frame; null before the first, and after OUT_OF_MEMORY. Its arrays are views into the memory of the
   * decoder and are valid until the next call of decode(): copy what must stay.
   * @returns {Frame | null}
   */
  frame() {
    const frame = this.#c.v3d_decoder_frame(this.#decoder);
    if (frame === 0) return null;
    const memory = this.#c.memory.buffer;
    const view = new DataView(memory, frame);
    const word = (at) => view.getUint32(at, true);
    const vertices = word(VERTICES);
    const colours = word(COLOURS);
    const labels = word(LABELS);
    const views = word(VIEWS);
    const viewOf = (camera) => {
      const at = views + VIEW_BYTES * camera;
      const data = new DataView(memory, at);
      return {
        axis: [0, 8, 16].map((axis) => data.getFloat64(axis, true)),
        colours: new Uint8Array(memory, data.getUint32(VIEW_COLOURS, true), 4 * vertices),
      };
    };
    return {
      pulse: Number(view.getBigInt64(PULSE, true)),
      exposureNs: view.getBigInt64(EXPOSURE, true),
      keyPulse: Number(view.getBigInt64(KEY_PULSE, true)),
      quality: view.getFloat32(QUALITY, true),
      livePasses: word(LIVE_PASSES),
      stepM: view.getFloat64(STEP, true),
      originM: [0, 8, 16].map((axis) => view.getFloat64(ORIGIN + axis, true)),
      cameras: Array.from(new Uint32Array(memory, word(NAMES), word(CAMERAS)), (at) => text(memory, at)),
      missingCameras: word(MISSING),
      positions: new Float32Array(memory, word(POSITIONS), 3 * vertices),
      colours: colours === 0 ? null : new Uint8Array(memory, colours, 3 * vertices),
      labels: labels === 0 ? null : new Uint8Array(memory, labels, vertices),
      views: views === 0 ? null : Array.from({ length: word(CAMERAS) }, (_, camera) => viewOf(camera)),
      indices: new Uint32Array(memory, word(INDICES), 3 * word(TRIANGLES)),
    };
  }
}

/**
 * @typedef {object} MotionSegment
 * @property {number[]} pulses  increasing
 * @property {number} key  index of the pulse whose mesh became the template
 * @property {number} vertices
 * @property {number} triangles
 * @property {number} stepM  positions differ by at most half of it from those that were tracked
 */

/**
 * @typedef {object} MotionSurface
 * @property {Float32Array} positions  x, y, z of each vertex at the key pulse: metres, z up
 * @property {Uint8Array | null} colours  r, g, b of each vertex (sRGB): the same at all pulses, or their mean where
 *   pulses have colours of their own (MotionPulse); null: none
 * @property {Uint32Array} indices  three for each triangle, counter-clockwise seen from outside
 */

/**
 * @typedef {object} MotionPulse
 * @property {number} pulse
 * @property {Float32Array} positions  x, y, z of each vertex: metres, z up
 * @property {Uint8Array | null} colours  r, g, b of each vertex (sRGB) at this pulse; null: none
 * @property {Uint8Array | null} confidences  of each vertex, 0: only predicted, to 255; null: none
 */

/**
 * A motion file: surfaces of constant triangles whose vertices move. Has its own memory. All methods throw a
 * WebAssembly.RuntimeError when memory is exhausted; then make a new object.
 */
export class Motion {
  #c;
  #motion = 0;
  /** @type {MotionSegment[]} */
  segments = [];

  /**
   * Opens a file. Throws a RangeError for bytes that are no motion file of version 1.
   * @param {WebAssembly.Module} module of v3d_decoder.wasm
   * @param {Uint8Array} bytes the whole file; they are copied
   */
  constructor(module, bytes) {
    this.#c = instance_of(module);
    const at = this.#c.malloc(bytes.length + 4);
    if (at === 0) throw new RangeError('motion file: out of memory');
    const copy = at + 4;
    new Uint8Array(this.#c.memory.buffer, copy, bytes.length).set(bytes);
    const status = this.#c.v3d_motion_open(at, copy, bytes.length);
    this.#motion = new DataView(this.#c.memory.buffer).getUint32(at, true);
    this.#c.free(at);
    if (status !== OK) throw new RangeError(`not a motion file of version 1, or damaged (status ${status})`);
    const count = this.#c.v3d_motion_segments(this.#motion);
    for (let n = 0; n < count; ++n) this.segments.push(this.#segment(n));
  }

  #segment(number) {
    const memory = this.#c.memory.buffer;
    const view = new DataView(memory, this.#c.v3d_motion_segment_at(this.#motion, number));
    const word = (at) => view.getUint32(at, true);
    const pulses = Array.from(new BigInt64Array(memory, word(4), word(0)), Number);
    return { pulses, key: word(8), vertices: word(12), triangles: word(16), stepM: view.getFloat64(24, true) };
  }

  /**
   * Decodes the template of a segment. Its arrays are views into the memory of this object and are valid until the next
   * call of any method: copy what must stay.
   * @returns {MotionSurface | null} null: damaged
   */
  surface(segment) {
    const at = this.#c.v3d_motion_surface_of(this.#motion, segment);
    if (at === 0) return null;
    const memory = this.#c.memory.buffer;
    const [vertices, positions, colours, triangles, indices] = new Uint32Array(memory, at, 5);
    return {
      positions: new Float32Array(memory, positions, 3 * vertices),
      colours: colours === 0 ? null : new Uint8Array(memory, colours, 3 * vertices),
      indices: new Uint32Array(memory, indices, 3 * triangles),
    };
  }

  /**
   * Decodes a pulse by its index in the segment; forward is fastest. Its arrays are views as those of surface().
   * @returns {MotionPulse | null} null: damaged
   */
  decode(segment, index) {
    const at = this.#c.v3d_motion_decode(this.#motion, segment, index);
    if (at === 0) return null;
    const memory = this.#c.memory.buffer;
    const [vertices, positions, colours, confidences] = new Uint32Array(memory, at + 8, 4);
    return {
      pulse: Number(new DataView(memory, at).getBigInt64(0, true)),
      positions: new Float32Array(memory, positions, 3 * vertices),
      colours: colours === 0 ? null : new Uint8Array(memory, colours, 3 * vertices),
      confidences: confidences === 0 ? null : new Uint8Array(memory, confidences, vertices),
    };
  }
}

/** Makes an instance of the module with its own memory; returns its exports. */
function instance_of(module) {
  // System calls that the C library imports. The decoder calls none of them; each returns "not supported".
  const system = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) (system[from] ??= {})[name] = () => 52;
  const exported = new WebAssembly.Instance(module, system).exports;
  exported._initialize();
  return exported;
}

/** Reads a NUL-terminated string. */
function text(memory, at) {
  const bytes = new Uint8Array(memory, at);
  return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
}
