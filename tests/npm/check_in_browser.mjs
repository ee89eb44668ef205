// node check_in_browser.mjs FOLDER EXAMPLE: the package, installed in FOLDER, in headless Chromium: by a plain <script type="module">
// and from a bundle. Its scenes and a pose end in the bits of Node, and a body of the example in the folder EXAMPLE is dragged.
import { readFile } from 'node:fs/promises';
import { createServer } from 'node:http';
import { join } from 'node:path';
import { pathToFileURL } from 'node:url';
import esbuild from 'esbuild';
import { browser, check, run, until, wrong } from './browser.mjs';

const [folder, example] = process.argv.slice(2), types = { js: 'text/javascript', mjs: 'text/javascript', wasm: 'application/wasm', html: 'text/html' };
const play = 'document.title = JSON.stringify(scenes(limber));';
const { outputFiles } = await esbuild.build({
  stdin: {
    contents: `import * as limber from 'limber'; import wasm from 'limber/limber.wasm'; import { scenes } from './scenes.mjs';
      await limber.load(new URL(wasm, import.meta.url)); ${play}`,
    resolveDir: folder,
  },
  bundle: true, minify: true, write: false, format: 'esm', target: 'es2022', platform: 'browser', outdir: '/bundle',
  loader: { '.wasm': 'file' }, assetNames: '[name]',
});
const made = {
  '/plain.html': `<!doctype html><script type="module">import * as limber from './node_modules/limber/limber.js';
    import { scenes } from './scenes.mjs'; await limber.load(); ${play}</script>`,
  '/posing.html': `<!doctype html><script type="module">import * as posing from './node_modules/limber/posing.js';
    import { pull } from './pull.mjs'; document.title = JSON.stringify(await pull(posing));</script>`,
  '/bundled.html': '<!doctype html><script type="module" src="bundle/stdin.js"></script>',
  '/favicon.ico': '',
  ...Object.fromEntries(outputFiles.map(({ path, contents }) => [path, contents])),
};
const server = createServer(async ({ url }, response) => {
  let bytes = made[url];
  for (const place of [folder, example, '.']) bytes ??= await readFile(join(place, url)).catch(() => undefined);
  response.writeHead(bytes === undefined ? 404 : 200, { 'Content-Type': types[url.split('.').pop()] ?? 'text/plain' }).end(bytes);
}).listen(0, '127.0.0.1');

async function open(name) {
  const page = await browser.newPage();
  page.on('console', (message) => { if (message.type() === 'error') wrong.push(`${name}: console: ${message.text()}`); });
  page.on('pageerror', (error) => wrong.push(`${name}: ${error.message}`));
  await page.goto(`http://127.0.0.1:${server.address().port}/${name}.html`);
  return page;
}

await run('check_in_browser', folder, async () => {
  const [limber, { scenes }, posing, { pull }] = await Promise.all(['node_modules/limber/node.js', 'scenes.mjs', 'node_modules/limber/posing_node.js', 'pull.mjs']
    .map((path) => import(pathToFileURL(join(folder, path)).href)));
  await limber.load();
  const expected = JSON.stringify(scenes(limber));
  for (const [name, end] of [['plain', expected], ['bundled', expected], ['posing', JSON.stringify(await pull(posing))]]) {
    const page = await open(name);
    await until(async () => wrong.length > 0 || (await page.title()) !== '');
    check((await page.title()) === end, `${name} ends as in Node: ${await page.title()}, ${end}`);
  }

  const page = await open('index'), highest = () => page.evaluate(() => {
    const { world, ids } = globalThis.example ?? { ids: [] };
    return Math.max(...ids.map((id) => world.bodyState(id).pose.p.z));
  });
  await until(async () => wrong.length > 0 || await page.evaluate(() => globalThis.example?.world.time() > 1));
  const low = await highest();
  await page.mouse.move(450, 330);
  await page.mouse.down();
  await page.mouse.move(450, 150, { steps: 4 });
  await until(async () => wrong.length > 0 || (await highest()) > 0.7);
  check(low < 0.6, `the example's bodies lie before one is dragged: ${low} m`);
  check((await highest()) > 0.7, `a body of the example is lifted: ${await highest()} m`);
});
