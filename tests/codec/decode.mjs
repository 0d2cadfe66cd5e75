// usage: node decode.mjs MODULE FRAMES: decodes the frames of a file, one after the other. A frame in the file: its length
// (u32), its bytes. Of each, to the standard output: the status (u8), and the arrays of the frame decoded last.
import { readFileSync, writeSync } from 'node:fs';
import { Decoder } from '../../codec/v3d_decoder.mjs';

const [module, file] = process.argv.slice(2);
const decoder = new Decoder(await WebAssembly.compile(readFileSync(module)));
const bytes = readFileSync(file);
const write = (array) => {
  const rest = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
  for (let at = 0; at < rest.length; ) at += writeSync(1, rest, at);
};
for (let at = 0; at < bytes.length; ) {
  const end = at + 4 + bytes.readUInt32LE(at);
  write(new Uint8Array([decoder.decode(bytes.subarray(at + 4, end))]));
  at = end;
  const frame = decoder.frame();
  if (frame) for (const array of [frame.positions, frame.indices, frame.colours]) if (array) write(array);
}
