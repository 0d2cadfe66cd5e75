// Memory of a browser page.
import { readFileSync } from 'node:fs';

/**
 * JavaScript heap, resident memory of the largest renderer process, and that of the process that draws, all after a garbage
 * collection, bytes. The process that draws has the buffers and textures of WebGL.
 */
export async function memoryOf(browser, page) {
  const session = await page.context().newCDPSession(page);
  await session.send('HeapProfiler.collectGarbage');
  const { usedSize } = await session.send('Runtime.getHeapUsage');
  await session.detach();
  const ofBrowser = await browser.newBrowserCDPSession();
  const { processInfo } = await ofBrowser.send('SystemInfo.getProcessInfo');
  await ofBrowser.detach();
  const resident = (type) => Math.max(...processInfo.filter((process) => process.type === type).map(({ id }) =>
    1024 * Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${id}/status`, 'utf8'))[1])));
  return { heap: usedSize, resident: resident('renderer'), graphics: resident('GPU') };
}

export const megabytes = (bytes) => (bytes / 1e6).toFixed(1);
