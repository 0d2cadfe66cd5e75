// Tests of exported GLB files with Khronos' validator and three.js.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, before, test } from 'node:test';
import validator from '../../tools/viewer/node_modules/gltf-validator/index.js';
import { Color, Vector3 } from '../../tools/viewer/node_modules/three/build/three.module.js';
import { MeshoptDecoder } from '../../tools/viewer/node_modules/three/examples/jsm/libs/meshopt_decoder.module.js';
import { GLTFLoader } from '../../tools/viewer/node_modules/three/examples/jsm/loaders/GLTFLoader.js';

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

test('the validator reports a damaged file', async () => {
  const bytes = new Uint8Array(exported('none'));
  bytes.fill(0xff, bytes.length - 12); // the last triangle
  const { issues } = await validator.validateBytes(bytes, { format: 'glb' });
  assert.ok(issues.numErrors > 0);
});

/** The vertices of the mesh in world coordinates with their colours, sorted by position. */
async function loaded(bytes) {
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  const { scene } = await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
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
