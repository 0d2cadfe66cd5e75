// The address of the viewer after #: what it shows.

/** Null, NaN: not stated. */
export interface Address {
  live: boolean;
  take: string | null;
  pulse: number;
  mesh: string | null;
  scene: string | null;
  /** Seconds of the scene. */
  at: number;
}

/** #live, #take=kendo-07, #take=kendo-07&pulse=12&mesh=master (or proxy), #scene=duel, #scene=duel&at=2.5 */
export function parseAddress(hash: string): Address {
  const fields = new URLSearchParams(hash.slice(1));
  const text = (name: string) => fields.get(name) || null;
  const number = (name: string) => Number(text(name) ?? NaN);
  return { live: fields.has('live'), take: text('take'), pulse: number('pulse'), mesh: text('mesh'), scene: text('scene'), at: number('at') };
}
