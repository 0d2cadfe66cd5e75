// List of the studio's takes and scenes in the side bar.
import { fetchJson } from './request';

/** The server gives up after 10 s. */
const MAX_RESPONSE_MS = 15_000;

export interface Take {
  name: string;
  studio: string;
  started_ns: number;
  state: 'recording' | 'edited' | 'incomplete' | 'recovered' | 'complete';
  verified: boolean;
  rate_hz: number;
  pulses: number;
  seconds: number;
  bytes: number;
  mesh_bytes: number;
  /** 0: the take has no proxy.v3d. */
  proxy_bytes: number;
  cameras: string[];
  /** null: mesh.v3d cannot be read, for the reason `mesh_error`. */
  meshes: number | null;
  mesh_error?: string;
  /** Why another file of the take cannot be read, such as a slate with a typing error. */
  error?: string;
  /** Of the first and the last pulse: "10:00:00:00 to 10:01:00:00"; missing where it is unknown. */
  timecode?: string;
  slate: { scene: string; take: string; note: string; mark: '' | 'circled' | 'rejected' };
}

async function fetchList<T>(url: string): Promise<T> {
  const list = await fetchJson<T>(url, { cache: 'no-cache', signal: AbortSignal.timeout(MAX_RESPONSE_MS) });
  if (list === null) throw new Error('The server answered 404.');
  return list;
}

/** The newest first. Throws a message for the user, a Refusal if it is from the server. */
export async function fetchTakes(): Promise<Take[]> {
  return (await fetchList<{ takes: Take[] }>('api/takes')).takes.reverse();
}

export function formatBytes(bytes: number): string {
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let unit = 0;
  while (bytes >= 1000 && unit < units.length - 1) {
    bytes /= 1000;
    ++unit;
  }
  return `${bytes.toFixed(unit === 0 || bytes >= 100 ? 0 : 1)} ${units[unit]}`;
}

export function formatSeconds(seconds: number): string {
  const whole = Math.round(seconds);
  const two = (n: number) => String(n).padStart(2, '0');
  const hours = Math.floor(whole / 3600);
  const minutes = Math.floor(whole / 60) % 60;
  return hours ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

/** "scene 12, take 3, the sword slips"; empty for an empty slate. */
export function slateText(slate: Take['slate']): string {
  const parts = [slate.scene && `scene ${slate.scene}`, slate.take && `take ${slate.take}`, slate.note];
  return parts.filter(Boolean).join(', ');
}

/** What the list shows below the name of a take, after its state. */
export function aboutText(take: Take): string {
  const timecode = take.timecode && `timecode ${take.timecode}`;
  return [slateText(take.slate), timecode, meshText(take)].filter(Boolean).join(' · ');
}

function meshText(take: Take): string {
  if (take.meshes === null) return 'meshes cannot be read';
  const proxy = take.proxy_bytes ? `, proxy ${formatBytes(take.proxy_bytes)}` : '';
  return take.meshes ? `${take.meshes} meshes, ${formatBytes(take.mesh_bytes)}${proxy}` : 'no meshes';
}

function part(tag: string, text: string, look = ''): HTMLElement {
  const element = document.createElement(tag);
  element.textContent = text;
  element.className = look;
  return element;
}

/** One take as a button. */
export function takeItem(take: Take, open: (name: string) => void): HTMLLIElement {
  const button = document.createElement('button');
  button.className = take.slate.mark;
  button.dataset.take = take.name;
  const name = part('div', '', 'name');
  name.append(part('span', take.name));
  if (take.slate.mark === 'circled') name.append(part('i', '◯', 'circled'));
  name.append(part('em', formatSeconds(take.seconds)));
  const about = part('div', '', 'about');
  about.append(part('span', take.state, `verdict ${take.state}`));
  about.append(` · ${aboutText(take)}`);
  button.append(name, about);
  if (take.error) button.append(part('div', take.error, 'about wrong'));
  button.title = [take.name, slateText(take.slate), take.mesh_error, new Date(take.started_ns / 1e6).toLocaleString(),
    `${take.cameras.length} cameras, ${take.pulses} pulses at ${take.rate_hz} Hz, ${formatBytes(take.bytes)}`]
    .filter(Boolean).join('\n');
  button.addEventListener('click', () => open(take.name));
  const item = document.createElement('li');
  item.append(button);
  return item;
}

/** Names of the scenes beside the takes. Throws like fetchTakes(). */
export async function fetchScenes(): Promise<string[]> {
  return (await fetchList<{ scenes: string[] }>('api/scenes')).scenes;
}

export function sceneItem(name: string, open: (name: string) => void): HTMLElement {
  const button = document.createElement('button');
  button.dataset.scene = name;
  button.textContent = name;
  button.addEventListener('click', () => open(name));
  const item = document.createElement('li');
  item.append(button);
  return item;
}
