// A studio folder served by v3d-viewd, and Chromium, for the browser tests and tools/bench/viewer.
import { spawn } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { createServer } from 'node:net';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { chromium } from '../../tools/viewer/node_modules/playwright-core/index.mjs';

/** Timeout of all waits, ms. It is long because the machine may be busy. */
export const TIMEOUT_MS = 60_000;

export const LCM_URL = 'udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304';

export const GL = ['--no-sandbox', '--use-gl=angle', '--use-angle=swiftshader', '--enable-unsafe-swiftshader'];
export const NO_GL = ['--no-sandbox', '--disable-gpu', '--disable-3d-apis'];

/** Debian's Chromium, which renders on the processor. */
export const launchBrowser = (args = GL) => chromium.launch({ executablePath: '/usr/bin/chromium', args, timeout: TIMEOUT_MS });

const studioFile = (port, page, takes, calib) => `
name = "dojo"
[[node]]
name = "cap01"
[[node]]
name = "recon01"
[[camera]]
name = "cam01"
node = "cap01"
address = "127.0.0.11"
[trigger]
node = "cap01"
wire = "trigger.sock"
[space]
min = [-1.5, -1.5, 0.0]
max = [1.5, 1.5, 2.5]
[network]
lcm_url = "${LCM_URL}"
key = "studio.key"
[storage]
takes = "${takes}"
background = "background"
calib = "${calib}"
[reconstruction]
node = "recon01"
[viewer]
listen = "127.0.0.1:${port}"
page = "${page}"
`;

export const freePort = () => new Promise((done) => {
  const server = createServer().listen(0, '127.0.0.1', () => {
    const { port } = server.address();
    server.close(() => done(port));
  });
});

export class ServedStudio {
  folder = mkdtempSync(join(tmpdir(), 'v3d-browser-'));
  port = 0;
  #daemon = null;

  /** `build`: the build folder; `takes`, `calib`: folder of takes and calibration of the studio file. */
  constructor(build, takes = 'takes', calib = 'takes/ball/calib.toml') {
    this.build = build;
    this.takes = takes;
    this.calib = calib;
  }

  get address() {
    return `http://127.0.0.1:${this.port}/`;
  }

  /** Resolves when the daemon serves. A restart uses the same port. */
  async start() {
    if (this.port === 0) {
      this.port = await freePort();
      writeFileSync(join(this.folder, 'studio.toml'), studioFile(this.port, join(this.build, 'viewer'), this.takes, this.calib));
    }
    await new Promise((done, fail) => {
      this.#daemon = spawn(join(this.build, 'bin/v3d-viewd'), ['--studio', join(this.folder, 'studio.toml')]);
      let output = '';
      this.#daemon.stderr.on('data', (data) => {
        output += data;
        if (output.includes('serves http')) done();
      });
      this.#daemon.on('exit', () => fail(new Error(`v3d-viewd ended: ${output}`)));
    });
  }

  async stop() {
    const daemon = this.#daemon;
    if (!daemon || daemon.exitCode !== null) return;
    await new Promise((done) => {
      daemon.removeAllListeners('exit').on('exit', done);
      daemon.kill();
    });
  }

  async end() {
    await this.stop();
    rmSync(this.folder, { recursive: true });
  }
}
