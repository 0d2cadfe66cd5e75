// Worker that fetches and decodes surfaces: those of a take in any order, or live meshes as they arrive.
import moduleUrl from 'v3d_decoder.wasm?url';
import { Decoder } from '../../../codec/v3d_decoder.mjs';
import { decoderModule } from '../player/src/decoder_module';
import { errorMessage, TakeWork } from '../player/src/take_work';
import type { FromWorker, ToWorker } from '../player/src/worker_messages';
import { LiveWork } from './live_work';

const wasm = decoderModule(moduleUrl);
wasm().catch(() => undefined); // reported where the decoder is used
const post = (message: FromWorker, moved: Transferable[] = []) => self.postMessage(message, { transfer: moved });

let work: TakeWork | LiveWork | null = null;
let viewsWanted = false;

self.onmessage = (event: MessageEvent<ToWorker>) => {
  const message = event.data;
  if (message.kind === 'want') return work?.want(message.frame);
  if (message.kind === 'drawn') return work instanceof LiveWork ? work.drawn() : undefined;
  if (message.kind === 'motion') return work?.setMotion(message.url);
  if (message.kind === 'points') return work?.setPoints(message.points);
  if (message.kind === 'views') {
    viewsWanted = message.wanted;
    return work?.wantViews(viewsWanted);
  }
  work?.end();
  work = null;
  if (message.kind === 'take') work = new TakeWork(wasm, post, message.take, message.url);
  else if (message.kind === 'live') work = new LiveWork(async () => new Decoder(await wasm()), post, message.take, message.url);
  else return;
  work.wantViews(viewsWanted);
  work.open().catch((error) => post(errorMessage(message.take, error)));
};
