// Tests of exported GLB files with Khronos' validator and three.js.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import validator from '../../tools/viewer/node_modules/gltf-validator/index.js';
import { AnimationMixer, Box3, Color, Vector3 } from '../../tools/viewer/node_modules/three/build/three.module.js';
import { MeshoptDecoder } from '../../tools/viewer/node_modules/three/examples/jsm/libs/meshopt_decoder.module.js';
import { GLTFLoader } from '../../tools/viewer/node_modules/three/examples/jsm/loaders/GLTFLoader.js';
import { USDAParser } from '../../tools/viewer/node_modules/three/examples/jsm/loaders/usd/USDAParser.js';

const CAMERAS = 4;
const folder = mkdtempSync(join(tmpdir(), 'v3d-export-'));
const run = (program, ...words) => execFileSync(join(process.env.V3D_BUILD, 'bin', program), words, { cwd: folder });
const exported = (compress, ...more) => {
  const file = `${compress}${more.join('')}.glb`;
  run('v3dctl', 'export', 'take', '--format', 'glb', '--frames', '1', '--compress', compress, ...more, file);
  return readFileSync(join(folder, file));
};

before(() => {
  run('v3d-sim', 'take', 'take', '--frames', '2', '--cameras', `${CAMERAS}`, '--size', '320x240');
  run('v3dctl', 'reconstruct', 'take', '--voxel', '30mm');
  run('v3dctl', 'track', 'take', '--triangles', '2000');
  run('v3d-sim', 'take', 'moving', '--frames', '2', '--cameras', '4', '--size', '320x240', '--begin', '0.6');
  run('v3dctl', 'reconstruct', 'moving', '--voxel', '30mm');
});
after(() => rmSync(folder, { recursive: true, force: true }));

/** Issues about extensions that the validator does not know and does not check; glb_compression_test.cc in tests/tools does. */
const EXPECTED = {
  none: [],
  draco: ['UNSUPPORTED_EXTENSION', 'UNUSED_OBJECT'],
  meshopt: ['UNSUPPORTED_EXTENSION', 'UNUSED_OBJECT'],
};

for (const compress of ['none', 'draco', 'meshopt']) {
  for (const more of [[], ['--view-dependent']]) {
    test(`${['--compress', compress, ...more].join(' ')} gives a valid file`, async () => {
      const report = await validator.validateBytes(new Uint8Array(exported(compress, ...more)), { format: 'glb', maxIssues: 0 });
      const { issues, info } = report;
      assert.equal(issues.numErrors, 0, JSON.stringify(issues.messages));
      assert.equal(issues.numWarnings, 0, JSON.stringify(issues.messages));
      const unexpected = issues.messages.filter(({ code }) => !EXPECTED[compress].includes(code));
      assert.deepEqual(unexpected, []);
      assert.ok(info.totalTriangleCount > 1000, `${info.totalTriangleCount} triangles`);
      assert.equal(info.maxAttributes, 2 + (more.length ? CAMERAS : 0));
    });
  }
}

const withTexture = async (bytes, compress) => {
  const { issues, info } = await validator.validateBytes(new Uint8Array(bytes), { format: 'glb', maxIssues: 0 });
  assert.deepEqual(issues.messages.filter(({ code }) => !EXPECTED[compress].includes(code)), []);
  assert.ok(info.hasTextures);
  assert.ok(info.totalTriangleCount > 1000, `${info.totalTriangleCount} triangles`);
  const [image] = info.resources.filter(({ mimeType }) => mimeType === 'image/jpeg');
  assert.deepEqual([image.image.width, image.image.height], [256, 256]);
};
for (const compress of ['none', 'meshopt']) {
  test(`--atlas --compress ${compress} gives a valid file with a texture`, () => withTexture(exported(compress, '--atlas', '256'), compress));
}

test('a segment of a delivery is a valid file with a texture', async () => {
  run('v3dctl', 'export', 'take', '--format', 'volume', '--atlas', '256', 'volume');
  await withTexture(readFileSync(join(folder, 'volume/segment-000.glb')), 'meshopt');
});

