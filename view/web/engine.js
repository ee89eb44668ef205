// The engine: WebAssembly behind plain functions, with texts and arrays copied out where they are to last.
import makePageEngine from 'page-engine';
import { fileOf } from './unpack.js';

/** @param wasm bytes. @param files of the page (unpack.js), their paths below /scene/ */
export async function openModule(wasm, files) {
  const module = await makePageEngine({ wasmBinary: wasm, print() {}, printErr() {} });
  for (const file of files) {
    module.FS.mkdirTree(file.path.slice(0, file.path.lastIndexOf('/')));
    module.FS.writeFile(file.path, await fileOf(file));
  }
  return module;
}

export class Engine {
  /** @throws Error with the engine's own line */
  constructor(module, scene) {
    this.module = module;
    const length = module.lengthBytesUTF8(scene) + 1, at = module._malloc(length);
    module.stringToUTF8(scene, at, length);
    const opened = module._page_open(at);
    module._free(at);
    this.check(opened);
    this.settingsAt = module._malloc(12 * 8);
    this.describe();
  }

  /** Makes the world: until then bodies may be looked at as they are placed. */
  begin() { this.check(this.module._page_begin()); }

  check(done) {
    if (!done) throw new Error(this.module.UTF8ToString(this.module._page_error()));
  }

  describe() {
    this.scene = JSON.parse(this.module.UTF8ToString(this.module._page_description()));
    this.sizes = this.scene.bodies.map((body) => 7 + this.scene.models[body.model].frequencies.length);
    this.frameSize = this.sizes.reduce((sum, size) => sum + size, 0);
  }

  floats(at, count) { return this.module.HEAPF32.slice(at / 4, at / 4 + count); }
  doubles(at, count) { return this.module.HEAPF64.slice(at / 8, at / 8 + count); }

  model(i) {
    const { vertices, triangles } = this.scene.models[i];
    return this.surface(i, 0, vertices, triangles);
  }
  /** The surface by which bodies of a model touch; null: the drawn one. */
  touching(i) {
    const [vertices, triangles] = this.doubles(this.module._page_touching_size(i), 2);
    return vertices === 0 ? null : this.surface(i, 3, vertices, triangles);
  }
  surface(i, first, vertices, triangles) {
    const data = (what) => this.module._page_model_data(i, first + what), corners = data(2) / 4;
    return {
      rest: this.floats(data(0), 3 * vertices),
      normals: this.floats(data(1), 3 * vertices),
      triangles: this.module.HEAPU32.slice(corners, corners + 3 * triangles),
    };
  }
  /**
   * A body's surface in its own frame, off by no more than the tolerance, m. @param touching that by which it touches
   * @return {positions, normals} until the next call of the engine; null: it is at rest
   */
  bent(body, tolerance, touching, vertices) {
    if (this.module._page_bend(body, tolerance, touching ? 1 : 0) === 0) return null;
    const floats = (what) => new Float32Array(this.module.HEAPF32.buffer, this.module._page_bent(what), 3 * vertices);
    return { positions: floats(0), normals: floats(1) };
  }

  writeSettings(s) {
    const solvers = ['game', 'exact'];
    this.module.HEAPF64.set([...s.gravity, s.drag_frequency, s.poke_speed, s.step, s.substeps, s.modes, s.damping, s.friction,
      solvers.indexOf(s.solver), s.joint_friction], this.settingsAt / 8);
  }
  setLive(s) { this.writeSettings(s); this.check(this.module._page_set_live(this.settingsAt)); }
  restart(s) { this.writeSettings(s); this.check(this.module._page_restart(this.settingsAt)); this.describe(); }

  /** @param factor on Young's modulus; Infinity: rigid */
  setStiffness(model, factor) { this.check(this.module._page_set_stiffness(model, factor)); this.describe(); }

