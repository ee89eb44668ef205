// The entry limber/posing: PoseEngine, which the page of limber-view poses by too, over files in memory.
import { PoseEngine } from './pose_engine.js';
import makePosing from './posing_wasm.js';
import { compile, LimberError, start } from './source.js';

export { LimberError };

let loading;

/** Loads the WebAssembly, once. @param source of posing.wasm, as limber's load() takes it */
export function load(source = new URL('./posing.wasm', import.meta.url)) {
  return loading ??= compile(source, 'posing.wasm').catch((error) => { loading = undefined; throw error; });
}

/** A jointed model that is pulled at points. Each has a WebAssembly of its own, which goes with it. */
export class Posing extends PoseEngine {
  /** @param files texts or bytes by their names @param model, joints names of two of them */
  static async open(files, model, joints) {
    if (loading === undefined) throw new LimberError(1, 'limber/posing is not loaded yet: await load() first');
    const module = await start(makePosing, await loading);
    for (const name in files) module.FS.writeFile(`/${name}`, typeof files[name] === 'string' ? files[name] : new Uint8Array(files[name]));
    return new Posing(module, `/${model}`, `/${joints}`);
  }

  check(done) {
    if (!done) throw new LimberError(2, this.module.UTF8ToString(this.module._pose_error()));
  }
}
