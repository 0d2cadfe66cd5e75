import { describe, expect, it } from 'vitest';
import { Troubles } from '../src/troubles';

describe('the error texts of the page', () => {
  const shown: string[] = [];
  const troubles = new Troubles((text) => shown.push(text));

  it('stay until their own source removes them', () => {
    troubles.set('sound', 'cap01.wav: is no 24-bit PCM');
    troubles.set('frames', 'Mesh 7 of this take is damaged.');
    troubles.set('frames', '');
    expect(shown.at(-1)).toBe('cap01.wav: is no 24-bit PCM');
    troubles.set('sound', '');
    expect(shown.at(-1)).toBe('');
  });

  it('are shown once while they do not change', () => {
    shown.length = 0;
    for (let n = 0; n < 10; ++n) {
      troubles.set('sound', 'The server answered 503.');
      troubles.set('frames', '');
    }
    expect(shown).toEqual(['The server answered 503.']);
    troubles.set('frames', 'The server answered 503.');
    expect(shown.at(-1)).toBe('The server answered 503.');
  });

  it('of a scene are removed together', () => {
    troubles.set('scene: a/mesh.v3d', 'There is no take a.');
    troubles.set('scene: b.glb', 'The model b.glb does not exist.');
    troubles.clear('scene');
    expect(shown.at(-1)).toBe('The server answered 503.');
    troubles.clear();
    expect(shown.at(-1)).toBe('');
  });
});
