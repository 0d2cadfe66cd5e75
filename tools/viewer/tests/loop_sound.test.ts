import { describe, expect, it } from 'vitest';
import { DeliverySound, pictureRate } from '../player/src/delivery_sound';
import { loopDistance, withLength } from '../player/src/loop_sound';

class FakeBuffer {
  readonly channels: Float32Array[];
  constructor(readonly numberOfChannels: number, readonly length: number, readonly sampleRate: number) {
    this.channels = Array.from({ length: numberOfChannels }, () => new Float32Array(length));
  }
  getChannelData = (channel: number) => this.channels[channel];
  copyToChannel = (values: Float32Array, channel: number) => this.channels[channel].set(values);
}
const context = { createBuffer: (...of: [number, number, number]) => new FakeBuffer(...of) } as unknown as BaseAudioContext;
const buffer = (...values: number[]) => {
  const filled = new FakeBuffer(1, values.length, 48_000);
  filled.channels[0].set(values);
  return filled as unknown as AudioBuffer;
};
const withSamples = (sound: AudioBuffer, samples: number) => Array.from(withLength(context, sound, samples).getChannelData(0));

describe('the sound of a loop', () => {
  it('has exactly the samples of a pass', () => {
    expect(withSamples(buffer(1, 2, 3, 4), 3)).toEqual([1, 2, 3]);
    expect(withSamples(buffer(1, 2), 4)).toEqual([1, 2, 0, 0]);
    expect(withSamples(buffer(1, 2), 2)).toEqual([1, 2]);
  });

  it('is before or after a picture, also over the end of a pass', () => {
    expect(loopDistance(0.2, 0.5, 2)).toBeCloseTo(0.3);
    expect(loopDistance(0.5, 0.2, 2)).toBeCloseTo(-0.3);
    expect(loopDistance(1.9, 0.1, 2)).toBeCloseTo(0.2);
    expect(loopDistance(0.1, 1.9, 2)).toBeCloseTo(-0.2);
  });

  it('is followed by pictures that play faster or slower, within limits', () => {
    expect(pictureRate(0.019, 0.04)).toBe(1);
    expect(pictureRate(0.1, 0.04)).toBeCloseTo(1.2);
    expect(pictureRate(-0.1, 0.04)).toBeCloseTo(0.8);
    expect(pictureRate(0.4, 0.04)).toBe(1.25);
    expect(pictureRate(-3, 0.04)).toBe(0.75);
  });
});

describe('the sound of a delivery', () => {
  it('is that of the video without a loop, and in browsers without Web Audio', () => {
    const video = { muted: false, volume: 1, currentTime: 0, playbackRate: 1 } as HTMLVideoElement;
    const sound = new DeliverySound({ video, url: 'http://localhost/a.mp4', seconds: 2, pulseSeconds: 0.04, deadlineMs: 1000 });
    expect(sound.muted).toBe(true);
    Object.assign(sound, { loop: true, muted: false, volume: 0.5, playing: true });
    expect(video).toMatchObject({ muted: false, volume: 0.5, playbackRate: 1 });
    expect(sound.restart).toBe(0);
    sound.muted = true;
    expect(video.muted).toBe(true);
  });
});
