// Serves this folder at http://localhost:8000.
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { extname } from 'node:path';

const types = { '.html': 'text/html', '.js': 'text/javascript', '.wasm': 'application/wasm' };
createServer(async ({ url }, response) => {
  const { pathname } = new URL(url, 'http://localhost'), path = pathname === '/' ? '/index.html' : pathname;
  const bytes = await readFile(new URL(`.${path}`, import.meta.url)).catch(() => undefined);
  response.writeHead(bytes === undefined ? 404 : 200, { 'Content-Type': types[extname(path)] ?? 'text/plain' }).end(bytes);
}).listen(8000, () => console.log('http://localhost:8000'));
