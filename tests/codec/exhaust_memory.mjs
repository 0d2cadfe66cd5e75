// Usage: node exhaust_memory.mjs MODULE FRAMES. Fails unless a decoder whose memory was exhausted starts anew. FRAMES: as of
// decode.mjs; the first is a key frame, the second needs it.
import { strict as assert } from 'node:assert';
import { readFileSync } from 'node:fs';
import { Decoder, NEEDS_REFERENCE, OK, OUT_OF_MEMORY } from '../../codec/v3d_decoder.mjs';

const [module, file] = process.argv.slice(2);
const decoder = new Decoder(await WebAssembly.compile(readFileSync(module)));
const bytes = readFileSync(file);
const frames = [];
for (let at = 0; at < bytes.length; ) {
  const end = at + 4 + bytes.readUInt32LE(at);
  frames.push(bytes.subarray(at + 4, end));
  at = end;
}
assert.equal(decoder.decode(frames[0]), OK);
// More than the memory of the module can hold. The bytes are never read, so the system reserves no memory for them.
assert.equal(decoder.decode(new Uint8Array(2_200_000_000)), OUT_OF_MEMORY);
assert.equal(decoder.frame(), null);
assert.equal(decoder.decode(frames[1]), NEEDS_REFERENCE);
assert.equal(decoder.decode(frames[0]), OK);
assert.equal(decoder.decode(frames[1]), OK);
assert.notEqual(decoder.frame(), null);
