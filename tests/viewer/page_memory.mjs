// Memory of a browser page.
import { readFileSync } from 'node:fs';

/** JavaScript heap and resident memory of the largest renderer process after a garbage collection, bytes. */
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
