import { Line2 } from 'three/addons/lines/Line2.js';
import { describe, expect, it } from 'vitest';
import { type Bend, editedFrames, editFile, operationOf, readOperations, shareAt, skinAt, turnAt, turnedPose, turnedSurface } from '../src/bend';
import { aboutAxis, poseDistance, product, type Quaternion, similarPoses, turnCurves, turnsOf } from '../src/pose';
import { parseSkeleton, type Pose, type Skeleton } from '../src/skeleton_file';
import { SkeletonOverlay } from '../src/skeleton_overlay';

const base64 = (bytes: number[]) => btoa(String.fromCharCode(...bytes));

/** Three joints on the x axis, 0, 1 and 2 metres from the pelvis, at two pulses; a skin of three vertices. */
const file = () => ({
  format: 'v3d-skeleton', version: 1, rate_hz: 25, stature_m: 1.7,
  joints: [{ name: 'pelvis', parent: null }, { name: 'left_hip', parent: 'pelvis', bone_m: 1 },
    { name: 'left_knee', parent: 'left_hip', bone_m: 1 }] as unknown[],
  pulses: [3, 4].map((pulse) => ({
    pulse, positions: [[0, 0, 1], [1, 0, 1], [2, 0, 1]], rotations: Array.from({ length: 3 }, () => [1, 0, 0, 0]), confidences: [1, 0.5, 0],
  })) as unknown[],
  skins: [{ pulses: [3, 4], vertices: 3, weights: base64([0, 0, 0, 0, 255, 0, 0, 0, 0, 1, 0, 0, 155, 100, 0, 0, 2, 0, 0, 0, 255, 0, 0, 0]) }],
});
const skeleton = (): Skeleton => parseSkeleton(JSON.stringify(file()));
const message = (changes: object) => {
  try {
    parseSkeleton(JSON.stringify({ ...file(), ...changes }));
    return '';
  } catch (error) {
    return (error as Error).message;
  }
};
const pulse = (changes: object) => ({ pulses: [{ ...(file().pulses[0] as object), ...changes }] });
const skin = (changes: object) => ({ skins: [{ ...file().skins[0], ...changes }] });

describe('skeleton.json', () => {
  it('has joints with the numbers of their parents, poses and weights', () => {
    const { joints, poses, skins } = skeleton();
    expect(joints.map(({ parent }) => parent)).toEqual([-1, 0, 1]);
    expect([...poses[1].positions.subarray(3, 6)]).toEqual([1, 0, 1]);
    expect([...skins[0].joints.subarray(4, 8), ...skins[0].weights.subarray(4, 8)]).toEqual([0, 1, 0, 0, 155, 100, 0, 0]);
    expect([...skins[0].parts]).toEqual([0, 1, 2]);
  });

  it('needs no skin', () => {
    expect(parseSkeleton(JSON.stringify({ ...file(), skins: undefined })).skins).toEqual([]);
  });

  it('is rejected with the field and what would be right', () => {
    expect(message({ format: 'v3d-edit' })).toBe('format: expected "v3d-skeleton"');
    expect(message({ version: 2 })).toBe('version: expected a number from 1.0 to 1.0');
    expect(message({ joints: [] })).toBe('joints: expected 1 to 255 joints');
    expect(message({ joints: [{ name: 'a', parent: 'b' }] })).toBe('joints[0].parent: expected the name of a joint before this one, or null');
    expect(message({ joints: [{ name: 'a', parent: null }, { name: 'a', parent: null }] })).toContain('joints[1].name: expected a name');
    expect(message({ joints: [{ name: 'a', parent: 'a' }] })).toContain('joints[0].parent: expected');
    expect(message(pulse({ positions: [[0, 0, 0]] }))).toBe('pulses[0].positions: expected an entry for each of the 3 joints');
    expect(message(pulse({ positions: [[0, 0, 0], [0, 0], [0, 0, 0]] }))).toContain('pulses[0].positions[1]: expected 3 numbers');
    expect(message(pulse({ positions: [[0, 0, 0], [0, 0, 1e300], [0, 0, 0]] }))).toContain('pulses[0].positions[1]: expected 3 numbers');
    expect(message(pulse({ rotations: Array.from({ length: 3 }, () => [0, 0, 0, 0]) }))).toBe('pulses[0].rotations: expected unit quaternions');
    expect(message(pulse({ confidences: [1, 1, 2] }))).toContain('pulses[0].confidences: expected 3 numbers from 0 to 1');
    expect(message({ pulses: [file().pulses[1], file().pulses[0]] })).toContain('pulses[1].pulse: expected a later pulse');
    expect(message(pulse({ pulse: -1 }))).toContain('pulses[0].pulse: expected the number of a pulse');
    expect(message({ pulses: {} })).toBe('pulses: expected a list');
    expect(message(skin({ vertices: 4 }))).toBe('skins[0].weights: expected 8 bytes for each vertex');
    expect(message(skin({ vertices: 1e9 }))).toContain('skins[0].vertices: expected a number from 0.0 to 524288.0');
    expect(message(skin({ weights: '%' }))).toBe('skins[0].weights: expected base64');
    expect(message(skin({ vertices: 1, weights: base64([0, 0, 0, 3, 200, 0, 0, 55]) }))).toContain('vertex 0 has joint 3, but there are 3');
    expect(message(skin({ vertices: 1, weights: base64([0, 0, 0, 0, 200, 0, 0, 0]) }))).toContain('the sum 200; expected 255');
    expect(message(skin({ pulses: [] }))).toBe('skins[0].pulses: expected at least one pulse');
    expect(message({ extra: 1 })).toBe("there is no key 'extra'");
    expect(() => parseSkeleton('{')).toThrowError('is no JSON');
    expect(() => parseSkeleton('[]')).toThrowError('expected an object');
  });
});

