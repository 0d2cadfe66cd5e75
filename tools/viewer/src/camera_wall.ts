// Cards of all cameras, each with its last preview and its state.
import { gradeCamera, valueOf } from './node_health';
import { eachForegroundRun, type NodeState, type PreviewHead } from './message';

const OUTLINE = [227, 168, 87];

interface Card {
  root: HTMLElement;
  canvas: HTMLCanvasElement;
  rate: HTMLElement;
  text: HTMLElement;
  preview: { head: PreviewHead; picture: ImageBitmap; mask: Uint8Array | null } | null;
}

/** A mask as one byte a pixel. */
function maskOf(head: PreviewHead, runs: Uint8Array): Uint8Array | null {
  if (head.runs === 0) return null;
  const mask = new Uint8Array(head.width * head.height);
  eachForegroundRun(runs, (first, length) => mask.fill(1, first, first + length));
  return mask;
}

/** The pixels of the silhouette that touch the background. */
function isRim(mask: Uint8Array, at: number, width: number): boolean {
  return mask[at] === 1 && !(mask[at - 1] && mask[at + 1] && mask[at - width] && mask[at + width]);
}

export class CameraWall {
  private readonly cards = new Map<string, Card>();
  /** Cameras of the last state; null before the first. */
  private named: Set<string> | null = null;
  private masked = true;

  constructor(private readonly root: HTMLElement) {}

  set silhouettes(on: boolean) {
    this.masked = on;
    for (const card of this.cards.values()) this.draw(card);
  }
  get silhouettes(): boolean {
    return this.masked;
  }

  /** Updates all cards, and removes those of other cameras, as after a change of the studio file. Returns the numbers of cameras, and of those without a fault. */
  setState(nodes: NodeState[]): { all: number; well: number } {
    const recon = nodes.find((node) => node.program === 'v3d-recond');
    let well = 0;
    const named = (this.named = new Set(nodes.flatMap(({ cameras }) => cameras)));
    for (const camera of [...this.cards.keys()]) if (!named.has(camera)) this.remove(camera);
    for (const node of nodes) {
      for (const camera of node.cameras) {
        const card = this.card(camera);
        const { grade, text } = gradeCamera(camera, node, recon);
        if (grade === 'good') ++well;
        card.root.className = `camera ${grade}`;
        card.text.textContent = text;
        const rate = valueOf(node, `${camera}.frames_per_second`);
        const exposure = valueOf(node, `${camera}.exposure_us`);
        const parts = [rate ? `${rate.toFixed(1)}/s` : '', exposure ? `${(exposure / 1000).toFixed(2)} ms` : ''];
        const frames = valueOf(node, `${camera}.frames`);
        parts.push(frames ? frames.toLocaleString('en') : '');
        card.rate.textContent = parts.filter(Boolean).join(' · ');
      }
    }
    return { all: this.cards.size, well };
  }

  async setPreview(head: PreviewHead, bytes: Uint8Array): Promise<void> {
    const jpeg = new Blob([bytes.slice(head.runs)], { type: 'image/jpeg' });
    const picture = await createImageBitmap(jpeg).catch(() => null);
    if (!picture) return;
    if (this.named && !this.named.has(head.camera)) return picture.close();
    const card = this.card(head.camera);
    card.preview?.picture.close();
    card.preview = { head, picture, mask: maskOf(head, bytes.subarray(0, head.runs)) };
    this.draw(card);
  }

  private remove(camera: string): void {
    const card = this.cards.get(camera)!;
    this.cards.delete(camera);
    card.root.remove();
    card.preview?.picture.close();
  }

  private draw(card: Card): void {
    if (!card.preview) return;
    const { head, picture, mask } = card.preview;
    card.canvas.width = head.width;
    card.canvas.height = head.height;
    const pen = card.canvas.getContext('2d', { willReadFrequently: true })!;
    pen.drawImage(picture, 0, 0);
    if (!this.masked || !mask) return;
    const image = pen.getImageData(0, 0, head.width, head.height);
    for (let at = 0; at < mask.length; ++at) {
      if (isRim(mask, at, head.width)) image.data.set(OUTLINE, 4 * at);
      else if (!mask[at]) for (let c = 0; c < 3; ++c) image.data[4 * at + c] *= 0.6;
    }
    pen.putImageData(image, 0, 0);
  }

  private card(camera: string): Card {
    const known = this.cards.get(camera);
    if (known) return known;
    const root = document.createElement('article');
    root.className = 'camera';
    const canvas = document.createElement('canvas');
    const line = document.createElement('div');
    line.className = 'line';
    const name = document.createElement('b');
    name.textContent = camera;
    const rate = document.createElement('span');
    const text = document.createElement('p');
    line.append(name, rate);
    root.append(canvas, line, text);
    const card: Card = { root, canvas, rate, text, preview: null };
    this.cards.set(camera, card);
    const order = [...this.cards.keys()].sort();
    const next = order[order.indexOf(camera) + 1];
    this.root.insertBefore(root, next ? this.cards.get(next)!.root : null);
    return card;
  }
}
