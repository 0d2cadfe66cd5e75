// The page's worker, which fetches and decodes.
import type { FromWorker } from '../player/src/worker_messages';

/**
 * Starts a worker. `failed` gets a text for the page when its file cannot be loaded: the network had a gap, or the server has files of
 * another version since an update.
 */
export function startWorker(message: (message: FromWorker) => void, failed: (text: string) => void): Worker {
  const worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module' });
  worker.onmessage = (event: MessageEvent<FromWorker>) => message(event.data);
  worker.onerror = () => failed('A worker of this page could not start, or has failed: reload the page.');
  return worker;
}
