// Usage: node decode.mjs MODULE FRAMES. Decodes the frames of file FRAMES in order; each is its length (u32) and its bytes.
// For each, it writes to the standard output the status, the passes (u8 each) and the arrays of the last decoded frame.
import { readFileSync, writeSync } from 'node:fs';
import { Decoder } from '../../codec/v3d_decoder.mjs';

const [module, file] = process.argv.slice(2);
const decoder = new Decoder(await WebAssembly.compile(readFileSync(module)));
decoder.wantViews(true);
const bytes = readFileSync(file);
const write = (array) => {
  const pending = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  for (let at = 0; at < pending.length; ) at += writeSync(1, pending, at);
};
for (let at = 0; at < bytes.length; ) {
  const end = at + 4 + bytes.readUInt32LE(at);
  write(new Uint8Array([decoder.decode(bytes.subarray(at + 4, end))]));
  at = end;
  const frame = decoder.frame();
  write(new Uint8Array([frame?.livePasses ?? 0]));
  if (frame) for (const array of [frame.positions, frame.indices, frame.colours, frame.labels]) if (array) write(array);
  for (const view of frame?.views ?? []) write(view.colours);
}
