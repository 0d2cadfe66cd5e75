// A small web server for trying the player: files of a folder, with range requests, on this computer only.
//   node serve.mjs FOLDER [PORT]
import { createReadStream, statSync } from 'node:fs';
import { createServer } from 'node:http';
import { extname, join, normalize } from 'node:path';
import { pipeline } from 'node:stream';
import { fileURLToPath } from 'node:url';

const TYPES = {
  '.html': 'text/html; charset=utf-8', '.js': 'text/javascript', '.mjs': 'text/javascript', '.css': 'text/css', '.json': 'application/json',
  '.wasm': 'application/wasm', '.mp4': 'video/mp4', '.glb': 'model/gltf-binary',
};

/** The path in the address of a request; null: it is invalid. */
function pathOf(url) {
  try {
    const path = normalize(decodeURIComponent(new URL(url, 'http://localhost').pathname));
    return path.includes('\0') ? null : path;
  } catch {
    return null; // no host, as in "//", or invalid percent-encoding
  }
}

/** The file of a path; null: there is none. A folder means its index.html. */
function fileOf(folder, inside) {
  const file = join(folder, inside.endsWith('/') ? `${inside}index.html` : inside);
  const size = statSync(file, { throwIfNoEntry: false });
  return size?.isFile() ? { file, size: size.size } : null;
}

/** First and last byte of "bytes=FIRST-LAST"; null: the whole file is wanted; undefined: outside of the file. */
function rangeOf(header, size) {
  const match = /^bytes=(\d*)-(\d*)$/.exec(header ?? '');
  if (!match || (match[1] === '' && match[2] === '')) return null;
  const [first, last] = match[1] === '' ? [Math.max(0, size - Number(match[2])), size - 1]
    : [Number(match[1]), match[2] === '' ? size - 1 : Math.min(size - 1, Number(match[2]))];
  return first <= last ? { first, last } : undefined;
}

/** Answers a request for a file of the folder. */
export function answerWithFile(folder, request, response) {
  const path = pathOf(request.url);
  if (path === null) return response.writeHead(400).end();
  const found = fileOf(folder, path);
  if (!found) return response.writeHead(404).end();
  const { file, size } = found;
  const headers = { 'Content-Type': TYPES[extname(file)] ?? 'application/octet-stream', 'Accept-Ranges': 'bytes', 'Cache-Control': 'no-cache' };
  const range = rangeOf(request.headers.range, size);
  if (range === undefined) return response.writeHead(416, { 'Content-Range': `bytes */${size}` }).end();
  const { first, last } = range ?? { first: 0, last: size - 1 };
  if (range) headers['Content-Range'] = `bytes ${first}-${last}/${size}`;
  response.writeHead(range ? 206 : 200, { ...headers, 'Content-Length': last - first + 1 });
  if (request.method === 'HEAD' || size === 0) return response.end();
  pipeline(createReadStream(file, { start: first, end: last }), response, () => undefined); // closes the file also when the client leaves
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const [folder = '.', port = '8340'] = process.argv.slice(2);
  createServer((request, response) => answerWithFile(folder, request, response))
    .listen(Number(port), '127.0.0.1', () => console.log(`serves http://127.0.0.1:${port}/ from ${folder}`));
}
