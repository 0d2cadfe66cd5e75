// The studio page: shows the state of the studio and, if the studio file allows it, sends an operator's commands.
import { CameraWall } from './camera_wall';
import { ItemList } from './item_list';
import { type NodeState, type OrderReport, type PreviewHead, splitMessage, type StudioEvent, type StudioState } from './message';
import { factsOf } from './node_health';
import { activityOf, nodeActivity, nothingRecorded, proposedName, recordingFacts, recordsNothing } from './operator';
import { OperatorPanel } from './operator_panel';
import { takesText } from './page';
import { ReconnectingSocket, socketUrl } from './reconnecting_socket';
import { Refusal } from './request';
import { fetchTakes, type Take, takeItem } from './take_list';

const EVENTS_KEPT = 100;
/** The server sends the state at least every 2 s. */
const MAX_SILENCE_MS = 5000;
const TAKES_EVERY_MS = 5000;
const TAKES_SHOWN = 12;

const find = (id: string) => document.getElementById(id)!;
function made(tag: string, text: string, look = ''): HTMLElement {
  const element = document.createElement(tag);
  element.textContent = text;
  element.className = look;
  return element;
}

const wall = new CameraWall(find('wall'));
const panel = new OperatorPanel();
const openTake = (name: string) => location.assign(`./#take=${name}`);
const takeItems = new ItemList<Take>(() => find('takes'), ({ name }) => name, (take) => takeItem(take, openTake));
let lost = true;
let notVerified = '';
/** The reason for which the server sends no list of takes. */
let refusal = '';

function showBanner(): void {
  const texts = lost ? [refusal || 'The studio does not answer. Trying again every second.']
    : [refusal && `Takes: ${refusal}`, notVerified && `The data on this page is not authenticated: ${notVerified}`];
  const text = texts.filter(Boolean).join(' ');
  find('banner').textContent = text;
  find('banner').hidden = text === '';
}

function nodeCard(node: NodeState): HTMLElement {
  const card = made('article', '', 'card');
  const line = made('div', '', 'line');
  const state = node.heard ? (node.state ?? '') : 'silent';
  line.append(made('b', node.name), made('i', node.program ?? '', 'dim'));
  line.append(made('span', nodeActivity(node), recordsNothing(node) ? '' : state));
  card.append(line);
  if (!node.heard) card.append(made('p', `Try: systemctl status --all 'v3d-*' on ${node.name}`, 'wrong'));
  if (node.text) card.append(made('p', node.text, 'wrong'));
  const facts = made('dl', '');
  for (const fact of factsOf(node)) facts.append(made('dt', fact.name), made('dd', fact.value, fact.grade));
  card.append(facts);
  return card;
}

/** Makes a running recording clearly visible on the page. */
function showRecording(nodes: NodeState[]): void {
  const { phase, take } = activityOf(nodes);
  const recording = phase === 'recording' && !lost;
  document.body.classList.toggle('recording', recording);
  find('recording').hidden = !recording;
  find('recording-take').textContent = take;
  find('recording-facts').textContent = recordingFacts(nodes);
  document.title = recording ? `● ${take} - V3D studio` : 'V3D studio';
}

function showState(state: StudioState): void {
  notVerified = state.not_verified;
  showBanner();
  find('title').textContent = state.studio;
  const { all, well } = wall.setState(state.nodes);
  find('camera-count').textContent = well === all ? `${all}, all well` : `${well} of ${all} well`;
  find('nodes').replaceChildren(...state.nodes.map(nodeCard));
  panel.setState(state);
  showRecording(state.nodes);
  const { phase, take } = activityOf(state.nodes);
  const running = phase === 'unrecorded' ? nothingRecorded(take) : `${phase} ${take}`;
  const activity = phase === 'idle' || phase === 'silent' ? 'no take is being recorded'
    : phase === 'fault' ? 'a node is at fault' : running;
  find('facts').textContent = `${activity} · ${state.watchers} watching`;
}

function showEvent(event: StudioEvent): void {
  const item = made('li', '', event.severity);
  const time = made('time', new Date(event.sent_ms).toLocaleTimeString('en-GB'));
  const what = made('span', '');
  what.append(made('b', event.subject), ` ${event.text} `, made('span', event.node, 'dim'));
  item.append(time, what);
  const list = find('events');
  list.prepend(item);
  if (list.children.length > EVENTS_KEPT) list.lastElementChild!.remove();
  find('no-events').hidden = true;
}

function onMessage(data: string | ArrayBuffer): void {
  if (typeof data === 'string') {
    const message = JSON.parse(data) as StudioState | StudioEvent | OrderReport;
    if (message.type === 'state') showState(message);
    else if (message.type === 'event') showEvent(message);
    else if (message.type === 'order') panel.setLast(message);
    return;
  }
  const preview = splitMessage<PreviewHead>(data);
  if (preview) void wall.setPreview(preview.head, preview.bytes);
}

/** Lists takes, the newest first. A click opens a take in the viewer. */
async function listTakes(): Promise<void> {
  let takes: Take[] = [];
  try {
    takes = await fetchTakes();
    refusal = '';
  } catch (error) {
    refusal = error instanceof Refusal ? error.message : '';
    return;
  } finally {
    showBanner();
  }
  const proposed = proposedName(takes);
  if (proposed !== null) panel.proposeName(proposed);
  takeItems.show(takes.slice(0, TAKES_SHOWN));
}

function connect(): void {
  new ReconnectingSocket(socketUrl('api/studio'), MAX_SILENCE_MS, {
    opened() {
      lost = false;
      find('events').replaceChildren(); // the server sends them again
      panel.forgetLast();
      showBanner();
    },
    message: onMessage,
    lost() {
      lost = true;
      showBanner();
      showRecording([]); // the state is unknown without a connection
    },
  });
}

function toggleSilhouettes(): void {
  wall.silhouettes = !wall.silhouettes;
  find('mask').setAttribute('aria-pressed', String(wall.silhouettes));
}
find('mask').addEventListener('click', toggleSilhouettes);
addEventListener('keydown', (event) => {
  if (event.key === 'm' && !event.ctrlKey && !event.metaKey && !takesText(event.target)) toggleSilhouettes();
});
connect();
void listTakes();
setInterval(() => void listTakes(), TAKES_EVERY_MS);
