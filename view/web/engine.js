// The engine: WebAssembly behind plain functions, with texts and arrays copied out where they are to last.
import makePageEngine from 'page-engine';

export function bytesOf(base64) {
  const text = atob(base64.trim());
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

export async function unzipped(bytes) {
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

/** @param wasm compressed by gzip. @param files [{path, base64}], their paths below /scene/ */
export async function openModule(wasm, files) {
  const module = await makePageEngine({ wasmBinary: await unzipped(wasm), print() {}, printErr() {} });
  for (const { path, base64 } of files) {
    module.FS.mkdirTree(path.slice(0, path.lastIndexOf('/')));
    module.FS.writeFile(path, bytesOf(base64));
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
    this.settingsAt = module._malloc(11 * 8);
    this.describe();
  }

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
    const { vertices, triangles, frequencies } = this.scene.models[i], data = (what) => this.module._page_model_data(i, what);
    const corners = data(3) / 4;
    return {
      rest: this.floats(data(0), 3 * vertices),
      normals: this.floats(data(1), 3 * vertices),
      shapes: this.floats(data(2), 8 * vertices * frequencies.length),
      triangles: this.module.HEAPU32.slice(corners, corners + 3 * triangles),
      vertices,
      modes: frequencies.length,
    };
  }

  writeSettings(s) {
    const solvers = ['game', 'exact'];
    this.module.HEAPF64.set([...s.gravity, s.drag_frequency, s.poke_speed, s.step, s.substeps, s.modes, s.damping, s.friction,
      solvers.indexOf(s.solver)], this.settingsAt / 8);
  }
  setLive(s) { this.writeSettings(s); this.check(this.module._page_set_live(this.settingsAt)); }
  restart(s) { this.writeSettings(s); this.check(this.module._page_restart(this.settingsAt)); this.describe(); }

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
  recording() {
    const size = this.module._page_record();
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
