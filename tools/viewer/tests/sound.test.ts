import { afterEach, describe, expect, it, vi } from 'vitest';
import type { ByteSource } from '../player/src/byte_source';
import { partOf, SoundClock } from '../src/sound_clock';
import { SoundOutput, SoundPlayer } from '../src/sound_player';
import { dataOffset, sampleOf, type SoundFile, SoundSource, stereoOf } from '../src/sound_file';

/** 24-bit samples, interleaved. */
function pcm(values: number[]): Uint8Array {
  const bytes = new Uint8Array(3 * values.length);
  values.forEach((value, n) => {
    const view = new DataView(bytes.buffer, 3 * n);
    view.setUint16(0, value & 0xffff, true);
    view.setInt8(2, value >> 16);
  });
  return bytes;
}

function chunk(name: string, content: Uint8Array): number[] {
  const size = new Uint8Array(4);
  new DataView(size.buffer).setUint32(0, content.length, true);
  return [...[...name].map((c) => c.charCodeAt(0)), ...size, ...content, ...(content.length % 2 ? [0] : [])];
}

function format(channels: number, bits = 24): Uint8Array {
  const content = new Uint8Array(16);
  const view = new DataView(content.buffer);
  view.setUint16(0, 1, true);
  view.setUint16(2, channels, true);
  view.setUint32(4, 48000, true);
  view.setUint16(14, bits, true);
  return content;
}

const wave = (channels: number, values: number[], bits = 24) => {
  const chunks = [...chunk('bext', new Uint8Array(603)), ...chunk('fmt ', format(channels, bits)), ...chunk('data', pcm(values))];
  return new Uint8Array([...[...'RIFF'].map((c) => c.charCodeAt(0)), 0, 0, 0, 0, ...[...'WAVE'].map((c) => c.charCodeAt(0)), ...chunks]);
};

/** A file in memory that counts its requests. */
class Bytes implements ByteSource {
  requests = 0;
  constructor(private readonly bytes: Uint8Array) {}
  size = async () => this.bytes.length;
  read = async (first: number, size: number) => {
    ++this.requests;
    return this.bytes.slice(first, first + size);
  };
}

const FILE: SoundFile = { file: 'sound/cap01.wav', rate_hz: 48000, channels: 1, samples: 4, audible: [1], map: [[0, 0], [1, 2]] };

describe('the map of pulses', () => {
  it('is linear between its knots and beyond them', () => {
    const map: [number, number][] = [[0, 100], [10, 200], [20, 400]];
    expect(sampleOf(map, 5)).toBe(150);
    expect(sampleOf(map, 10)).toBe(200);
    expect(sampleOf(map, 15)).toBe(300);
    expect(sampleOf(map, -1)).toBe(90);
    expect(sampleOf(map, 21)).toBe(420);
  });
});

describe('a sound file', () => {
  it('has 24-bit samples: odd channels on the left, even ones on the right', () => {
    const { left, right } = stereoOf(pcm([4194304, -8388608, 1, -4194304, 0, 2]), 3, [1, 2]);
    expect([...left]).toEqual([0.5, -0.5]);
    expect([...right]).toEqual([-1, 0]);
  });
  it('has a single audible channel on both sides', () => {
    const { left, right } = stereoOf(pcm([1, 4194304]), 2, [2]);
    expect([...left]).toEqual([0.5]);
    expect([...right]).toEqual([0.5]);
  });
  it('is read by ranges, silent before and after it', async () => {
    const bytes = new Bytes(wave(1, [1048576, 2097152, 3145728, 4194304]));
    const source = new SoundSource(FILE, bytes);
    expect([...(await source.read(-1, 2)).left]).toEqual([0, 0.125, 0.25]);
    expect([...(await source.read(2, 6)).left]).toEqual([0.375, 0.5, 0, 0]);
    expect([...(await source.read(9, 11)).left]).toEqual([0, 0]);
    expect(bytes.requests).toBe(3); // the header once
  });
  it('is read again after a request for its header has failed', async () => {
    const bytes = new Bytes(wave(1, [1048576]));
    const source = new SoundSource(FILE, bytes);
    const { read } = bytes;
    bytes.read = async () => { throw new Error('The server answered 503.'); };
    await expect(source.read(0, 1)).rejects.toThrow('503');
    bytes.read = read;
    expect([...(await source.read(0, 1)).left]).toEqual([0.125]);
  });
  it('is rejected when it has another format', () => {
    expect(() => dataOffset(new Uint8Array(100), 1)).toThrowError('is no WAV file');
    expect(() => dataOffset(wave(2, []), 1)).toThrowError('has other channels than the ledger');
    expect(() => dataOffset(wave(1, [], 16), 1)).toThrowError('is no 24-bit PCM');
    expect(() => dataOffset(wave(1, []).subarray(0, 300), 1)).toThrowError('has no samples in its first bytes');
  });
});

