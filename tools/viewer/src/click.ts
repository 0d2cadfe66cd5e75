// Clicks on the stage: presses of the main button that do not move.

/** Largest movement of a click, CSS pixels. */
const STILL_PX = 4;

/**
 * Calls `clicked` at the end of each click with what `begin` returned at its start. Other listeners of the canvas may move the
 * viewpoint at the start; `begin` is called before them.
 */
export function onClicks<T>(canvas: HTMLCanvasElement, begin: (across: number, down: number) => T, clicked: (began: T) => void): void {
  let pressed: { id: number; x: number; y: number; began: T } | null = null;
  canvas.addEventListener('pointerdown', (event) => {
    const others = pressed !== null || !event.isPrimary || event.button !== 0;
    const box = canvas.getBoundingClientRect();
    const at = () => begin((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    pressed = others ? null : { id: event.pointerId, x: event.clientX, y: event.clientY, began: at() };
  }, { capture: true });
  addEventListener('pointerup', (event) => {
    const of = pressed;
    pressed = null;
    if (of?.id !== event.pointerId || Math.hypot(event.clientX - of.x, event.clientY - of.y) > STILL_PX) return;
    clicked(of.began);
  });
  addEventListener('pointercancel', () => (pressed = null));
}
