import { describe, expect, it } from 'vitest';
import { isForElement } from '../src/keys';

describe('the keys', () => {
  it('Space and Enter press a button that was reached by the keyboard, and play after a click on it', () => {
    for (const control of ['BUTTON', 'SUMMARY']) {
      for (const key of [' ', 'Enter']) {
        expect(isForElement(key, control, true), `${key} on ${control}`).toBe(true);
        expect(isForElement(key, control, false), `${key} on ${control}`).toBe(false);
      }
    }
    expect(isForElement(' ', 'CANVAS', true)).toBe(false);
    expect(isForElement(' ', 'BODY', true)).toBe(false);
  });

  it('with other effects stay shortcuts on a button', () => {
    for (const key of ['ArrowLeft', 'Shift+ArrowRight', 'Home', 'x', '1']) expect(isForElement(key, 'BUTTON', true)).toBe(false);
  });

  it('are no shortcuts in a field, and change the value of a list', () => {
    for (const key of [' ', 'x', 'ArrowLeft']) expect(isForElement(key, 'INPUT', false)).toBe(true);
    for (const key of [' ', 'Enter', 'ArrowDown']) expect(isForElement(key, 'SELECT', false)).toBe(true);
    expect(isForElement('x', 'SELECT', false)).toBe(false);
  });
});