describe('the clock of the sound', () => {
  it('starts where the playback is, and does not start again while both advance', () => {
    const clock = new SoundClock(25);
    expect(clock.follow(10, 3)).toBe(true);
    expect(clock.timeOf(35)).toBe(4);
    for (let n = 1; n < 50; ++n) expect(clock.follow(10 + n, 3 + 0.04 * n)).toBe(false);
  });
  it('starts again at once after a jump, as at the end of a loop', () => {
    const clock = new SoundClock(25);
    clock.follow(50, 1);
    expect(clock.follow(10, 1.01)).toBe(true);
    expect(clock.anchor).toEqual({ pulse: 10, at_s: 1.01 });
  });
  it('does not start again for single late pictures', () => {
    const clock = new SoundClock(25);
    clock.follow(0, 0);
    for (let n = 1; n < 30; ++n) expect(clock.follow(n, 0.04 * n + (n % 3 === 0 ? 0.015 : 0))).toBe(false);
  });
  it('starts again once when it stays 10 ms away', () => {
    const clock = new SoundClock(25);
    clock.follow(0, 0);
    const restarts = Array.from({ length: 30 }, (_, k) => clock.follow(1 + k, 0.04 * (1 + k) + 0.01));
    expect(restarts.filter(Boolean)).toHaveLength(1);
    expect(clock.timeOf(100)).toBeCloseTo(4.01, 9);
  });
});

describe('a part of a file', () => {
  const file = { rate_hz: 48000, samples: 480000 };
  const fast = (pulse: number) => 0.5 + pulse * 1921; // the clock of the sound is 521 ppm fast
  it('has the samples of its pulses, and the speed that keeps it in step', () => {
    const part = partOf(file, fast, 10, 20, 25)!;
    expect(part.first).toBe(19210);
    expect(part.offset_s).toBeCloseTo(0.5 / 48000, 12);
    expect(part.seconds).toBeCloseTo(0.4 * (1921 / 1920), 12);
    expect(part.speed).toBeCloseTo(1921 / 1920, 12);
    expect(part.end).toBeGreaterThanOrEqual(fast(20));
  });
  it('does not exist outside of the file', () => {
    expect(partOf(file, fast, 300, 310, 25)).toBeNull();
    expect(partOf(file, (pulse) => pulse * 1920 - 1e6, 0, 10, 25)).toBeNull();
    expect(partOf(file, (pulse) => pulse * 1e9, 0, 10, 25)).toBeNull(); // a damaged map
  });
});

