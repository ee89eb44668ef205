// node build.mjs ENGINE_FOLDER OUT.cpp: the page without a scene, all in one file, as a C++ constant. ENGINE_FOLDER has
// page_sound.wasm and npm/package; limber-view puts the files of a scene in the place of "@FILES@".
import { createHash } from 'node:crypto';
import { readFileSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';
import esbuild from 'esbuild';

const [engine, out] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url)), read = (...path) => readFileSync(join(...path), 'utf8');

const small = { minify: true, write: false, target: 'es2022', legalComments: 'none', charset: 'ascii' };
const inElement = ({ outputFiles: [{ text }] }) => text.replaceAll('</script', '<\\/script').replaceAll('<!--', '<\\!--');
const bundle = await esbuild.build({
  entryPoints: [join(here, 'main.js')],
  ...small,
  bundle: true,
  format: 'iife',
  platform: 'browser',
  alias: Object.fromEntries(['limber', 'limber/posing', 'limber/scene'].map((name) => [name, join(engine, 'npm', 'package', `${name.split('/').at(-1)}.js`)])),
  logOverride: { 'empty-import-meta': 'silent' },  // where the WebAssembly is, which the page has inside
  external: ['module', 'fs', 'path', 'url', 'crypto', 'worker_threads', 'ws'],  // what the engine asks Node for
});
const base64 = (bytes) => gzipSync(bytes, { level: 9 }).toString('base64'), zipped = (name) => base64(readFileSync(join(engine, name)));
const script = read(here, 'begin.js').trim(), style = read(here, 'style.css');
const hash = (text) => `'sha256-${createHash('sha256').update(text, 'utf8').digest('base64')}'`;
const parts = {
  CSP: `default-src 'none'; script-src ${hash(script)} 'strict-dynamic' 'wasm-unsafe-eval'; style-src ${hash(style)}; img-src data:; base-uri 'none'; form-action 'none'`,
  STYLE: style,
  SCRIPT: script,
  APP: base64(bundle.outputFiles[0].contents),
  LICENCES: ['In this page: limber (MIT licence), three.js, Eigen (MPL-2.0), Highway (Apache-2.0), JSON for Modern C++ (MIT), and the C and C++ libraries of Emscripten (MIT, Apache-2.0 with LLVM exception).',
    `three.js:\n${read(here, 'node_modules', 'three', 'LICENSE')}`].join('\n\n'),
  // A module of the thread that plays has an address. 'strict-dynamic' lets the script that has the hash load one of data:, and markup
  // none; from disk Chromium refuses worklets of blob:.
  WORKLET: inElement(await esbuild.build({ ...small, entryPoints: [join(here, 'sound_worklet.js')] })),
  SOUND: zipped('page_sound.wasm'),
};
for (const text of Object.values(parts)) if (/<\/(script|style)/i.test(text)) throw new Error('a part of the page would end its element');
const page = read(here, 'index.html').replace(/@([A-Z]+)@/g, (all, name) => parts[name] ?? all);

// Pieces that every compiler takes, each by itself: an escape at the end of one must not run into the next.
function constant(name, text) {
  if (text.includes(')~page~"')) throw new Error('the page has what ends its constant');
  const pieces = [];
  for (let at = 0; at < text.length; at += 8000) pieces.push(`    R"~page~(${text.slice(at, at + 8000)})~page~"`);
  return `constexpr char ${name}[] =\n${pieces.join('\n')};\n`;
}
const [before, after] = page.split('@ENGINE@');
writeFileSync(out, `// Made by build.mjs.
#include "empty_page.h"

namespace limber {
namespace {

${constant('kBefore', before)}${constant('kAfter', after)}${constant('kEngine', zipped(join('npm', 'package', 'scene.wasm')))}${constant('kPosing', zipped(join('npm', 'package', 'posing.wasm')))}
}  // namespace

std::string empty_page(bool poses) { return std::string(kBefore) + (poses ? kPosing : kEngine) + kAfter; }

}  // namespace limber
`);