/** Adds an account of sound with timecode to the ledger of a take: frame 900000 at pulse 0. The ledger then has no checksum. */
const addTimecode = (take) => {
  const ledger = join(folder, take, 'ledger.toml');
  const lines = readFileSync(ledger, 'utf8').replace(/^xxh3 = .*\n/, '');
  writeFileSync(ledger, `${lines}
[[sound]]
file = 'sound/cap01.wav'
node = 'cap01'
rate_hz = 48000
map = [[0.0, 0.0], [100.0, 192000.0]]
timecode_source = 'ltc'
timecode_rate = '25'
timecode_runs = [[0.0, 900000.0, 192000.0, 900100.0]]
`);
};
const nodeExtras = (bytes) => JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12))).nodes.map(({ extras }) => extras);

test('a file with timecode is valid', async () => {
  run('v3d-sim', 'take', 'timed', '--frames', '2', '--cameras', '4', '--size', '320x240');
  run('v3dctl', 'reconstruct', 'timed', '--voxel', '30mm');
  addTimecode('timed');
  run('v3dctl', 'export', 'timed', '--format', 'glb', '--frames', '1', 'timed.glb');
  run('v3dctl', 'export', 'timed', '--format', 'glb-sequence', 'timed-all.glb');
  const [one, all] = ['timed.glb', 'timed-all.glb'].map((file) => readFileSync(join(folder, file)));
  for (const bytes of [one, all]) {
    const { issues } = await validator.validateBytes(new Uint8Array(bytes), { format: 'glb', maxIssues: 0 });
    assert.deepEqual(issues.messages, []);
  }
  assert.deepEqual(nodeExtras(one)[0], { pulse: 1, timecode: '10:00:00:01', timecode_rate: '25' });
  assert.equal(nodeExtras(all)[0].first_timecode, '10:00:00:00');
});

/** The skeleton of a take with its tracked surface. Status 3: no pulse of so short a take need show all ends of the body. */
const withSkin = (...more) => {
  const file = `skin${more.length}.glb`;
  try {
    run('v3dctl', 'skeleton', 'skinned', '--export', 'glb', ...more, file);
  } catch ({ status, stderr }) {
    assert.equal(status, 3, `${stderr}`);
  }
  return readFileSync(join(folder, file));
};

/** The first primitive of a GLB file: `values(semantic)` of a vertex attribute or 'indices', and the bytes of its image. */
const primitiveOf = (bytes) => {
  const length = bytes.readUInt32LE(12);
  const gltf = JSON.parse(bytes.subarray(20, 20 + length));
  const view = ({ byteOffset, byteLength }) => bytes.subarray(28 + length + byteOffset, 28 + length + byteOffset + byteLength);
  const [primitive] = gltf.meshes[0].primitives;
  const ARRAYS = { 5123: Uint16Array, 5125: Uint32Array };
  const values = (semantic) => {
    const accessor = gltf.accessors[semantic === 'indices' ? primitive.indices : primitive.attributes[semantic]];
    return new ARRAYS[accessor.componentType](Uint8Array.from(view(gltf.bufferViews[accessor.bufferView])).buffer);
  };
  return { values, image: () => view(gltf.bufferViews[gltf.images[0].bufferView]) };
};

