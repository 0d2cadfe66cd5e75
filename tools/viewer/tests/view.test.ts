import { PerspectiveCamera, Vector3, Vector4 } from 'three';
import { afterEach, describe, expect, it, vi } from 'vitest';
import { parseAddress } from '../src/address';
import { Fly } from '../src/fly';
import { frameFacts, liveTexts, MAX_LIVE_AGE_MS } from '../src/facts';
import { factsOf, gradeCamera } from '../src/node_health';
import { eachForegroundRun, MessageClock, type NodeState, ServerClock, splitMessage } from '../src/message';
import { centerOf, projectionOf, type RigCamera, worldFromCamera } from '../src/rig';
import { vertexNormals } from '../player/src/surface';
import type { ShownFrame } from '../player/src/worker_messages';
import { aboutText, slateText, type Take } from '../src/take_list';

const camera: RigCamera = {
  name: 'cam07',
  width: 1024,
  height: 768,
  matrix: [[900, 0, 500], [0, 910, 390], [0, 0, 1]],
  distortion: [],
  rotation: [[0, 1, 0], [0, 0, -1], [-1, 0, 0]], // looks along -x, upright
  translation: [0.1, 1, 3],
};

describe('the facts of a live mesh', () => {
  const live = { take: 'kendo-06', missing: [], edgeMs: 0, skipped: 0 };
  const frame = { pulse: 7, indices: new Uint32Array(3), tracked: null, bytes: 0, quality: NaN, live } as unknown as ShownFrame;

  it('have its latency while meshes come, and its age afterwards', () => {
    expect(frameFacts(frame, 25, 71, 0.04)).toContain('<b>71 ms</b> behind the pulse');
    const old = frameFacts(frame, 0, 71, 12);
    expect(old).toContain('no mesh for <b>12 s</b>');
    expect(old.join()).not.toContain('behind');
  });
});

describe('the clock of a server', () => {
  it('is known by its fastest message', () => {
    const clock = new MessageClock();
    expect(clock.at(0)).toBeNull();
    clock.add(100_050, 1000); // sent at 950, by our clock
    clock.add(102_000, 2900);
    clock.add(103_000, 9000); // late by 5 s
    expect(clock.at(10_000)).toBe(109_100);
  });
});

describe('the address of the viewer', () => {
  it('states a take with its pulse and file, a scene with its time, or the live picture', () => {
    const nothing = { live: false, take: null, pulse: NaN, mesh: null, scene: null, at: NaN };
    expect(parseAddress('')).toEqual(nothing);
    expect(parseAddress('#live')).toEqual({ ...nothing, live: true });
    expect(parseAddress('#take=kendo-07&pulse=0&mesh=master')).toEqual({ ...nothing, take: 'kendo-07', pulse: 0, mesh: 'master' });
    expect(parseAddress('#scene=duel&at=2.5')).toEqual({ ...nothing, scene: 'duel', at: 2.5 });
    expect(parseAddress('#take=&pulse=')).toEqual(nothing);
  });
});

describe('the viewpoint of a camera', () => {
  /** Pixels of a screen. */
  function onScreen(point: number[], width: number, height: number): [number, number] {
    const eye = worldFromCamera(camera).invert();
    const clip = new Vector4(...point, 1).applyMatrix4(eye).applyMatrix4(projectionOf(camera, width, height, 0.02, 200));
    return [(0.5 + clip.x / clip.w / 2) * width, (0.5 - clip.y / clip.w / 2) * height];
  }
  /** Pixels of the image, by OpenCV's model. */
  function inImage(point: number[]): [number, number] {
    const [x, y, z] = [0, 1, 2].map((row) =>
      camera.rotation[row].reduce((sum, r, k) => sum + r * point[k], camera.translation[row]));
    return [900 * (x / z) + 500, 910 * (y / z) + 390];
  }

  for (const [width, height] of [[1024, 768], [512, 384], [1920, 1080], [600, 900]]) {
    it(`shows each point where its image has it, on ${width} x ${height}`, () => {
      const scale = Math.min(width / 1024, height / 768);
      for (const point of [[0, 0, 1], [0.3, -0.5, 1.7], [-1, 0.4, 0.2]]) {
        const [u, v] = inImage(point);
        const [x, y] = onScreen(point, width, height);
        expect(x).toBeCloseTo((u + 0.5) * scale + (width - 1024 * scale) / 2, 3);
        expect(y).toBeCloseTo((v + 0.5) * scale + (height - 768 * scale) / 2, 3);
      }
    });
  }

  it('is at its optical centre', () => {
    expect(centerOf(camera).distanceTo(new Vector3(3, -0.1, 1))).toBeLessThan(1e-12);
  });
});

