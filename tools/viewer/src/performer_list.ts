// The performers of a take: buttons that hide them, and the file of what is visible.
import { BufferAttribute, BufferGeometry, Mesh, MeshStandardMaterial } from 'three';
import { GLTFExporter } from 'three/addons/exporters/GLTFExporter.js';
import { download } from './page';
import { indicesOf, performersOf, type Surface } from '../player/src/surface';

export class PerformerList {
  private readonly hidden = new Set<number>();
  private known: number[] = [];
  /** The take of the last surface, where that was live. */
  private live: string | null = null;

  /** `changed`: another set of performers is visible. */
  constructor(
    private readonly section: HTMLElement,
    private readonly changed: () => void,
  ) {}

  /**
   * To call for each shown surface; `live`: the take of a live one. A performer stays in the list while the take is open, or while
   * it is recorded: the next live take numbers its performers from 1.
   */
  add(surface: Surface, live: string | null = null): void {
    if (live !== this.live) this.clear();
    this.live = live;
    const fresh = performersOf(surface).filter((performer) => !this.known.includes(performer));
    if (fresh.length === 0) return;
    this.known = [...this.known, ...fresh].sort((a, b) => a - b);
    this.draw();
  }

  clear(): void {
    this.known = [];
    this.hidden.clear();
    this.draw();
  }

  shows(performer: number): boolean {
    return !this.hidden.has(performer);
  }

  /** The surface without hidden performers. What belongs to no known performer stays. */
  visible<T extends Surface>(surface: T): T {
    if (this.hidden.size === 0) return surface;
    return { ...surface, indices: indicesOf(surface, (performer) => !this.hidden.has(performer)) };
  }

  /** Saves what is visible of a shown pulse as a file. */
  async save(surface: (Surface & { pulse: number }) | null): Promise<void> {
    if (surface) download(await glbOf(this.visible(surface)), `pulse-${surface.pulse}.glb`);
  }

  private draw(): void {
    this.section.hidden = this.known.length === 0;
    const rows = this.known.map((performer) => {
      const row = document.createElement('div');
      row.append(
        this.button(`Performer ${performer}`, 'Show or hide', () => this.toggle(performer), !this.hidden.has(performer)),
        this.button('Only', `Show performer ${performer} alone`, () => this.only(performer), null),
      );
      row.dataset.performer = String(performer);
      return row;
    });
    this.section.querySelector('.performers')!.replaceChildren(...rows);
  }

  private button(text: string, title: string, click: () => void, pressed: boolean | null): HTMLButtonElement {
    const button = document.createElement('button');
    button.textContent = text;
    button.title = title;
    if (pressed !== null) button.ariaPressed = String(pressed);
    button.addEventListener('click', click);
    return button;
  }

  private toggle(performer: number): void {
    if (!this.hidden.delete(performer)) this.hidden.add(performer);
    this.draw();
    this.changed();
  }

  private only(performer: number): void {
    this.hidden.clear();
    for (const other of this.known) if (other !== performer) this.hidden.add(other);
    this.draw();
    this.changed();
  }
}

/** The surface as a binary glTF file: y up, linear colours. Vertices without a triangle are left out. */
export async function glbOf(surface: Surface): Promise<Blob> {
  const geometry = new BufferGeometry();
  const corners = Array.from(new Set(surface.indices));
  const numbers = new Map(corners.map((vertex, n) => [vertex, n]));
  const positions = new Float32Array(3 * corners.length), colours = new Float32Array(3 * corners.length).fill(0.45);
  corners.forEach((vertex, n) => {
    positions.set([surface.positions[3 * vertex], surface.positions[3 * vertex + 2], -surface.positions[3 * vertex + 1]], 3 * n);
    if (surface.colours) colours.set([0, 1, 2].map((channel) => linear(surface.colours![3 * vertex + channel] / 255)), 3 * n);
  });
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  geometry.setAttribute('color', new BufferAttribute(colours, 3));
  geometry.setIndex(new BufferAttribute(surface.indices.map((vertex) => numbers.get(vertex)!), 1));
  const mesh = new Mesh(geometry, new MeshStandardMaterial({ vertexColors: true, roughness: 1, metalness: 0 }));
  const file = await new GLTFExporter().parseAsync(mesh, { binary: true });
  geometry.dispose();
  return new Blob([file as ArrayBuffer], { type: 'model/gltf-binary' });
}

/** sRGB to linear light, both 0 to 1. */
const linear = (value: number) => (value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4);
