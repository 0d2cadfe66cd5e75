// Panel for the operator's commands. It offers only the commands that are possible now, and prevents accidental ones.
import { MessageClock, type OrderReport, type StudioState } from './message';
import {
  type Action, actionsIn, type Activity, activityOf, armOrder, endsSelection, gradeOf, isNews, labelOf, leavableCameras, linesOf, nodesAtFault,
  nothingRecorded,
} from './operator';
import { OperatorToken, type Order, send } from './orders';

/** New buttons replace others at the same place. During this time they ignore a second tap of the same finger. */
const NEW_BUTTONS_WAIT_MS = 700;

const find = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

function made(tag: string, text: string, look = ''): HTMLElement {
  const element = document.createElement(tag);
  element.textContent = text;
  element.className = look;
  return element;
}

export class OperatorPanel {
  private readonly token = new OperatorToken();
  private readonly clock = new MessageClock();
  private readonly name = find<HTMLInputElement>('take-name');
  private readonly seconds = find<HTMLInputElement>('take-seconds');
  private activity: Activity = { phase: 'silent', take: '' };
  private atFault: string[] = [];
  private cameras: string[] = [];
  private last: OrderReport | null = null;
  private without = new Set<string>();
  private sending = false;
  private readonly shown: Record<string, string> = {};
  private named = false;

  constructor() {
    find('unlock').addEventListener('submit', (event) => {
      event.preventDefault();
      void this.unlock();
    });
    find('lock').addEventListener('click', () => this.lock());
    this.name.addEventListener('input', () => (this.named = true));
    find<HTMLDialogElement>('sure').addEventListener('close', (event) => {
      const dialog = event.target as HTMLDialogElement;
      if (dialog.returnValue === 'abort') void this.order({ do: 'abort' });
      dialog.returnValue = '';
    });
    // A held Enter key sends one order only.
    find('operator').addEventListener('keydown', (event) => event.repeat && event.key === 'Enter' && event.preventDefault());
  }

  setState({ control, nodes, sent_ms }: StudioState): void {
    this.clock.add(sent_ms, performance.now());
    find('operator').hidden = !control;
    this.activity = activityOf(nodes);
    this.atFault = nodesAtFault(nodes);
    this.cameras = nodes.flatMap((node) => node.cameras);
    this.draw();
  }

  setLast(report: OrderReport): void {
    if (report.number === 0) return; // no order was given yet
    this.last = report;
    if (endsSelection(report)) this.without.clear();
    if (report.do === 'arm' && report.status === 0 && !report.under_way) this.named = false;
    this.showTrouble(null);
    this.draw();
  }

  /** To call when a connection begins: the server sends its last order again, and after its restart it has none. */
  forgetLast(): void {
    this.last = null;
    this.draw();
  }

  /** Proposes a name for the next take, unless the user has typed one. */
  proposeName(name: string): void {
    if (!this.named && this.activity.phase === 'idle') this.name.value = name;
  }

  private async unlock(): Promise<void> {
    const field = find<HTMLInputElement>('token');
    const token = field.value.trim();
    field.value = '';
    const sent = await send({ do: 'look' }, token);
    if ('report' in sent) this.token.value = token;
    this.showTrouble('refusal' in sent ? sent.refusal : null);
    this.draw();
  }

  private lock(): void {
    this.token.value = '';
    this.draw();
  }

  private async order(order: Order): Promise<void> {
    if (this.sending) return;
    this.sending = true;
    this.draw();
    const at = this.clock.at(performance.now());
    const dated = at === null ? order : { ...order, at_ms: Math.round(at) };
    const sent = await send(dated, this.token.value).finally(() => (this.sending = false));
    if ('report' in sent) {
      if (isNews(sent.report, this.last)) this.setLast(sent.report);
    } else {
      if (sent.wrongToken) this.token.value = '';
      this.showTrouble(sent.refusal);
    }
    this.draw();
  }

  private act(action: Action): void {
    if (action === 'arm') return this.arm();
    if (action === 'abort') return find<HTMLDialogElement>('sure').showModal();
    void this.order({ do: action === 'verdict' ? 'stop' : action });
  }

  private arm(): void {
    const { name, seconds } = this;
    const form = armOrder({
      take: name.value, seconds: seconds.value, secondsAreValid: seconds.validity.valid, without: [...this.without],
    });
    if ('order' in form) return void this.order(form.order);
    this.showTrouble(form.rule);
    (form.field === 'take' ? name : seconds).focus();
  }