describe('a damaged skeleton.json', () => {
  it('with skins of more frames than the page can hold is rejected, also when each skin is small', () => {
    const skins = (...ranges: number[][]) => ({ skins: ranges.map((pulses) => ({ pulses, vertices: 0, weights: '' })) });
    const rejected = 'pulses: expected at most 1000000 frames in all skins';
    expect(message(skins([0, 999_999]))).toBe('');
    expect(message(skins([0, 1_000_000]))).toBe(`skins[0].${rejected}`);
    expect(message(skins([3, Number.MAX_SAFE_INTEGER]))).toBe(`skins[0].${rejected}`);
    expect(message(skins([0, 599_999], [0, 599_999]))).toBe(`skins[1].${rejected}`);
  });

  it('is read or rejected with a message, whatever its bytes', () => {
    const text = JSON.stringify(file());
    let state = 1;
    const random = (below: number) => (state = (state * 48_271) % 2_147_483_647) % below; // Park and Miller
    const pieces = ['', '0', '-1', '1e999', 'null', '{}', '[]', '"', ',', '[', '"pelvis"', '99999999999'];
    let rejected = 0;
    for (let n = 0; n < 3000; ++n) {
      const at = random(text.length);
      const damaged = text.slice(0, at) + pieces[random(pieces.length)] + text.slice(at + random(12));
      try {
        parseSkeleton(damaged);
      } catch (error) {
        expect([damaged, (error as Error).constructor]).toEqual([damaged, Error]); // no TypeError
        ++rejected;
      }
    }
    expect(rejected).toBeGreaterThan(1000);
  });
});

describe('the turns of a joint', () => {
  const degrees = (radians: number) => (radians * Math.PI) / 180;
  const pose = (rotation: Quaternion): Pose =>
    ({ ...skeleton().poses[0], rotations: Float64Array.of(1, 0, 0, 0, ...rotation, 1, 0, 0, 0) });

  it('are those about y, then x, then z, against the parent', () => {
    const [y, x, z] = [aboutAxis([0, 1, 0], degrees(-40)), aboutAxis([1, 0, 0], degrees(20)), aboutAxis([0, 0, 1], degrees(10))];
    const turns = turnsOf(pose(product(y, product(x, z))), 1, 0);
    [-40, 20, 10].forEach((turn, k) => expect(turns[k]).toBeCloseTo(turn, 9));
  });

  it('do not jump by a whole turn', () => {
    const poses = [170, 179, 188].map((turn) => pose(aboutAxis([0, 1, 0], degrees(turn))));
    expect(turnCurves({ ...skeleton(), poses }, 1).map(([turn]) => Math.round(turn))).toEqual([170, 179, 188]);
  });
});

describe('similar poses', () => {
  const moved = (at: Float64Array, turn: number, by: number[]) => {
    const result = at.slice();
    for (let n = 0; n < at.length; n += 3) {
      result[n] = Math.cos(turn) * at[n] - Math.sin(turn) * at[n + 1] + by[0];
      result[n + 1] = Math.sin(turn) * at[n] + Math.cos(turn) * at[n + 1] + by[1];
      result[n + 2] = at[n + 2] + by[2];
    }
    return result;
  };
  const body = Float64Array.of(0, 0, 1, 0.3, 0.1, 1.4, -0.2, 0.4, 0.5);

  it('may have another place on the floor and another heading, but not another height', () => {
    expect(poseDistance(body, moved(body, 2.1, [3, -4, 0]), 3)).toBeCloseTo(0, 7);
    expect(poseDistance(body, moved(body, 2.1, [3, -4, 0.2]), 3)).toBeCloseTo(0.2, 7);
  });

  it('have a distance in the unit of the joints', () => {
    const other = body.slice();
    other[8] += 0.3;
    expect(poseDistance(body, other, 3)).toBeCloseTo(0.3 / Math.sqrt(3), 9);
  });

  it('are the nearest ones, apart from one another', () => {
    const { joints, poses: [first], skins } = skeleton();
    const heights = [0, 0.01, 0.02, 0.2, 0.02, 0.011, 0.012, 0.4];
    const poses = heights.map((height, n) => ({ ...first, pulse: 10 + n, positions: moved(first.positions, n, [n, 0, height]) }));
    const found = similarPoses({ joints, poses, skins }, 10, 2);
    expect(found.map(({ pulse }) => pulse)).toEqual([15, 12]);
    expect(found[0].metres).toBeCloseTo(0.011, 7);
    expect(similarPoses({ joints, poses, skins }, 99, 2)).toEqual([]);
  });
});

