import { describe, expect, it } from 'vitest';
import { ErrorTexts } from '../src/error_texts';

describe('the error texts of the page', () => {
  const shown: string[] = [];
  const texts = new ErrorTexts((text) => shown.push(text));

  it('stay until their own source removes them', () => {
    texts.set('sound', 'cap01.wav: is no 24-bit PCM');
    texts.set('frames', 'Mesh 7 of this take is damaged.');
    texts.set('frames', '');
    expect(shown.at(-1)).toBe('cap01.wav: is no 24-bit PCM');
    texts.set('sound', '');
    expect(shown.at(-1)).toBe('');
  });

  it('of the page itself stay when something else is opened', () => {
    texts.set('page: graphics', 'The graphics card has lost the picture.');
    texts.set('frames', 'Mesh 7 of this take is damaged.');
    texts.clear();
    expect(shown.at(-1)).toBe('The graphics card has lost the picture.');
    texts.set('page: graphics', '');
    expect(shown.at(-1)).toBe('');
  });

  it('are shown once while they do not change', () => {
    shown.length = 0;
    for (let n = 0; n < 10; ++n) {
      texts.set('sound', 'The server answered 503.');
      texts.set('frames', '');
    }
    expect(shown).toEqual(['The server answered 503.']);
    texts.set('frames', 'The server answered 503.');
    expect(shown.at(-1)).toBe('The server answered 503.');
  });

  it('of a scene are removed together', () => {
    texts.set('scene: a/mesh.v3d', 'There is no take a.');
    texts.set('scene: b.glb', 'The model b.glb does not exist.');
    texts.clear('scene');
    expect(shown.at(-1)).toBe('The server answered 503.');
    texts.clear();
    expect(shown.at(-1)).toBe('');
  });
});