describe('the sound of a take', () => {
  afterEach(() => vi.unstubAllGlobals());
  /** A running output whose sources and gains are of the class `Node`. The test sets its time. */
  const outputWith = (Node: unknown) => {
    vi.stubGlobal('AudioBuffer', class {
      copyToChannel = () => undefined;
    });
    vi.stubGlobal('AudioBufferSourceNode', Node);
    vi.stubGlobal('GainNode', Node);
    return { context: { currentTime: 0 }, isRunning: () => true, heardAt: (now: number) => now / 1000 };
  };

  it('asks the browser once for sound, and again after each gesture', async () => {
    const answers: (() => void)[] = [];
    const context = { state: 'suspended', resume: () => new Promise<void>((done) => answers.push(done)) };
    vi.stubGlobal('AudioContext', function () {
      return context;
    });
    const gestures = new EventTarget();
    const output = new SoundOutput(gestures);
    const player = new SoundPlayer(output, [new SoundSource(FILE, new Bytes(wave(1, [0])))], 25, () => undefined);
    const play = (pictures: number) => {
      for (let n = 0; n < pictures; ++n) player.follow({ exact: n, playing: true, speed: 1, outPulse: 249 }, 16 * n);
    };
    gestures.dispatchEvent(new Event('click')); // without sound, nothing is asked for
    expect(answers).toHaveLength(0);
    play(600);
    expect(player.state).toBe('blocked');
    expect(answers).toHaveLength(1);
    gestures.dispatchEvent(new Event('pointerup'));
    play(600);
    expect(answers).toHaveLength(2);
    context.state = 'running';
    for (const answer of answers) answer();
    await Promise.resolve();
    expect(output.isRunning()).toBe(true);
    gestures.dispatchEvent(new Event('click'));
    expect(answers).toHaveLength(2);
    context.state = 'suspended'; // the loudspeaker was taken away
    play(600);
    expect(answers).toHaveLength(3);
  });

  it('reports a failure once, and removes it when a part can be read again', async () => {
    class Node {
      connect = () => this;
      start = () => undefined;
      stop = () => undefined;
    }
    const output = outputWith(Node);
    const bytes = new Bytes(wave(1, Array(4800).fill(0)));
    const { read } = bytes;
    bytes.read = async () => { throw new Error('The server answered 503.'); };
    const source = new SoundSource({ ...FILE, rate_hz: 480, samples: 4800, map: [[0, 0], [250, 4800]] }, bytes);
    const troubles: string[] = [];
    const player = new SoundPlayer(output as unknown as SoundOutput, [source], 25, (text) => troubles.push(text));
    /** Plays two seconds, in steps of a picture. */
    const play = async (from: number) => {
      for (let n = 0; n < 50; ++n) {
        output.context.currentTime = (from + n) / 25;
        player.follow({ exact: from + n, playing: true, speed: 1, outPulse: 249 }, 40 * (from + n));
        await new Promise((done) => setTimeout(done));
      }
    };
    await play(0);
    expect(troubles).toEqual(['sound/cap01.wav: The server answered 503.']);
    expect(player.state).toBe('failed');
    bytes.read = read;
    await play(50);
    expect(troubles.at(-1)).toBe('');
    expect(player.state).toBe('playing');
  });

  it('plays a short part from each new position while scrubbing, at most every 40 ms', async () => {
    const starts: { at: number; offset: number; seconds: number }[] = [];
    class Node {
      gain = { setValueCurveAtTime: () => undefined };
      connect = () => this;
      start = (at: number, offset: number, seconds: number) => starts.push({ at, offset, seconds });
      stop = () => undefined;
    }
    const output = outputWith(Node);
    const file = { ...FILE, rate_hz: 480, samples: 4800, map: [[0, 0], [250, 4800]] as [number, number][] };
    const source = new SoundSource(file, new Bytes(wave(1, Array(4800).fill(0))));
    const player = new SoundPlayer(output as unknown as SoundOutput, [source], 25, () => undefined);
    const show = async (exact: number, currentTime: number, scrubbing = true) => {
      output.context.currentTime = currentTime;
      player.follow({ exact, playing: false, speed: 1, outPulse: 249, scrubbing }, 1000 * currentTime);
      for (let n = 0; n < 5; ++n) await new Promise((done) => setTimeout(done));
      return starts.length;
    };
    expect(await show(3, 0)).toBe(0); // the take was opened there
    expect(await show(3, 0.02)).toBe(0);
    expect(await show(14, 0.04)).toBe(1);
    expect(starts[0].at).toBe(0.04);
    expect(starts[0].offset).toBeCloseTo(1.5 / 25, 6); // in the part from pulse 12.5 on
    expect(starts[0].seconds).toBeCloseTo(0.06, 6);
    expect(await show(15, 0.06)).toBe(1); // too soon
    expect(await show(15, 0.09)).toBe(2);
    expect(await show(15, 0.2)).toBe(2);
    expect(await show(17, 0.3, false)).toBe(2); // the sound is switched off
    expect(await show(17, 0.4)).toBe(2);
    expect(player.state).toBe('off');
  });
});
