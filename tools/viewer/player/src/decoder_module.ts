// The decoder's WebAssembly module, fetched when it is first needed.
import { fetchWithin, statusError, Unavailable } from './byte_source';

/**
 * Returns a function that fetches and compiles the decoder once. After a failure, its next call fetches it again. It rejects with
 * Unavailable where that may succeed.
 */
export function decoderModule(url: string): () => Promise<WebAssembly.Module> {
  let module: Promise<WebAssembly.Module> | null = null;
  const load = () => fetchWithin(url, {}, Infinity, (response) => {
    if (!response.ok) throw statusError(response.status);
    return WebAssembly.compileStreaming(response);
  });
  return () => (module ??= load().catch((error) => {
    module = null;
    if (error instanceof Unavailable) throw error;
    throw new Error(`The decoder cannot be loaded (${(error as Error).message}); reload the page.`);
  }));
}
