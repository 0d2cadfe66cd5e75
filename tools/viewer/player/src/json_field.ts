// Reader of JSON from outside: it rejects a value with its path and what would be right.

export type Vector = [number, number, number];
/** Largest coordinate. */
export const MAX_METRES = 1e6;

/** A value of the file and its path there, for messages. */
export class Field {
  constructor(
    readonly value: unknown,
    private readonly where: string,
  ) {}

  reject(what: string): never {
    throw new Error(this.where ? `${this.where}: ${what}` : what);
  }
  /** `known`: all keys that may be there; undefined: others, too. */
  expectObject(known?: string[]): void {
    if (typeof this.value !== 'object' || this.value === null || Array.isArray(this.value)) this.reject('expected an object');
    if (!known) return;
    for (const key of Object.keys(this.value).sort()) if (!known.includes(key)) this.reject(`there is no key '${key}'`);
  }
  find(key: string): Field | null {
    const value = (this.value as Record<string, unknown>)[key];
    return value === undefined ? null : new Field(value, this.where ? `${this.where}.${key}` : key);
  }
  at(key: string): Field {
    return this.find(key) ?? this.reject(`'${key}' is missing`);
  }
  list(): Field[] {
    if (!Array.isArray(this.value)) this.reject('expected a list');
    return this.value.map((value, n) => new Field(value, `${this.where}[${n}]`));
  }
  number(min: number, max: number): number {
    const text = (n: number) => (Number.isInteger(n) ? n.toFixed(1) : String(n));
    if (typeof this.value === 'number' && this.value >= min && this.value <= max) return this.value;
    return this.reject(`expected a number from ${text(min)} to ${text(max)}`);
  }
  /** A list of `count` numbers. */
  numbers(count: number, min: number, max: number): number[] {
    const isNumber = (n: unknown) => typeof n === 'number' && n >= min && n <= max;
    if (Array.isArray(this.value) && this.value.length === count && this.value.every(isNumber)) return this.value as number[];
    return this.reject(`expected ${count} numbers from ${min} to ${max}`);
  }
  positive(): number {
    if (typeof this.value === 'number' && this.value > 0 && this.value <= 1000) return this.value;
    return this.reject('expected a number above 0, at most 1000');
  }
  integer(min: number, max: number): number {
    const number = this.value as number;
    return Number.isInteger(number) && number >= min && number <= max ? number : this.reject(`expected a whole number from ${min} to ${max}`);
  }
  pulse(): number {
    if (Number.isSafeInteger(this.value) && (this.value as number) >= 0) return this.value as number;
    return this.reject('expected the number of a pulse');
  }
  performer(): number {
    const number = this.value as number;
    if (Number.isSafeInteger(number) && number >= 1 && number <= 255) return number;
    return this.reject('expected the number of a performer, 1 to 255');
  }
  flag(): boolean {
    return typeof this.value === 'boolean' ? this.value : this.reject('expected true or false');
  }
  text(): string {
    return typeof this.value === 'string' ? this.value : this.reject('expected a text');
  }
  vector(): Vector {
    const parts = Array.isArray(this.value) ? this.list() : [];
    if (parts.length !== 3) this.reject('expected three numbers, [x, y, z]');
    return parts.map((part) => part.number(-MAX_METRES, MAX_METRES)) as Vector;
  }
  path(): string {
    const name = this.text();
    if (name === '' || name.startsWith('/') || /[:?#\\%]/.test(name)) {
      this.reject('expected a path from the folder of the scene, without any of : ? # % and backslash');
    }
    return name;
  }
  /** The name of a file in the same folder. */
  fileName(): string {
    const name = this.text();
    if (/^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$/.test(name)) return name;
    return this.reject('expected the name of a file in the same folder, of letters, digits, ".", "_" and "-"');
  }
  colour(): string {
    const name = this.text();
    return /^#[0-9a-fA-F]{6}$/.test(name) ? name.toLowerCase() : this.reject('expected a colour such as "#101216"');
  }
}

/** The whole text as a value. */
export function parseJson(text: string): Field {
  try {
    return new Field(JSON.parse(text), '');
  } catch (error) {
    if (error instanceof SyntaxError) throw new Error('is no JSON');
    throw error;
  }
}
