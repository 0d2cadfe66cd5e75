// The choice between the meshes of the open take and their proxy, which is smaller and faster to draw.
import { press } from './page';
import type { Take } from './take_list';

export type MeshFile = 'mesh.v3d' | 'proxy.v3d';

/** A take with a proxy is shown by it until the user chooses the other file; the choice holds for all takes opened later. */
export class ProxyChoice {
  private wantsProxy = true;
  private take: Take | null = null;

  /** `button` is shown for takes with a proxy; `onChange` is called after a click that changes the file. */
  constructor(private readonly button: HTMLElement, private readonly onChange: () => void) {
    button.addEventListener('click', () => this.toggle());
  }

  /** To call for each opened take; null: something else is open. `wish`: master or proxy, of the page's address; null: neither. */
  open(take: Take | null, wish: string | null = null): void {
    this.take = take;
    if (wish === 'master' || wish === 'proxy') this.wantsProxy = wish === 'proxy';
    this.draw();
  }

  get isOn(): boolean {
    return this.hasProxy && this.wantsProxy;
  }

  get file(): MeshFile {
    return this.isOn ? 'proxy.v3d' : 'mesh.v3d';
  }

  toggle(): void {
    if (!this.hasProxy) return;
    this.wantsProxy = !this.wantsProxy;
    this.draw();
    this.onChange();
  }

  private get hasProxy(): boolean {
    return this.take !== null && this.take.proxy_bytes > 0;
  }

  private draw(): void {
    this.button.hidden = !this.hasProxy;
    press(this.button, this.isOn);
  }
}
