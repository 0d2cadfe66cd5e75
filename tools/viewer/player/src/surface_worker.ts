// Requests to the decoding worker, and its answers.
import decoderUrl from 'v3d_decoder.wasm?url';
import { completed } from './surface';
import type { FromWorker, SegmentShape, ShownFrame, ToWorker, TrackedSegment } from './worker_messages';

export interface OpenedFile {
  /** Pulses that have a surface, ascending. */
  pulses: number[];
  /** Segments of a motion file; none for a mesh file. */
  segments: SegmentShape[];
}

/** One file, fetched and decoded in a worker of its own. */
export class SurfaceWorker {
  private readonly worker = new Worker(new URL('./worker.ts', import.meta.url), { type: 'module' });
  private segment: TrackedSegment | null = null;
  private opening: { resolve(file: OpenedFile): void; reject(error: Error): void } | null = null;

  /** `onFrame`: a surface; null: the surface of that number is damaged. `onTrouble`: no further surface follows. */
  constructor(
    private readonly onFrame: (number: number, frame: ShownFrame | null) => void,
    private readonly onTrouble: (text: string) => void,
  ) {
    this.worker.onmessage = (event: MessageEvent<FromWorker>) => this.onMessage(event.data);
    this.worker.onerror = () => this.fail('The worker of the player could not start; expected its files beside the module, of the same origin.');
    this.send({ kind: 'decoder', url: new URL(decoderUrl, import.meta.url).href });
  }

  /** Rejects with a message when the file cannot be opened. `kind`: mesh.v3d or motion.v3d. */
  open(url: string, kind: 'take' | 'tracked', deadlineMs: number): Promise<OpenedFile> {
    return new Promise((resolve, reject) => {
      this.opening = { resolve, reject };
      this.send({ kind, take: 0, url, deadlineMs });
    });
  }

  /** Requests a surface by its number in the file. It replaces a request that has not started. */
  want(frame: number): void {
    this.send({ kind: 'want', frame });
  }

  end(): void {
    this.worker.terminate();
  }

  private send(message: ToWorker): void {
    this.worker.postMessage(message);
  }

  private fail(text: string): void {
    if (this.opening) this.opening.reject(new Error(text));
    else this.onTrouble(text);
    this.opening = null;
  }

  private onMessage(message: FromWorker): void {
    switch (message.kind) {
      case 'opened':
        this.opening?.resolve(message);
        this.opening = null;
        break;
      case 'segment':
        this.segment = message.segment;
        break;
      case 'frame': {
        const { frame } = message;
        this.onFrame(frame.number, frame.tracked && this.segment ? completed(frame, this.segment) : frame);
        break;
      }
      case 'no-surface':
        this.onFrame(message.number, null);
        break;
      case 'trouble':
        this.fail(message.text);
        break;
      case 'motion-trouble':
        if (message.fatal) this.fail(message.text);
        break;
    }
  }
}
