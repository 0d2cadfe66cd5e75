// What a page holds of memory.
import { readFileSync } from 'node:fs';

/** After rubbish was collected, bytes: of JavaScript's heap, and resident of the renderer that has most. */
export async function memoryOf(browser, page) {
  const session = await page.context().newCDPSession(page);
  await session.send('HeapProfiler.collectGarbage');
  const { usedSize } = await session.send('Runtime.getHeapUsage');
  await session.detach();
  const ofBrowser = await browser.newBrowserCDPSession();
  const { processInfo } = await ofBrowser.send('SystemInfo.getProcessInfo');
  await ofBrowser.detach();
  const resident = processInfo.filter(({ type }) => type === 'renderer').map(({ id }) =>
    1024 * Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${id}/status`, 'utf8'))[1]));
  return { heap: usedSize, resident: Math.max(...resident) };
}

export const megabytes = (bytes) => (bytes / 1e6).toFixed(1);
