// What both entries of the package share: errors, and where WebAssembly comes from.

/** What limber throws; the message is the library's line. */
export class LimberError extends Error {
  constructor(result, line) {
    super(line);
    this.name = 'LimberError';
    this.result = result;
  }
}

/** @param source of WebAssembly: bytes, a Response, a URL, a WebAssembly.Module, or a promise of one. @param file its name */
export async function compile(source, file) {
  let code = await source;
  if (typeof code === 'string' || code instanceof URL) code = await fetch(code);
  if (typeof Response !== 'undefined' && code instanceof Response) {
    if (!code.ok) throw new LimberError(1, `${code.url}: ${code.status}, expected ${file}: give load() its URL or bytes`);
    code = await code.arrayBuffer();
  }
  return code instanceof WebAssembly.Module ? code : WebAssembly.compile(code);
}

/** @param make what emscripten wrote beside the WebAssembly @param module compiled */
export function start(make, module) {
  return new Promise((done, fail) => {
    const instantiateWasm = (imports, ready) => { WebAssembly.instantiate(module, imports).then(ready).catch(fail); return {}; };
    make({ instantiateWasm }).then(done, fail);
  });
}
