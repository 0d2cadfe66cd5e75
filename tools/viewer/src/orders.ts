// Sends orders to v3d-viewd (daemon/viewd/command_endpoint.h), with the operators' token of this tab.
import type { OrderReport } from './message';

const TOKEN_KEPT_AS = 'v3d-operator-token';
/** The server responds at once, before the order is executed. */
const MAX_RESPONSE_MS = 8000;
const NO_RESPONSE = 'No answer: whether the studio got the order is not known. Look at the nodes.';

export interface Order {
  do: 'look' | 'arm' | 'start' | 'stop' | 'abort';
  take?: string;
  seconds?: number;
  without?: string[];
  /** When it was given, by the server's clock. The server executes none that is older than 10 s. */
  at_ms?: number;
}

export type Sent = { report: OrderReport } | { refusal: string; wrongToken: boolean };

/** The operators' token, stored for this tab only. */
export class OperatorToken {
  private token = '';

  constructor() {
    try {
      this.token = sessionStorage.getItem(TOKEN_KEPT_AS) ?? '';
    } catch {
      // without storage, the token must be entered again after a reload
    }
  }

  get value(): string {
    return this.token;
  }
  set value(token: string) {
    this.token = token;
    try {
      if (token) sessionStorage.setItem(TOKEN_KEPT_AS, token);
      else sessionStorage.removeItem(TOKEN_KEPT_AS);
    } catch {
      // as above
    }
  }
}

/** Does not throw: a failure is a refusal. */
export async function send(order: Order, token: string): Promise<Sent> {
  try {
    const response = await fetch('api/order', {
      method: 'POST',
      headers: { 'Content-Type': 'application/json', 'X-V3D-Operator': token },
      body: JSON.stringify(order),
      signal: AbortSignal.timeout(MAX_RESPONSE_MS),
    });
    if (response.ok) return { report: (await response.json()) as OrderReport };
    return { refusal: (await response.text()).trim() || `The server answered ${response.status}.`, wrongToken: response.status === 401 };
  } catch {
    return { refusal: NO_RESPONSE, wrongToken: false };
  }
}