test('a skeleton with its surface is a valid file, with colours of vertices or with a texture', async () => {
  const SIDE = 256;
  run('v3d-sim', 'take', 'skinned', '--frames', '3', '--cameras', '8', '--size', '320x240');
  run('v3dctl', 'reconstruct', 'skinned', '--voxel', '20mm');
  run('v3dctl', 'track', 'skinned', '--triangles', '4000');
  const [coloured, textured] = [withSkin(), withSkin('--atlas', `${SIDE}`)];
  const { issues, info } = await validator.validateBytes(new Uint8Array(coloured), { format: 'glb', maxIssues: 0 });
  assert.deepEqual(issues.messages, []);
  assert.deepEqual([info.hasTextures, info.hasSkins], [false, true]);
  await withTexture(textured, 'none');
  // At most corners of triangles, the texture has about the colour that the vertex has without a texture.
  const [plain, painted] = [coloured, textured].map(primitiveOf);
  const texels = execFileSync('ffmpeg', ['-v', 'error', '-i', '-', '-f', 'rawvideo', '-pix_fmt', 'rgb24', '-'], { input: painted.image() });
  const [vertices, colours] = [plain.values('indices'), plain.values('COLOR_0')];
  const [corners, coordinates] = [painted.values('indices'), painted.values('TEXCOORD_0')];
  assert.equal(corners.length, vertices.length);
  const differences = [...vertices].map((vertex, n) => {
    const [x, y] = [0, 1].map((k) => Math.min(SIDE - 1, Math.floor((coordinates[2 * corners[n] + k] / 65536) * SIDE)));
    const colour = new Color().fromArray(colours.slice(4 * vertex, 4 * vertex + 3), 0).multiplyScalar(1 / 65535).convertLinearToSRGB();
    const texel = texels.subarray(3 * (SIDE * y + x), 3 * (SIDE * y + x) + 3);
    return Math.max(...colour.toArray().map((value, k) => Math.abs(255 * value - texel[k])));
  });
  differences.sort((a, b) => a - b);
  const median = differences[differences.length >> 1];
  assert.ok(median < 25, `median ${median} of 255`);
});

test('the validator reports a damaged file', async () => {
  const bytes = new Uint8Array(exported('none'));
  bytes.fill(0xff, bytes.length - 12); // the last triangle
  const { issues } = await validator.validateBytes(bytes, { format: 'glb' });
  assert.ok(issues.numErrors > 0);
});

/** The surface of the first take hardly moves, so it is tracked through both pulses; that of the other changes its triangles. */
const TAKE_OF = { meshes: 'moving', tracked: 'take' };
const sequence = (surface) => {
  run('v3dctl', 'export', TAKE_OF[surface], '--format', 'glb-sequence', '--surface', surface, `${surface}.glb`);
  return readFileSync(join(folder, `${surface}.glb`));
};

for (const surface of ['meshes', 'tracked']) {
  test(`an animated sequence of ${surface} is a valid file`, async () => {
    const { issues, info } = await validator.validateBytes(new Uint8Array(sequence(surface)), { format: 'glb', maxIssues: 0 });
    assert.deepEqual(issues.messages, []);
    assert.equal(info.animationCount, 1);
    assert.equal(info.hasMorphTargets, surface === 'tracked');
  });

  test(`three.js plays a sequence of ${surface}, one pulse at a time`, async () => {
    const gltf = await parsed(sequence(surface));
    const mixer = new AnimationMixer(gltf.scene);
    mixer.clipAction(gltf.animations[0]).play();
    const boxes = [0, 1 / 25].map((time) => {
      mixer.setTime(time + 0.0001);
      gltf.scene.updateMatrixWorld(true);
      const shown = [];
      gltf.scene.traverse((object) => { if (object.isMesh && object.scale.x > 0.5) shown.push(object); });
      assert.equal(shown.length, 1, `${shown.map(({ name }) => name)}`);
      const box = new Box3();
      for (let v = 0; v < shown[0].geometry.attributes.position.count; ++v) {
        box.expandByPoint(shown[0].getVertexPosition(v, new Vector3()).applyMatrix4(shown[0].matrixWorld));
      }
      return box;
    });
    boxes.forEach((box, pulse) => {
      const expected = boundsOf(surface, pulse);
      assert.ok(box.min.distanceTo(expected.min) < 1e-3 && box.max.distanceTo(expected.max) < 1e-3,
        `pulse ${pulse}: ${JSON.stringify([box, expected])}`);
    });
  });
}

/** The extent of a pulse in the USD file of the same surfaces, with y up. */
function boundsOf(surface, pulse) {
  run('v3dctl', 'export', TAKE_OF[surface], '--format', 'usda', '--surface', surface, `${surface}.usda`);
  const extent = readFileSync(join(folder, `${surface}.usda`), 'utf8').match(/extent.timeSamples = \{([^}]*)\}/)[1];
  const [x0, y0, z0, x1, y1, z1] = extent.match(new RegExp(`${pulse}: \\[(.*)\\],`))[1].match(/[-\d.e]+/g).map(Number);
  return new Box3(new Vector3(x0, z0, -y1), new Vector3(x1, z1, -y0));
}

