// The entry limber/posing, by which the page of limber-view poses too.
import makePosing from './posing_wasm.js';
import { compile, LimberError, start } from './source.js';

export { LimberError };

let loading;

/** Loads the WebAssembly, once. @param source of posing.wasm, as limber's load() takes it */
export function load(source = new URL('./posing.wasm', import.meta.url)) {
  return loading ??= compile(source, 'posing.wasm').catch((error) => { loading = undefined; throw error; });
}

/** A jointed model that is pulled at points. Each has a WebAssembly of its own, which goes with it. */
export class Posing {
  /** @param files texts or bytes by their names @param model, joints names of two of them */
  static async open(files, model, joints) {
    if (loading === undefined) throw new LimberError(1, 'limber/posing is not loaded yet: await load() first');
    const module = await start(makePosing, await loading);
    for (const name in files) module.FS.writeFile(`/${name}`, typeof files[name] === 'string' ? files[name] : new Uint8Array(files[name]));
    return new Posing(module, `/${model}`, `/${joints}`);
  }

  constructor(module, model, joints) {
    this.module = module;
    this.check(this.withTexts((a, b) => module._pose_open(a, b), model, joints));
    this.describe();
  }

  check(done) {
    if (!done) throw new LimberError(2, this.module.UTF8ToString(this.module._pose_error()));
  }

  withTexts(act, ...texts) {
    const { module } = this, places = texts.map((text) => {
      const length = module.lengthBytesUTF8(text) + 1, at = module._malloc(length);
      module.stringToUTF8(text, at, length);
      return at;
    });
    const result = act(...places);
    for (const at of places) module._free(at);
    return result;
  }

  describe() {
    this.scene = JSON.parse(this.module.UTF8ToString(this.module._pose_description()));
    const at = this.module._pose_triangles() / 4, count = 3 * this.scene.parts.reduce((sum, part) => sum + part.triangles, 0);
    this.triangles = this.module.HEAPU32.slice(at, at + count);
  }
  doubles(at, count) { return this.module.HEAPF64.slice(at / 8, at / 8 + count); }

  positions() {
    const at = this.module._pose_positions() / 4;
    return this.module.HEAPF32.slice(at, at + 3 * this.scene.vertices);
  }
  jointFrames() { return this.doubles(this.module._pose_joint_frames(), 9 * this.scene.joints.length); }
  /** @return [{point, target}] */
  handles() {
    const count = this.module._pose_handle_count(), all = this.doubles(this.module._pose_handles(), 6 * count);
    return Array.from({ length: count }, (_, i) => ({ point: [...all.slice(6 * i, 6 * i + 3)], target: [...all.slice(6 * i + 3, 6 * i + 6)] }));
  }

  cast(from, along) {
    const [part, x, y, z, distance] = this.doubles(this.module._pose_cast(...from, ...along), 5);
    return part < 0 ? null : { part, point: [x, y, z], distance };
  }
  grab() { this.check(this.module._pose_grab()); }
  take(handle) { this.check(this.module._pose_take(handle)); }
  dragTo(target) { this.module._pose_drag_to(...target); }
  letGo() { this.module._pose_let_go(); }
  removeHandles() { this.module._pose_remove_handles(); }

  setName(part, name) {
    this.check(this.withTexts((text) => this.module._pose_set_name(part, text), name));
    this.describe();
  }
  setPinned(part, pinned) { this.check(this.module._pose_set_pinned(part, pinned ? 1 : 0)); this.describe(); }
  setSoft(part, soft) { this.check(this.module._pose_set_soft(part, soft ? 1 : 0)); this.describe(); }
  setJoint(joint, told) {
    this.check(this.withTexts((text) => this.module._pose_set_joint(joint, text), JSON.stringify(told)));
    this.describe();
  }
  /** Cuts the part of the last cast. @param from, to directions from the eye to the ends of a stroke */
  cut(eye, from, to) { this.check(this.module._pose_cut(...eye, ...from, ...to)); this.describe(); }
  undo() {
    const done = this.module._pose_undo() === 1;
    this.describe();
    return done;
  }
  reset() { this.module._pose_reset(); }

  solve() {
    const at = this.module._pose_solve();
    this.check(at !== 0);
    const [status, iterations, energy, jointError, limitViolation, handleError] = this.doubles(at, 6);
    return { status: ['converged', 'local minimum', 'going on', 'stalled', 'infeasible'][status], iterations, energy, jointError, limitViolation, handleError };
  }
  modelText() { return this.module.UTF8ToString(this.module._pose_model_text()); }
  jointsText() { return this.module.UTF8ToString(this.module._pose_joints_text()); }
}
