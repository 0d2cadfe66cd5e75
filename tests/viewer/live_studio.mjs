// A simulated studio with the real daemons, and v3d-viewd that accepts orders, for browser tests and tools/bench/latency.
import { execFile, spawn } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import { promisify } from 'node:util';
import { freePort } from './served_studio.mjs';

export const OPERATOR_TOKEN = 'operators-0123456789';
const EMPTY_PULSES = '16'; // as many as v3dctl background learns from
const FOUR_SMALL_CAMERAS = ['--cameras', '4', '--size', '320x240', '--rate', '20', '--loop-frames', '10', '--voxel', '40mm'];

/** Starts a program. Resolves when its output holds `ready`. */
function begin(program, words, ready) {
  const child = spawn(program, words);
  return new Promise((done, fail) => {
    let output = '';
    const append = (data) => {
      output += data;
      if (output.includes(ready)) done(child);
    };
    child.stdout.on('data', append);
    child.stderr.on('data', append);
    child.on('exit', (status) => fail(new Error(`${program} ended with ${status}: ${output}`)));
  });
}

export class LiveStudio {
  folder = mkdtempSync(join(tmpdir(), 'v3d-live-'));
  #build;
  #simulated;
  #children = [];
  #viewd = null;
  #port = 0;

  /** `simulated`: options of `v3d-sim studio`. */
  constructor(build, simulated = FOUR_SMALL_CAMERAS) {
    this.#build = build;
    this.#simulated = simulated;
  }

  get address() {
    return `http://127.0.0.1:${this.#port}/`;
  }
  /** Process numbers of the running programs, by name. */
  get processes() {
    return Object.fromEntries([...this.#children, this.#viewd].map((child) => [basename(child.spawnfile), child.pid]));
  }
  #bin(program) {
    return join(this.#build, 'bin', program);
  }
  get #file() {
    return join(this.folder, 'studio.toml');
  }

  /** Resolves with the standard output; rejects when v3dctl fails. */
  async v3dctl(...words) {
    const { stdout } = await promisify(execFile)(this.#bin('v3dctl'), ['--studio', this.#file, ...words]);
    return stdout;
  }

  /** The last line of `v3dctl verify`, also for an incomplete take, because a busy machine may lose a frame. */
  async verdict(take) {
    const lines = await this.v3dctl('verify', join(this.folder, 'takes', take)).catch(({ code, stdout }) => {
      if (code !== 3) throw new Error(`v3dctl verify ${take} ended with ${code}: ${stdout}`);
      return stdout;
    });
    return lines.trimEnd().split('\n').at(-1);
  }

  /** Starts all programs. Resolves when the background is learnt and v3d-viewd serves. */
  async start() {
    const words = ['studio', this.folder, ...this.#simulated, '--empty-pulses', EMPTY_PULSES];
    const simulator = await begin(this.#bin('v3d-sim'), words, 'ready\n');
    this.#children.push(simulator);
    this.#port = await freePort();
    mkdirSync(join(this.folder, 'takes'));
    writeFileSync(join(this.folder, 'operator.token'), `${OPERATOR_TOKEN}\n`, { mode: 0o600 });
    const viewer = `\n[viewer]\nlisten = "127.0.0.1:${this.#port}"\npage = "${join(this.#build, 'viewer')}"\n`
      + 'control = true\noperator_token = "operator.token"\n';
    writeFileSync(this.#file, readFileSync(this.#file, 'utf8').replace('takes = "."', 'takes = "takes"') + viewer);
    for (const [program, ...words] of [['v3d-captured', '--node', 'cap01'], ['v3d-recond']]) {
      this.#children.push(spawn(this.#bin(program), ['--studio', this.#file, ...words], { stdio: 'ignore' }));
    }
    await this.startViewd();
    await this.v3dctl('background');
  }

  async startViewd() {
    this.#viewd = await begin(this.#bin('v3d-viewd'), ['--studio', this.#file], 'serves http');
  }
  async stopViewd() {
    await LiveStudio.#end(this.#viewd);
  }

  static async #end(child) {
    if (!child || child.exitCode !== null || child.signalCode !== null) return;
    await new Promise((done) => {
      child.removeAllListeners('exit').on('exit', done);
      child.kill();
    });
  }

  /** Ends all programs, the cameras last, and removes the folder. */
  async end() {
    await this.stopViewd();
    for (const child of this.#children.reverse()) await LiveStudio.#end(child);
    rmSync(this.folder, { recursive: true });
  }
}