  step() { this.check(this.module._page_step()); this.check(this.module._page_keep()); }
  steps() { return this.module._page_steps_taken(); }
  hash() { return this.module.UTF8ToString(this.module._page_hash()); }
  frame() { return this.floats(this.module._page_frame(), this.frameSize); }
  numbers() {
    const [time, rigid, modal, elastic, potential, asleep, contacts, rows, iterations, solved] =
      this.doubles(this.module._page_numbers(), 10);
    return { time, rigid, modal, elastic, potential, asleep, contacts, rows, iterations, solved };
  }
  /** Seconds of the last step, as limber/core/stage_times.h has its stages, those of a step. */
  stages() { return [...this.doubles(this.module._page_stage_seconds(), 8)]; }
  jointFrames() { return this.doubles(this.module._page_joint_frames(), 9 * this.scene.joints.length); }
  /** @return by joint and coordinate {place, speed} where it is led and how fast it runs; NaN: neither */
  jointWishes() {
    const all = this.doubles(this.module._page_joint_wishes(), 6 * this.scene.joints.length);
    return this.scene.joints.map((_, j) => [0, 1, 2].map((c) => ({ place: all[6 * j + 2 * c], speed: all[6 * j + 2 * c + 1] })));
  }
  leadJoint(joint, coordinate, place) { this.check(this.module._page_lead_joint(joint, coordinate, place)); }
  runJoint(joint, coordinate, speed) { this.check(this.module._page_run_joint(joint, coordinate, speed)); }
  leaveJoint(joint, coordinate) { this.check(this.module._page_leave_joint(joint, coordinate)); }
  /** @return six numbers each, of what pressed in the last step: place and force */
  contacts() {
    const count = this.module._page_contact_count();
    return this.doubles(this.module._page_contacts(), 6 * count);
  }
  /** How many bodies are in each sensor. */
  sensorCounts() { return this.doubles(this.module._page_sensor_counts(), this.scene.sensors.length); }

  /** @return [{body, point, normal}] of all that a ray meets, by distance; body −1: one that does not move */
  rayPlaces(from, along) {
    const count = this.module._page_ray(...from, ...along), all = this.doubles(this.module._page_ray_places(), 7 * count);
    return Array.from({ length: count }, (_, i) => all.slice(7 * i, 7 * i + 7))
      .map(([body, x, y, z, nx, ny, nz]) => ({ body, point: [x, y, z], normal: [nx, ny, nz] }));
  }

  cast(from, along) {
    const [body, x, y, z, distance] = this.doubles(this.module._page_cast(...from, ...along), 5);
    return body < 0 ? null : { body, point: [x, y, z], distance };
  }
  grab() { return this.module._page_grab() === 1; }
  dragTo(target) { this.module._page_drag_to(...target); }
  letGo() { this.module._page_let_go(); }
  hand() {
    const a = this.doubles(this.module._page_hand(), 11);
    return { holds: a[0] === 1, point: a.slice(1, 4), target: a.slice(4, 7), force: a.slice(7, 10), pins: a[10] };
  }
  pin() { this.check(this.module._page_pin()); }
  unpin() { this.module._page_unpin(); }
  /** @param contactTime seconds, for the ear alone */
  poke(along, contactTime) { this.check(this.module._page_poke(...along, contactTime)); }
  drop(model, at) { this.check(this.module._page_drop(model, ...at)); this.describe(); }
  showMode(body, mode, amplitude) { this.check(this.module._page_show_mode(body, mode, amplitude)); }

  /** What one hears of a model: null, or its modes at the vertices of the surface that is struck. */
  sound(model) {
    const { modes, vertices } = this.scene.models[model].sound, data = (what) => this.module._page_sound_data(model, what);
    if (modes === 0) return null;
    const [eigenvalues, decays, gains] = [0, 1, 2].map((what) => this.doubles(data(what), modes));
    return { modes, vertices, eigenvalues, decays, gains, shapes: this.floats(data(3), 3 * modes * vertices) };
  }
  /** Pascals at one metre that no poke at 1 m/s exceeds. */
  loudness(model, contactTime) { return this.module._page_loudness(model, contactTime); }
  listen(on) { this.module._page_listen(on ? 1 : 0); }
  /** Blows since the last call, 15 numbers each: PageWorld::take_blows() */
  takeBlows() {
    const count = this.module._page_blows();
    return this.doubles(this.module._page_blow_numbers(), count);
  }

  kept() { return this.module._page_kept(); }
  keptStep(key) { return this.module._page_kept_step(key); }
  goTo(key) { this.check(this.module._page_go_to(key)); this.describe(); }

  /** @return the bytes of an animated GLB */
  recording() { return this.bytes(this.module._page_record()); }
  /** @return bytes from which a page goes on that has the same scene */
  saved() { return this.bytes(this.module._page_save()); }
  restore(bytes) {
    const at = this.module._malloc(bytes.length);
    this.module.HEAPU8.set(bytes, at);
    const restored = this.module._page_restore(at, bytes.length);
    this.module._free(at);
    this.check(restored);
    this.describe();
  }
  bytes(size) {
    this.check(size > 0);
    const at = this.module._page_text();
    return this.module.HEAPU8.slice(at, at + size);
  }

  reconstruct(body) {
    const count = 3 * this.scene.models[this.scene.bodies[body].model].vertices, at = this.module._malloc(4 * count);
    this.check(this.module._page_reconstruct(body, at));
    const positions = this.floats(at, count);
    this.module._free(at);
    return positions;
  }
}
