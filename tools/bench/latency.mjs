// usage: latency.mjs BUILD CAMERAS PULSES RATE SIZE VOXEL: see tools/bench/latency.
import { readdirSync, readFileSync } from 'node:fs';
import { LiveStudio } from '../../tests/viewer/live_studio.mjs';
import { launchBrowser, TIMEOUT_MS } from '../../tests/viewer/served_studio.mjs';

const [build, cameras, pulses, rate, size, voxel] = process.argv.slice(2);
const WARM = 50; // pulses at the begin of the take that are not measured

const percentile = (sorted, share) => sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))];

/** Fields of /proc/PID/stat behind the name of the program, from the third field on. */
const statOf = (pid) => readFileSync(`/proc/${pid}/stat`, 'utf8').split(') ').at(-1).split(' ');

/** Processor time of a process and its descendants, seconds. */
function processorSeconds(root) {
  const TICKS = 100; // a second
  const all = new Map();
  for (const pid of readdirSync('/proc').filter((name) => /^\d+$/.test(name))) {
    try {
      const stat = statOf(pid);
      all.set(Number(pid), { parent: Number(stat[1]), ticks: Number(stat[11]) + Number(stat[12]) });
    } catch {
      // it has ended
    }
  }
  const isInside = (pid) => pid === root || (all.has(pid) && isInside(all.get(pid).parent));
  return [...all].filter(([pid]) => isInside(pid)).reduce((sum, [, { ticks }]) => sum + ticks, 0) / TICKS;
}

const secondsOf = (processes) => Object.fromEntries(
  Object.entries(processes).map(([name, pid]) => [name, processorSeconds(pid)]));

/** The page calls this for each pulse that became visible. */
function collect(page, latencies) {
  return page.exposeFunction('onPulse', (text) => {
    const [pulse, ms] = text.split(' ').map(Number);
    latencies.set(pulse, ms);
  });
}

const studio = new LiveStudio(build, ['--cameras', cameras, '--size', size, '--rate', rate, '--voxel', voxel]);
console.log(`simulating ${cameras} cameras of ${size} pixels`);
await studio.start();
const browser = await launchBrowser();
try {
  const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
  const latencies = new Map();
  await collect(page, latencies);
  await page.goto(`${studio.address}#live`);
  await page.waitForSelector('#open-live[data-link=open]', { timeout: TIMEOUT_MS });
  await page.evaluate(() => new MutationObserver(() => window.onPulse(document.getElementById('canvas').dataset.latency))
    .observe(document.getElementById('canvas'), { attributeFilter: ['data-latency'] }));
  await studio.v3dctl('arm', 'latency', '--rate', rate, '--pulses', pulses);
  const processes = { ...studio.processes, chromium: browserProcess() };
  const before = secondsOf(processes);
  const began = performance.now();
  await studio.v3dctl('start', '--wait');
  const seconds = (performance.now() - began) / 1000;
  const after = secondsOf(processes);
  const stop = JSON.parse(await studio.v3dctl('stop', '--json').catch(({ stdout }) => stdout));
  report(latencies, before, after, seconds, stop);
} finally {
  await browser.close();
  await studio.end();
}

/** The process of the browser that this process has started. */
function browserProcess() {
  const children = readdirSync('/proc').filter((name) => /^\d+$/.test(name)).filter((pid) => {
    try {
      return Number(statOf(pid)[1]) === process.pid && /chrom/.test(readFileSync(`/proc/${pid}/cmdline`, 'utf8'));
    } catch {
      return false;
    }
  });
  return Number(children[0]);
}

function report(latencies, before, after, seconds, stop) {
  const sorted = [...latencies].filter(([pulse]) => pulse >= WARM).map(([, ms]) => ms).sort((a, b) => a - b);
  const { detail } = Object.values(stop.replies).find((reply) => reply.detail?.meshes !== undefined);
  const passes = [0, 1, 2].map((n) => detail[`meshes_of_${n}_passes`] ?? 0);
  console.log(`${sorted.length} of ${pulses - WARM} pulses were visible; ${detail.meshes} meshes, ${detail.dropped} pulses dropped`);
  console.log(`meshes with 0, 1 and 2 passes of the deformation: ${passes.join(', ')}`);
  if (sorted.length === 0) throw new Error('no pulse was visible');
  console.log(`pulse to screen: p50 ${percentile(sorted, 0.5).toFixed(0)} ms, p99 ${percentile(sorted, 0.99).toFixed(0)} ms`);
  console.log(`pulse to mesh:   p50 ${detail.latency_p50_ms.toFixed(0)} ms, p99 ${detail.latency_p99_ms.toFixed(0)} ms`);
  for (const [name, spent] of Object.entries(after)) {
    const ms = (1000 * (spent - before[name])) / pulses;
    console.log(`${name.padEnd(13)} ${ms.toFixed(1).padStart(6)} ms of processor time a pulse, ${(100 * (spent - before[name]) / seconds).toFixed(0)} % of a core`);
  }
}
