// The scene of a page, as a person has it: limber/scene, hands that reach into its World, and a history.
import { Snapshot } from 'limber';
import { load, Scene } from 'limber/scene';
import { array, Hands, rayHits } from './hands.js';
import { History } from './history.js';
import { base64Of, bytesOf, fileOf } from './unpack.js';

const VISIBLE = 0.1;  // of a model's size, for a mode that is shown

/** @param wasm bytes. @param files of the page (unpack.js) */
export async function openScene(wasm, files, scene) {
  const path = (from) => from.replace(/^\//, '');
  await load(wasm);
  return new Engine(Scene.open(Object.fromEntries(await Promise.all(files.map(async (file) => [path(file.path), await fileOf(file)]))), path(scene)));
}

export class Engine {
  /** @param played limber/scene's Scene, before it begins */
  constructor(played) {
    this.played = played;
    this.history = new History();
    this.live = { drag_frequency: 3, poke_speed: 1 };
    this.hit = null;  // of the last cast
    this.describe();
  }

  describe() {
    const { description, models } = this.played;
    this.surfaces = models.map((model) => model.getData());
    this.scene = { ...description, settings: { ...description.settings, ...this.live }, bodies: description.bodies.slice(),
      models: description.models.map((told, i) => ({ ...told, mass: this.surfaces[i].mass, frequencies: [...this.surfaces[i].eigenvalue].map((x) => Math.sqrt(x) / (2 * Math.PI)) })) };
    this.visible = {};
    this.added = [];  // models of bodies that were dropped, in this history
    this.measure();
  }
  measure() {
    this.sizes = this.scene.bodies.map(({ model }) => 7 + this.scene.models[model].frequencies.length);
  }
  get world() { return this.played.world; }

  /** Makes the world anew: before the first time bodies may be looked at as they are placed. */
  begin(settings = {}) {
    this.hit = null;
    const { gravity, step, substeps, modes, damping, friction, solver, joint_friction, stiffness } = { ...this.scene.settings, ...settings };
    this.played.begin({ gravity, step, substeps, modes, damping, friction, solver, joint_friction, stiffness });
    this.history.clear();
    this.world.setStageTimes(true);
    this.hands = new Hands(this.played);
    this.describe();
  }
  restart(settings) {
    const { drag_frequency, poke_speed } = settings;
    Object.assign(this.live, { drag_frequency, poke_speed });
    this.begin({ ...settings, stiffness: this.scene.settings.stiffness });
    this.keep();
  }
  keep() { this.history.keep(this.played, this.hands.held, this.dropped); }
  /** How many bodies. */
  get dropped() { return this.scene.bodies.length - this.played.description.bodies.length; }

  /** Gravity and hands at once. */
  setLive({ gravity, drag_frequency, poke_speed }) {
    if (gravity.some((x, i) => x !== this.scene.settings.gravity[i])) this.world.setGravity(gravity);
    Object.assign(this.live, { drag_frequency, poke_speed });
    Object.assign(this.scene.settings, { gravity, drag_frequency, poke_speed });
  }

  /** The clock begins at 0; bodies keep places and speeds, and their bending unless the model becomes rigid or was. @param factor on Young's modulus; Infinity: rigid */
  setStiffness(model, factor) {
    const stiffness = this.scene.settings.stiffness.map((x, i) => (i === model ? factor : x));
    const before = this.played.bodies.map((id) => {
      const { pose, velocity, angularVelocity, amplitude, rate } = this.world.bodyState(id);
      return { pose, velocity, angularVelocity, amplitude: amplitude.slice(), rate: rate.slice() };
    });
    const added = this.added.slice(0, this.dropped), { joints } = this.hands.held;
    this.begin({ stiffness });
    this.addAll(added);
    before.forEach(({ pose, velocity, angularVelocity, amplitude, rate }, i) => {
      const id = this.played.bodies[i];
      this.world.setPose(id, pose);
      this.world.setVelocity(id, velocity, angularVelocity);
      if (amplitude.length === this.sizes[i] - 7) this.world.setAmplitudes(id, amplitude, rate);
    });
    joints.forEach((wishes, j) => wishes.forEach((wish, c) => {
      if (!Number.isNaN(wish.place) || !Number.isNaN(wish.speed)) this.wishJoint(j, c, wish);
    }));
    this.keep();
  }

  model(i) { return surface(this.surfaces[i].render); }
  /** The surface by which bodies of a model touch; null: the drawn one. */
  touching(i) {
    const { render, collision } = this.played.models[i].getData();
    return collision.rest.byteOffset === render.rest.byteOffset ? null : surface(collision);
  }
  bent(body, tolerance, touching) { return this.world === undefined ? null : this.played.bent(body, tolerance, touching); }

  step() {
    this.world.setStageTimes(true);  // from 0
    this.played.step();
    this.keep();
  }
  steps() { return this.played.stepsTaken(); }
  hash() { return this.world.stateHash().toString(16).padStart(16, '0'); }
  frame() { return this.played.frame(); }
  numbers() {
    const { kineticRigid: rigid, kineticModal: modal, elastic, potential, asleep, pressing: contacts } = this.played.sums();
    return { time: this.world.time(), rigid, modal, elastic, potential, asleep, contacts, solved: this.world.constraintReport().solved };
  }
  /** Seconds of the last step, as limber/core/stage_times.h has its stages, those of a step. */
  stages() { return this.world.getStageTimes().seconds.slice(0, 8); }
  contacts() { return this.played.contacts(); }
  sensorCounts() { return this.played.sensors.map((id) => this.world.listInside(id).length); }

  jointFrames() { return this.hands.jointFrames(); }
  jointWishes() { return this.hands.held.joints; }
  wishJoint(joint, coordinate, wish) { this.hands.wish(joint, coordinate, isAngle(this.scene.joints[joint].type, coordinate), wish); }
  leadJoint(joint, coordinate, place) { this.wishJoint(joint, coordinate, { place }); }
  runJoint(joint, coordinate, speed) { this.wishJoint(joint, coordinate, { speed }); }
  leaveJoint(joint, coordinate) { this.wishJoint(joint, coordinate); }

  /** The number of a body of the scene; −1: one that does not move. */
  number({ index, generation }) { return this.played.bodies.findIndex((id) => id.index === index && id.generation === generation); }
  /** @return [{body, point, normal}] of all that a ray meets, by distance; body −1: one that does not move */
  rayPlaces(from, along) {
    return rayHits(this.world, from, along).map(({ body, position, normal }) => ({ body: this.number(body), point: array(position), normal: array(normal) }));
  }
  /** The first body that moves in a ray's way. It stays until the next cast. */
  cast(from, along) {
    this.hit = rayHits(this.world, from, along).find(({ body, hasPoint }) => hasPoint && this.number(body) >= 0) ?? null;
    return this.hit && { body: this.number(this.hit.body), point: array(this.hit.position), distance: this.hit.distance };
  }
  /** @return whether there was something to take */
  grab() {
    if (this.hit !== null) this.hands.grab(this.hit, this.live.drag_frequency);
    return this.hit !== null;
  }
  dragTo(target) { this.hands.dragTo(target); }
  letGo() { this.hands.letGo(); }
  hand() { return this.hands.state(); }
  pin() { if (this.hit !== null) this.hands.pin(this.hit); }
  unpin() { this.hands.unpin(); }
  /** @param contactTime seconds, for the ear alone */
  poke(along, contactTime) {
    if (this.hit === null) return;
    const impulse = this.hands.poke(this.hit, along, this.live.poke_speed);
    this.played.noteBlow(this.number(this.hit.body), array(this.hit.position), impulse, contactTime);
  }

  drop(model, at) {
    this.addAll([...this.added.slice(0, this.dropped), model], at);  // others are of a future that will not be
  }
  addAll(models, at) {
    this.added = models;
    this.addUntil(models.length, at);
  }
  /** Ids are given in the same order again. */
  addUntil(count, at = [0, 0, 0]) {
    for (let i = this.dropped; i < count; ++i) {
      const name = `dropped[${i}]`;
      this.played.addBody(this.added[i], at, name);
      this.scene.bodies.push({ name, model: this.added[i] });
    }
    this.measure();
  }

  /** All others of the body are at rest. */
  showMode(body, mode, share) {
    const rest = new Float64Array(this.sizes[body] - 7), amplitudes = rest.slice();
    amplitudes[mode] = share * (this.visible[`${body} ${mode}`] ??= this.visibleAmplitude(this.scene.bodies[body].model, mode));
    this.world.setAmplitudes(this.played.bodies[body], amplitudes, rest);
  }
  /** The amplitude at which a mode moves some vertex by a tenth of the model's size. */
  visibleAmplitude(number, mode) {
    const model = this.played.models[number], { render, modeScale } = model.getData(), rest = render.rest.slice(), target = new Float32Array(rest.length);
    const scale = modeScale[mode];
    model.morphTarget(mode, target);
    const longest = (of) => of.reduce((most, _, i) => (i % 3 === 0 ? Math.max(most, Math.hypot(of[i], of[i + 1], of[i + 2])) : most), 0);
    const moved = longest(target);
    return moved > 0 ? (VISIBLE * longest(rest) * scale) / moved : 0;
  }

  sound(model) { return this.played.sound(model); }
  loudness(model, contactTime) { return this.played.loudness(model, contactTime); }
  listen(on) { this.played.listen(on); }
  takeBlows() { return this.played.takeBlows(); }

  kept() { return this.history.keys.length; }
  keptStep(key) { return this.history.keys[key].step; }
  /** Back, or forth again, to the bit: a hand that held something then holds it again. */
  goTo(key) {
    const { snapshot, hands, added } = this.history.keys[key];
    this.return(() => snapshot.bytes(), hands, added);
  }
  /** @param bytes gives them, in memory that has grown meanwhile */
  return(bytes, hands, added) {
    this.addUntil(added);
    this.played.restoreState(bytes());
    this.scene.bodies.length = this.played.bodies.length;
    this.measure();
    this.hands = new Hands(this.played, structuredClone(hands));
    this.scene.settings.gravity = array(this.world.getOptions().gravity);
  }

  /** @return the bytes of an animated GLB of what was kept */
  recording() {
    const here = Snapshot.create(), hands = this.hands.held, added = this.dropped;
    this.played.saveState(here);
    try {
      for (let key = 0; key < this.kept(); ++key) {
        this.goTo(key);
        this.played.record();
      }
      return this.played.recording();
    } finally {
      this.return(() => here.bytes(), hands, added);
      here.dispose();
    }
  }

  /** @return what JSON tells, from which a page goes on that has the same scene */
  saved() {
    const here = Snapshot.create();
    this.played.saveState(here);
    const state = base64Of(here.bytes());
    here.dispose();
    return { settings: this.scene.settings, added: this.added.slice(0, this.dropped), hands: this.hands.held, state };
  }
  /** Goes on from there; what was kept before is forgotten. */
  restore({ settings, added, hands, state }) {
    const { drag_frequency, poke_speed } = settings, number = (x) => x ?? NaN;
    Object.assign(this.live, { drag_frequency, poke_speed });
    this.begin(settings);
    this.keep();
    this.addAll(added);
    this.return(() => bytesOf(state), { ...hands, joints: hands.joints.map((all) => all.map(({ place, speed }) => ({ place: number(place), speed: number(speed) }))) }, added.length);
    this.keep();
  }

  reconstruct(body) {
    const positions = new Float32Array(3 * this.played.models[this.scene.bodies[body].model].getData().render.vertices);
    this.world.reconstruct(this.played.bodies[body], positions, null, 1);
    return positions;
  }
}

const surface = ({ rest, corner }) => ({ rest: rest.slice(), triangles: Uint32Array.from(corner) });

const isAngle = (type, coordinate) => type === 'ball' || (type === 'planar' ? coordinate === 2 : type !== 'prismatic' && coordinate === 0);
