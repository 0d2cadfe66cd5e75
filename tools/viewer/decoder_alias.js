import { fileURLToPath } from 'node:url';

// CMake builds the decoder and passes its path; unit tests do not need it.
const decoder = process.env.V3D_DECODER_WASM ?? fileURLToPath(new URL('../../build/release/codec/v3d_decoder.wasm', import.meta.url));

export const decoderAlias = { 'v3d_decoder.wasm?url': `${decoder}?url` };
