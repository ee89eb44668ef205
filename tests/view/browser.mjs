// Headless Chromium for the checks of pages: opened from disk, everything wrong collected.
//   CHROMIUM   the browser's program; otherwise chromium on the PATH
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { gunzipSync } from 'node:zlib';
import { chromium } from 'playwright-core';

export const folder = mkdtempSync(join(tmpdir(), 'limber-page-'));
export const wrong = [];
export const check = (holds, claim) => { if (!holds) wrong.push(claim); };
export const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

/** A machine with other work to do may be slow: so long is waited for what a page does in a moment. */
const patience = 100000;
/** Waits until it holds. @return whether it did */
export async function until(holds) {
  for (const began = Date.now(); !(await holds()); await wait(50)) if (Date.now() - began > patience) return false;
  return true;
}

export const browser = await chromium.launchPersistentContext(join(folder, 'profile'), {
  executablePath: process.env.CHROMIUM ?? execFileSync('sh', ['-c', 'command -v chromium']).toString().trim(),
  headless: true,
  timeout: patience,
  hasTouch: true,
  viewport: { width: 900, height: 560 },
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-quic', '--no-first-run',
    '--disable-background-networking', '--disable-component-update', '--disable-sync'],
});
browser.setDefaultTimeout(patience);

let probing = false;  // what is refused then is told on the console, as it should be

const plays = (page) => page.evaluate(() => globalThis.limber !== undefined || document.getElementById('message').textContent !== '');

/** Opens a page and waits until it plays or says why not. */
export async function open(path, holds = plays, fragment = '') {
  const page = await browser.newPage(), url = pathToFileURL(resolve(path)).href;
  page.on('console', (message) => { if (message.type() === 'error' && !probing) wrong.push(`console: ${message.text()}`); });
  page.on('pageerror', (error) => wrong.push(`an error in the page: ${error.message}`));
  page.on('request', (request) => {
    if (request.url().split('#')[0] !== url && !/^(data|blob):/.test(request.url())) wrong.push(`a request: ${request.url().slice(0, 200)}`);
  });
  await page.goto(url + fragment);
  await until(() => holds(page));
  return page;
}

/** What the page is allowed to do, and what is in it. */
export async function isSafe(page, path) {
  const policy = await page.evaluate(() => document.querySelector('meta[http-equiv="Content-Security-Policy"]').content);
  check(/default-src 'none'/.test(policy) && !/unsafe-inline|unsafe-eval|https?:|\*/.test(policy.replace("'wasm-unsafe-eval'", '')), `the policy is strict: ${policy}`);
  check(/script-src[^;]*'strict-dynamic'/.test(policy) && !/script-src[^;]*(data|blob):/.test(policy), 'markup brings no scripts');
  probing = true;
  const refused = await page.evaluate(() => new Promise((done) => setTimeout(() => {  // as the page's own script, not as the browser's tools
    try {
      globalThis.eval('1 + 1');
      done(false);
    } catch (error) {
      done(error instanceof EvalError);
    }
  })));
  await wait(100);
  probing = false;
  check(refused, 'text is not run as a script');
  const text = readFileSync(path, 'utf8'), script = gunzipSync(Buffer.from(/id="app">([^<]*)</.exec(text)[1], 'base64')).toString();
  check(script.length > 1000 && !/\beval\(|new Function\(/.test(script), 'the script runs no text');
  const licences = await page.evaluate(() => document.getElementById('licences').textContent);
  for (const name of ['limber', 'three.js', 'Eigen', 'Highway', 'JSON for Modern C++', 'Emscripten', 'Permission is hereby granted'])
    check(licences.includes(name), `licences tell of ${name}`);
}

/** Runs checks, tells what does not hold, and ends the program. */
export async function run(name, file, checks) {
  try {
    await checks();
  } catch (error) {
    wrong.push(`the check itself: ${error.message}`);
  } finally {
    await browser.close();
    rmSync(folder, { recursive: true, force: true });
  }
  for (const claim of wrong) console.error(`${name}: does not hold: ${claim}`);
  console.log(wrong.length === 0 ? `${name}: ${file} holds` : `${name}: ${wrong.length} claims do not hold`);
  process.exit(wrong.length === 0 ? 0 : 1);
}