describe('a bend', () => {
  const bend: Bend = { joint: 1, degrees: 90, axis: [0, 1, 0], first: 10, end: 20, ramp: 3 };

  it('grows at both ends of its frames as that of v3dctl edit', () => {
    expect([9, 10, 13, 16, 19, 20].map((frame) => shareAt(bend, frame))).toEqual([0, 0.15625, 1, 1, 0.15625, 0]);
    expect(shareAt({ ...bend, ramp: 0 }, 10)).toBe(1);
  });

  it('turns the joint and its descendants, and the surface by its weights', () => {
    const { joints, poses: [pose], skins: [weights] } = skeleton();
    const turn = turnAt(pose, bend, 1);
    const turned = turnedPose(pose, joints, 1, turn);
    const near = (values: ArrayLike<number>, wanted: number[]) => wanted.forEach((value, n) => expect(values[n]).toBeCloseTo(value, 6));
    near(turned.positions, [0, 0, 1, 1, 0, 1, 1, 0, 0]);
    near(turned.rotations.subarray(8), [Math.SQRT1_2, 0, Math.SQRT1_2, 0]);
    const surface = turnedSurface(Float32Array.of(0, 0, 1, 2, 0, 1, 2, 0, 1), weights, joints, 1, turn);
    const share = 100 / 255;
    near(surface, [0, 0, 1, 2 - share, 0, 1 - share, 1, 0, 0]);
  });

  it('numbers the frames of surfaces with a skin from 0', () => {
    const one = skeleton();
    const [first] = one.skins;
    const skins = [{ ...first, pulses: [5, 6, 7] }, { ...first, pulses: [7, 8], vertices: 8 }];
    expect(editedFrames({ ...one, skins })).toEqual([5, 6, 7, 8]);
    expect(skinAt({ ...one, skins }, 7, 8)).toBe(skins[1]);
    expect(skinAt({ ...one, skins }, 6, 8)).toBeNull();
  });

  it('numbers lost pulses inside a surface, and none between two surfaces', () => {
    const one = skeleton();
    const [first] = one.skins;
    const skins = [{ ...first, pulses: [4, 6, 9] }, { ...first, pulses: [12, 13], vertices: 8 }];
    expect(editedFrames({ ...one, skins })).toEqual([4, 5, 6, 7, 8, 9, 12, 13]);
  });

  it('is an operation that follows those of an edited take', () => {
    const operation = operationOf(bend, skeleton().joints);
    expect(JSON.parse(editFile([operation]))).toEqual({ format: 'v3d-edit', version: 1, operations: [
      { do: 'bend', joint: 'left_hip', degrees: 90, axis: [0, 1, 0], frames: [10, 20], ramp: 3 }] });
    const before = readOperations('{"format": "v3d-edit", "version": 1, "operations": [{"do": "mirror"}]}');
    expect(JSON.parse(editFile([...before, operation])).operations).toEqual([{ do: 'mirror' }, operation]);
  });

  it('follows no other file than an edit file', () => {
    expect(() => readOperations('{}')).toThrowError("'format' is missing");
    expect(() => readOperations('{"format": "v3d-scene"}')).toThrowError('format: expected "v3d-edit"');
    expect(() => readOperations('{"format": "v3d-edit", "operations": 1}')).toThrowError('operations: expected a list');
  });
});

describe('the drawn skeleton', () => {
  it('moves its bones in the same buffers', () => {
    const overlay = new SkeletonOverlay();
    const { joints, poses } = skeleton();
    const [first] = poses;
    const raised = { ...first, positions: first.positions.map((value, n) => (n % 3 === 2 ? value + 0.5 : value)) };
    const bones = () => overlay.group.children.filter((child) => child instanceof Line2)
      .map((bone) => bone.geometry.getAttribute('instanceStart') as unknown as { data: { array: Float32Array } });
    overlay.show([{ joints, pose: first, chosen: -1 }]);
    const before = bones();
    expect(before).toHaveLength(2);
    overlay.show([{ joints, pose: raised, chosen: -1 }]);
    expect(bones()).toEqual(before);
    bones().forEach((bone, n) => expect(bone.data).toBe(before[n].data));
    expect([...bones()[0].data.array]).toEqual([0, 0, 1.5, 1, 0, 1.5]);
  });
});
