// Worker of the player: fetches and decodes the surfaces of one file at a time.
import { decoderModule } from './decoder_module';
import { errorMessage, TakeWork } from './take_work';
import type { FromWorker, ToWorker } from './worker_messages';

const post = (message: FromWorker, moved: Transferable[] = []) => self.postMessage(message, { transfer: moved });

let wasm: () => Promise<WebAssembly.Module>;
let work: TakeWork | null = null;

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  if (message.kind === 'decoder') {
    wasm = decoderModule(message.url);
    wasm().catch(() => undefined); // reported where the decoder is used
    return;
  }
  if (message.kind === 'want') return work?.want(message.frame);
  work?.end();
  work = null;
  if (message.kind !== 'take' && message.kind !== 'tracked') return;
  work = new TakeWork(wasm, post, message.take, message.url, message.deadlineMs);
  const opened = message.kind === 'take' ? work.open() : work.openMotion();
  opened.catch((error) => post(errorMessage(message.take, error)));
};