const parsed = (bytes) => new GLTFLoader().setMeshoptDecoder(MeshoptDecoder)
  .parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');

/** The vertices of the mesh in world coordinates with their colours, sorted by position. */
async function loaded(bytes) {
  const { scene } = await parsed(bytes);
  scene.updateMatrixWorld(true);
  let mesh;
  scene.traverse((object) => { mesh = object.isMesh ? object : mesh; });
  const { position, color, ...others } = mesh.geometry.attributes;
  const vertices = [];
  for (let v = 0; v < position.count; ++v) {
    const at = new Vector3().fromBufferAttribute(position, v).applyMatrix4(mesh.matrixWorld);
    const rgb = new Color().fromBufferAttribute(color, v);
    vertices.push([at.x, at.y, at.z, rgb.r, rgb.g, rgb.b, ...Object.keys(others).sort().flatMap((name) =>
      [others[name].getX(v), others[name].getY(v), others[name].getZ(v), others[name].getW(v)])]);
  }
  const rounded = (vertex) => vertex.slice(0, 3).map((x) => Math.round(x * 1e5));
  vertices.sort((a, b) => {
    const [p, q] = [rounded(a), rounded(b)];
    return p[0] - q[0] || p[1] - q[1] || p[2] - q[2];
  });
  return { vertices, names: Object.keys(others), triangles: mesh.geometry.index.count / 3 };
}

test('three.js reads the same mesh from a meshopt file as from an uncompressed one', async () => {
  const plain = await loaded(exported('none', '--view-dependent'));
  const compressed = await loaded(exported('meshopt', '--view-dependent'));
  assert.equal(compressed.triangles, plain.triangles);
  assert.equal(compressed.vertices.length, plain.vertices.length);
  assert.equal(plain.names.length, CAMERAS, `${plain.names}`);
  const differences = plain.vertices.map((vertex, v) => Math.max(...vertex.map((x, k) => Math.abs(x - compressed.vertices[v][k]))));
  assert.ok(Math.max(...differences) < 1e-5, `${Math.max(...differences)}`);
  const heights = plain.vertices.map((vertex) => vertex[1]);
  assert.ok(Math.max(...heights) - Math.min(...heights) > 1.2, 'the person is upright, with y up');
});

/** The values at `offset`, `offset` + 3, ... in ascending order. */
const ascending = (values, offset) => values.filter((_, i) => i % 3 === offset).sort((a, b) => a - b);

test('the USD parser of three.js reads the points and triangles of each pulse', async () => {
  run('v3dctl', 'export', 'moving', '--format', 'usda', '--surface', 'meshes', 'parsed.usda');
  const { specsByPath } = new USDAParser().parseData(readFileSync(join(folder, 'parsed.usda'), 'utf8'));
  const samples = (name) => specsByPath[`/take/surface.${name}`].fields.timeSamples;
  for (const name of ['points', 'faceVertexCounts', 'faceVertexIndices']) assert.deepEqual(samples(name).times, [0, 1], name);
  for (const pulse of [0, 1]) {
    run('v3dctl', 'export', 'moving', '--format', 'glb', '--frames', `${pulse}`, `moving-${pulse}.glb`);
    const glb = await loaded(readFileSync(join(folder, `moving-${pulse}.glb`)));
    const points = samples('points').values[pulse];
    assert.equal(points.length, 3 * glb.vertices.length);
    const upright = glb.vertices.flatMap(([x, y, z]) => [x, -z, y]); // GLB has y up
    for (const axis of [0, 1, 2]) {
      const expected = ascending(upright, axis);
      const differences = ascending(points, axis).map((value, i) => Math.abs(value - expected[i]));
      assert.ok(Math.max(...differences) < 1e-5, `axis ${axis}: ${Math.max(...differences)}`);
    }
    const corners = samples('faceVertexIndices').values[pulse];
    assert.equal(corners.length, 3 * glb.triangles);
    assert.equal(samples('faceVertexCounts').values[pulse].length, glb.triangles);
    assert.equal(Math.max(...corners), glb.vertices.length - 1);
  }
});
