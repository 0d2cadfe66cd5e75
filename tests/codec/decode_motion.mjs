// Usage: node decode_motion.mjs MODULE FILE. Decodes a motion file. For each segment it writes to the standard output the
// arrays of the template, then for each pulse, the last one first, its number (f64) and its arrays.
import { readFileSync, writeSync } from 'node:fs';
import { Motion } from '../../codec/v3d_decoder.mjs';

const [module, file] = process.argv.slice(2);
const motion = new Motion(await WebAssembly.compile(readFileSync(module)), readFileSync(file));
const write = (...arrays) => {
  for (const array of arrays) {
    if (!array) continue;
    const pending = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    for (let at = 0; at < pending.length; ) at += writeSync(1, pending, at);
  }
};
motion.segments.forEach((segment, number) => {
  write(new Float64Array([segment.key, segment.vertices, segment.triangles, segment.stepM, ...segment.pulses]));
  const surface = motion.surface(number);
  write(surface.positions, surface.colours, surface.indices);
  for (let index = segment.pulses.length; index-- > 0; ) {
    const pulse = motion.decode(number, index);
    write(new Float64Array([pulse.pulse]), pulse.positions, pulse.colours, pulse.confidences);
  }
});