describe('normals', () => {
  it('point away from the side that triangles turn about counter-clockwise', () => {
    const square = new Float32Array([0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 9, 9, 9]);
    const normals = vertexNormals(square, new Uint32Array([0, 1, 2, 0, 2, 3]));
    expect([...normals]).toEqual([0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1]);
  });
});

describe('messages', () => {
  function message(json: string, bytes: number[]): ArrayBuffer {
    const text = new TextEncoder().encode(json);
    const all = new Uint8Array(4 + text.length + bytes.length);
    new DataView(all.buffer).setUint32(0, text.length, true);
    all.set(text, 4);
    all.set(bytes, 4 + text.length);
    return all.buffer;
  }

  it('have a head and bytes', () => {
    const split = splitMessage<{ type: string }>(message('{"type":"mesh"}', [7, 8]));
    expect(split?.head.type).toBe('mesh');
    expect([...split!.bytes]).toEqual([7, 8]);
  });

  it('are ignored when they are malformed', () => {
    expect(splitMessage(new ArrayBuffer(2))).toBeNull();
    expect(splitMessage(message('{', []))).toBeNull();
    const long = message('{}', []);
    new DataView(long).setUint32(0, 1e9, true);
    expect(splitMessage(long)).toBeNull();
  });

  it('carry masks as runs', () => {
    const found: number[][] = [];
    eachForegroundRun(Uint8Array.of(3, 2, 0x80, 0x01, 5), (first, length) => found.push([first, length]));
    expect(found).toEqual([[3, 2], [133, 5]]);
    found.length = 0;
    eachForegroundRun(Uint8Array.of(0x81, 0x01, 4), (first, length) => found.push([first, length]));
    expect(found).toEqual([[129, 4]]);
  });

  it('give the time of the server by the fastest of the last pings', () => {
    const clock = new ServerClock();
    expect(clock.at(0)).toBeNull();
    clock.add(100, 5100, 104);
    clock.add(200, 5900, 900);
    expect(clock.at(1000)).toBe(5998);
    clock.add(1000, 7000, 1010); // the server's clock was set
    expect(clock.at(1000)).toBe(6995);
    clock.add(1100, 3600_000, 1900); // a slower ping, and the page's clock stood still
    expect(clock.at(1500)).toBe(3600_000);
  });
});

