// Loss of a canvas's WebGL context: a tablet slept, or the graphics driver was reset. The browser may give it back.

/**
 * Calls `lost` when the context has been lost for `afterMs`, and `restored` when the browser has given it back: everything is then to
 * be drawn again. To call after the renderer was made, which also listens. Returns a function that ends this.
 */
export function watchContext(canvas: EventTarget, afterMs: number, lost: () => void, restored: () => void): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const end = () => clearTimeout(timer);
  const onLost = () => (timer = setTimeout(lost, afterMs));
  const onRestored = () => {
    end();
    restored();
  };
  canvas.addEventListener('webglcontextlost', onLost);
  canvas.addEventListener('webglcontextrestored', onRestored);
  return () => {
    end();
    canvas.removeEventListener('webglcontextlost', onLost);
    canvas.removeEventListener('webglcontextrestored', onRestored);
  };
}