  /** Shows why an order was rejected; null: no error. */
  private showTrouble(trouble: string | null): void {
    find('order-trouble').textContent = trouble ?? '';
    find('order-trouble').hidden = !trouble;
  }

  private draw(): void {
    const open = this.token.value !== '';
    find('unlock').hidden = open;
    find('orders').hidden = !open;
    find('lock').hidden = !open;
    const actions = this.sending ? [] : actionsIn(this.activity.phase, this.last);
    this.drawButtons(actions);
    find('arming').hidden = !actions.includes('arm');
    this.drawWithout(actions.includes('arm'));
    this.drawLast();
    find('doing').textContent = this.sending ? 'Sending the order…' : this.last?.under_way ? `${this.last.text}: under way…` : this.activityText();
    this.drawQuestion(actions.includes('abort'));
  }

  private activityText(): string {
    const { phase, take } = this.activity;
    switch (phase) {
      case 'silent':
        return 'No node sends health.';
      case 'idle':
        return 'No take is armed.';
      case 'fault':
        return `Nodes at fault: ${this.atFault.join(', ')}. Clear the fault before the next take.`;
      case 'unrecorded':
        return `${nothingRecorded(take)}.`;
      default:
        return `${take} is ${phase}.`;
    }
  }

  /** The question before an abort. It closes when it does not fit any more, because its button would do something else. */
  private drawQuestion(possible: boolean): void {
    const { phase, take } = this.activity;
    const clears = phase === 'fault', checks = phase === 'unrecorded';
    find('sure-head').textContent = clears ? 'Clear the fault?' : 'Abort?';
    find('sure-no').textContent = clears ? 'Cancel' : 'Do not abort';
    find('sure-yes').textContent = clears ? 'Clear the fault' : checks ? 'Abort' : 'Abort the take';
    find('sure-text').textContent = clears
      ? `Nothing is being recorded. The fault of ${this.atFault.join(', ')} ends, and a take can be armed. All files stay on the disks.`
      : phase === 'recording'
        ? `${take} is being recorded. Abort keeps the files on the disks, but gives no verdict. Use Stop to end a take with a verdict.`
        : checks ? `${nothingRecorded(take)}. Abort ends v3dctl ${take}.`
        : `${take} is armed; nothing was recorded yet.`;
    if (this.isNew('question', [possible, clears, checks])) find<HTMLDialogElement>('sure').close('');
  }

  /** True when the content of a part has changed. Unchanged parts are kept, so a pressed button is not replaced. */
  private isNew(part: string, content: unknown): boolean {
    const text = JSON.stringify(content);
    if (this.shown[part] === text) return false;
    this.shown[part] = text;
    return true;
  }

  private drawButtons(actions: Action[]): void {
    const { phase } = this.activity;
    if (!this.isNew('buttons', actions.map((action) => [action, labelOf(action, phase)]))) return;
    const buttons = actions.map((action) => {
      const button = made('button', labelOf(action, phase), action) as HTMLButtonElement;
      button.type = 'button';
      button.dataset.order = action;
      button.disabled = true;
      setTimeout(() => (button.disabled = false), NEW_BUTTONS_WAIT_MS);
      button.addEventListener('click', () => this.act(action));
      return button;
    });
    find('order-buttons').replaceChildren(...buttons);
  }

  /** Offers to leave out the cameras that a rejected arm order names. */
  private drawWithout(arming: boolean): void {
    const named = arming ? leavableCameras(this.last, this.cameras, this.without) : [];
    find('without').hidden = named.length === 0;
    if (!this.isNew('without', [named, this.last?.number])) return;
    find('without-cameras').replaceChildren(...named.map((camera) => {
      const button = made('button', camera) as HTMLButtonElement;
      button.type = 'button';
      button.setAttribute('aria-pressed', String(this.without.has(camera)));
      button.addEventListener('click', () => {
        if (!this.without.delete(camera)) this.without.add(camera);
        button.setAttribute('aria-pressed', String(this.without.has(camera)));
      });
      return button;
    }));
  }

  private drawLast(): void {
    find('last-order').hidden = this.last === null;
    if (!this.last || !this.isNew('last', this.last)) return;
    const at = new Date(this.last.at_ms).toLocaleTimeString('en-GB');
    const head = made('p', '', 'line');
    head.append(made('b', this.last.text), made('span', `${at}, ${this.last.by}`, 'dim'));
    const lines = linesOf(this.last).map((line) => made('li', line));
    const list = made('ol', '', gradeOf(this.last));
    list.append(...lines);
    find('last-order').replaceChildren(head, list);
  }
}
