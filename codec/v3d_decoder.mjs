// Decoder of compact frames (v3d_decoder.h, docs/compact-frame.md) for JavaScript: a wrapper of v3d_decoder.wasm without
// other dependencies. It runs in browsers, workers and node.

export const OK = 0;
/** No compact frame of version 2 or 3, or damaged. */
export const MALFORMED = 1;
/** Its reference is not the last decoded frame; continue at a key frame. */
export const NEEDS_REFERENCE = 2;
/** Memory is exhausted: make a new decoder. */
export const OUT_OF_MEMORY = 3;

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
 * @property {Uint32Array} indices  three for each triangle, counter-clockwise seen from outside
 */

// Offsets of the fields of v3d_frame, bytes.
const PULSE = 0, EXPOSURE = 8, KEY_PULSE = 16, QUALITY = 24, STEP = 32, ORIGIN = 40, CAMERAS = 64, NAMES = 68,
  MISSING = 72, VERTICES = 76, POSITIONS = 80, COLOURS = 84, TRIANGLES = 88, INDICES = 92, LIVE_PASSES = 96, LABELS = 100;

/** Decodes the frames of one sequence. */
export class Decoder {
  #module;
  #c;
  #decoder = 0;

  /** @param {WebAssembly.Module} module of v3d_decoder.wasm */
  constructor(module) {
    this.#module = module;
    this.#reset();
  }

  /** Makes a new decoder with new memory; also used after memory was exhausted. */
  #reset() {
    // System calls that the C library imports. The decoder calls none of them; each returns "not supported".
    const system = {};
    for (const { module, name } of WebAssembly.Module.imports(this.#module)) {
      (system[module] ??= {})[name] = () => 52;
    }
    this.#c = new WebAssembly.Instance(this.#module, system).exports;
    this.#c._initialize();
    this.#decoder = this.#c.v3d_decoder_new();
  }

  /**
   * Decodes one frame. Unless the result is OK, the current frame does not change.
   * @param {Uint8Array} bytes one compact frame
   * @returns {number}
   */
  decode(bytes) {
    try {
      const at = this.#c.malloc(bytes.length);
      if (at === 0) return OUT_OF_MEMORY;
      new Uint8Array(this.#c.memory.buffer, at, bytes.length).set(bytes);
      const status = this.#c.v3d_decoder_decode(this.#decoder, at, bytes.length);
      this.#c.free(at);
      return status;
    } catch (error) {
      if (!(error instanceof WebAssembly.RuntimeError)) throw error;
      this.#reset();
      return OUT_OF_MEMORY;
    }
  }

  /**
   * The last decoded frame; null before the first. Its arrays are views into the memory of the decoder and are valid until
   * the next call of decode(): copy what must stay.
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
      indices: new Uint32Array(memory, word(INDICES), 3 * word(TRIANGLES)),
    };
  }
}

/** Reads a NUL-terminated string. */
function text(memory, at) {
  const bytes = new Uint8Array(memory, at);
  return new TextDecoder().decode(bytes.subarray(0, bytes.indexOf(0)));
}