describe('the studio in words', () => {
  const node = (values: Record<string, number>, more: Partial<NodeState> = {}): NodeState =>
    ({ name: 'cap01', heard: true, cameras: ['cam01'], state: 'recording', values, ...more });
  const well = { 'cam01.streaming_flag': 1, 'cam01.frames': 9 };

  it('names the worst fault of a camera', () => {
    expect(gradeCamera('cam01', node(well), undefined)).toEqual({ grade: 'good', text: 'follows every pulse' });
    expect(gradeCamera('cam01', node({ ...well, 'cam01.frames_suspect': 2, 'cam01.frames_missing': 1 }), undefined))
      .toEqual({ grade: 'alarm', text: '1 frame missing' });
    expect(gradeCamera('cam01', node({ 'cam01.streaming_flag': 0 }), undefined).text).toBe('does not stream');
    expect(gradeCamera('cam01', node({}, { heard: false }), undefined).text).toBe('cap01 is silent');
    const recon = node({ 'cam01.drift_px': 2.3 }, { name: 'recon01' });
    expect(gradeCamera('cam01', node(well), recon).text).toContain('silhouettes shifted by 2.3 px');
  });

  it('omits unreported values', () => {
    expect(factsOf(node({}))).toEqual([]);
    expect(factsOf(node({ disk_seconds_left: 30 }))).toEqual([{ name: 'disk for', value: '30 s', grade: 'alarm' }]);
  });

  it('shows the levels of the sound and what is wrong with it', () => {
    const open = { sound_open_flag: 1, sound_peak_1_db: -20.4, sound_peak_2_db: -12 };
    expect(factsOf(node(open))).toEqual([{ name: 'sound', value: '-20, -12 dB', grade: 'good' }]);
    expect(factsOf(node({ ...open, sound_peak_2_db: 0 }))).toEqual([{ name: 'sound', value: '-20, 0 dB', grade: 'good' }]);
    const faults = { sound_xruns: 2, sound_channels_clipping: 1, sound_channels_silent: 3, sound_timecode_jumps: 1 };
    expect(factsOf(node({ ...open, ...faults })).slice(1)).toEqual([
      { name: 'sound clips', value: '1 channel', grade: 'warning' }, { name: 'sound silent', value: '3 channels', grade: 'warning' },
      { name: 'sound lost', value: '2 xruns', grade: 'warning' }, { name: 'timecode in', value: '1 jump', grade: 'warning' }]);
    expect(factsOf(node({ sound_open_flag: 0 }))).toEqual([{ name: 'sound', value: 'the device is not open', grade: 'warning' }]);
  });

  it('shows the state of the timecode output', () => {
    const shown = (open: number, underruns: number) =>
      factsOf(node({ timecode_output_open_flag: open, timecode_output_underruns: underruns }));
    expect(shown(1, 0)).toEqual([{ name: 'timecode', value: 'plays', grade: 'good' }]);
    expect(shown(1, 1)).toEqual([{ name: 'timecode', value: '1 underrun', grade: 'warning' }]);
    expect(shown(0, 0)).toEqual([{ name: 'timecode', value: 'the device is not open', grade: 'warning' }]);
  });

  it('shows the scene of the lamps', () => {
    const shown = (connected: number, take: number) =>
      factsOf(node({ lights_connected_flag: connected, take_light_flag: take }));
    expect(shown(1, 0)).toEqual([{ name: 'lights', value: 'work', grade: 'good' }]);
    expect(shown(1, 1)).toEqual([{ name: 'lights', value: 'take', grade: 'good' }]);
    expect(shown(0, 0)).toEqual([{ name: 'lights', value: 'not connected', grade: 'warning' }]);
  });

  it('formats a slate', () => {
    expect(slateText({ scene: '12', take: '3', note: '', mark: 'circled' })).toBe('scene 12, take 3');
  });

  it('describes a take by slate, timecode and meshes', () => {
    const take = {
      slate: { scene: '12', take: '3', note: '', mark: '' }, timecode: '10:00:59;28 to 10:01:00;03', meshes: 9, mesh_bytes: 2000, proxy_bytes: 0,
    } as Take;
    expect(aboutText(take)).toBe('scene 12, take 3 · timecode 10:00:59;28 to 10:01:00;03 · 9 meshes, 2.0 kB');
    const { timecode: _, ...without } = take;
    expect(aboutText({ ...without, meshes: 0 })).toBe('scene 12, take 3 · no meshes');
  });
});

describe('the live picture', () => {
  it('is called live while meshes arrive', () => {
    expect(liveTexts('kendo-06', 0)).toEqual({ title: 'Live: kendo-06', trouble: '' });
    expect(liveTexts('kendo-06', MAX_LIVE_AGE_MS).trouble).toBe('');
  });

  it('is not called live after its take has ended', () => {
    const { title, trouble } = liveTexts('kendo-06', MAX_LIVE_AGE_MS + 1);
    expect(title).toBe('Last live mesh: kendo-06');
    expect(trouble).toContain('kendo-06');
    expect(trouble).toContain('has ended');
  });
});

describe('fly controls', () => {
  afterEach(() => vi.unstubAllGlobals());

  it('ignore keys that are typed in a field', () => {
    const page = new EventTarget();
    vi.stubGlobal('addEventListener', page.addEventListener.bind(page));
    const fly = new Fly(new PerspectiveCamera(), new EventTarget() as HTMLCanvasElement);
    fly.on = true;
    const press = (tagName: string) => {
      const event = Object.assign(new Event('keydown'), { code: 'KeyW', key: 'w', ctrlKey: false, metaKey: false });
      Object.defineProperty(event, 'target', { value: { tagName } });
      page.dispatchEvent(event);
    };
    press('INPUT');
    expect(fly.move(0.1)).toBe(false);
    press('CANVAS');
    expect(fly.move(0.1)).toBe(true);
  });
});
