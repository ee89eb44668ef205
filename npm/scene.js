// The entry limber/scene: limber, and scenes that go on in a World.
import { Model, World } from './limber.js';
import { check, LimberError, loaded, loadOnce, Native, wrapped } from './native.js';
import makeScene from './scene_wasm.js';

export { LimberError };

/** Loads the WebAssembly, which is limber's too. @param source of scene.wasm, as limber's load() takes it */
export async function load(source = new URL('./scene.wasm', import.meta.url)) {
  await loadOnce(makeScene, source, 'scene.wasm');
  if (!loaded()._scene_open) throw new LimberError(1, 'limber is loaded without scenes: load limber/scene in its place');
}

const SOLVERS = ['game', 'exact'];

/** Calls with room for numbers, a text, and a pointer that is written. @param act of the module and the addresses */
function call(act, numbers = [], text = '') {
  const { stackSave, stackRestore, stackAlloc, HEAPU8 } = loaded(), stack = stackSave(), told = new TextEncoder().encode(`${text}\0`);
  try {
    const at = stackAlloc(8 * numbers.length + 16), name = stackAlloc(told.length);
    new Float64Array(HEAPU8.buffer, at + 16, numbers.length).set(numbers);
    HEAPU8.set(told, name);
    check(act(loaded(), at + 16, name, at));
    return new Uint32Array(loaded().HEAPU8.buffer, at, 1)[0];
  } finally {
    stackRestore(stack);
  }
}

export class Scene extends Native {
  /** @param files texts or bytes by their paths @param name of the scene, one of them */
  static open(files, name) {
    const { FS } = loaded(), paths = Object.keys(files).map((path) => `/${path}`);
    try {
      for (const path of paths) {
        const bytes = files[path.slice(1)];
        FS.mkdirTree(path.slice(0, path.lastIndexOf('/')) || '/');
        FS.writeFile(path, typeof bytes === 'string' ? bytes : new Uint8Array(bytes));
      }
      const pointer = call((wasm, _, path, made) => wasm._scene_open(path, made), [], `/${name}`);
      const scene = wrapped(Scene, pointer, () => loaded()._scene_destroy(pointer));
      scene.describe();
      return scene;
    } finally {
      for (const path of paths) if (FS.analyzePath(path).exists) FS.unlink(path);
    }
  }

  describe() {
    this.description = JSON.parse(new TextDecoder().decode(this.answer((wasm) => wasm._scene_description(this.pointer), Uint8Array)));
    this.models = this.description.models.map((_, i) => wrapped(Model, loaded()._scene_model(this.pointer, i), undefined, this));
  }

  /** What a call leaves as its answer. @param act of the module */
  view(act, Type) {
    call(act);
    const [at, count] = new Uint32Array(loaded().HEAPU8.buffer, loaded()._scene_answer(this.pointer), 2);
    return new Type(loaded().HEAPU8.buffer, count === 0 ? 0 : at, count);
  }
  answer(act, Type) { return this.view(act, Type).slice(); }

  begin(settings = {}) {
    const { gravity, step, substeps, modes, damping, friction, solver, joint_friction, stiffness } = { ...this.description.settings, ...settings };
    call((wasm, numbers) => wasm._scene_set(this.pointer, numbers, 10 + stiffness.length), [...gravity, step, substeps, modes, damping, friction,
      SOLVERS.indexOf(solver), joint_friction, ...stiffness.map((factor) => factor ?? Infinity)]);
    for (const gone of [this.world, ...this.models]) gone?.dispose();
    this.world = undefined;
    this.world = wrapped(World, call((wasm, _, __, made) => wasm._scene_begin(this.pointer, made)), undefined, this);
    this.describe();
    [this.bodies, this.statics, this.sensors, this.joints] = [0, 1, 2, 3].map((what) => this.ids(what));
    return this.world;
  }
  dispose() {
    this.world?.dispose();
    super.dispose();
  }
  ids(what) {
    const numbers = this.view((wasm) => wasm._scene_ids(this.pointer, what), Uint32Array);
    return Array.from({ length: numbers.length / 2 }, (_, i) => ({ index: numbers[2 * i], generation: numbers[2 * i + 1] }));
  }

  addBody(model, [x, y, z], name) {
    call((wasm, _, text) => wasm._scene_add_body(this.pointer, model, x, y, z, text), [], name);
    this.bodies = this.ids(0);
    return this.bodies.at(-1);
  }
  step() { check(loaded()._scene_step(this.pointer)); }
  stepsTaken() { return loaded()._scene_steps_taken(this.pointer); }
  saveState(snapshot) { check(loaded()._scene_save_state(this.pointer, snapshot.pointer)); }
  restoreState(bytes) {
    const { _malloc, _free } = loaded(), outside = bytes.buffer !== loaded().HEAPU8.buffer, at = outside ? _malloc(bytes.length) : bytes.byteOffset;
    if (outside) loaded().HEAPU8.set(bytes, at);
    try {
      check(loaded()._scene_restore_state(this.pointer, at, bytes.length));
    } finally {
      if (outside) _free(at);
      this.bodies = this.ids(0);
    }
  }

  frame() { return this.answer((wasm) => wasm._scene_frame(this.pointer), Float32Array); }
  bent(body, tolerance, touching = false) {
    let normals;
    const positions = this.view((wasm, _, __, at) => {
      const result = wasm._scene_bent(this.pointer, body, tolerance, touching, at);
      normals = new Uint32Array(wasm.HEAPU8.buffer, at, 1)[0];
      return result;
    }, Float32Array);
    return positions.length === 0 ? null : { positions, normals: new Float32Array(positions.buffer, normals, positions.length) };
  }
  sums() {
    const [kineticRigid, potential, kineticModal, elastic, asleep, pressing] = this.view((wasm) => wasm._scene_sums(this.pointer), Float64Array);
    return { kineticRigid, potential, kineticModal, elastic, asleep, pressing };
  }
  contacts() { return this.answer((wasm) => wasm._scene_contacts(this.pointer), Float64Array); }

  record() { check(loaded()._scene_record(this.pointer)); }
  recording() { return this.answer((wasm) => wasm._scene_recording(this.pointer), Uint8Array); }

  sound(model) {
    const { modes, vertices } = this.description.models[model].sound;
    if (modes === 0) return null;
    const part = (what, Type = Float64Array) => this.answer((wasm) => wasm._scene_sound(this.pointer, model, what), Type);
    return { modes, vertices, eigenvalues: part(0), decays: part(1), gains: part(2), shapes: part(3, Float32Array) };
  }
  loudness(model, contactTime) { return loaded()._scene_loudness(this.pointer, model, contactTime); }
  listen(on) { loaded()._scene_listen(this.pointer, on); }
  noteBlow(body, at, impulse, contactTime) {
    call((wasm, numbers) => wasm._scene_note_blow(this.pointer, body, numbers, contactTime), [...at, ...impulse]);
  }
  takeBlows() { return this.answer((wasm) => wasm._scene_take_blows(this.pointer), Float64Array); }
}
