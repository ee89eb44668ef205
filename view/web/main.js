// The page: a scene that goes on in real time, and a person who reaches into it.
import { load, Posing } from 'limber/posing';
import { openScene } from './engine.js';
import { download } from './dom.js';
import { tell } from './message.js';
import { Panel } from './panel.js';
import { PoseApp } from './pose.js';
import { Original, standing } from './share.js';
import { Sound } from './sound.js';
import { Stage } from './stage.js';
import { bytesOf, fileOf, unzipped } from './unpack.js';

const MOST_STEPS_A_FRAME = 6;
const LONGEST_FRAME = 100;  // ms, after which no other step begins: a heavy scene goes slower, and the page still answers

class App {
  constructor(engine, stage) {
    this.engine = engine;
    this.stage = stage;
    this.settings = structuredClone(engine.scene.settings);
    this.playing = location.hash !== '#paused';
    this.speed = 1;
    this.left = 0;      // s of real time not yet stepped
    this.key = null;    // of the history, where one has scrubbed to it
    this.dragged = null;
    this.mode = null;   // that is played
    this.ray = null;    // that is drawn: {from, along, places}
    this.pointer = null;  // a pointer's last place over the picture, until it was looked at
    stage.load(engine);
    this.sound = new Sound(this);
    stage.placeBodies(engine);
    this.panel = new Panel(document.getElementById('panel'), this);
    this.fit();
    stage.frameAll(engine);
    stage.draw();
  }

  /** What was seen at rest comes to life. */
  start() {
    this.engine.begin();
    this.engine.keep();
    this.listen();
    this.seeAll();
  }

  listen() {
    const canvas = this.stage.renderer.domElement;
    canvas.addEventListener('pointerdown', (event) => this.press(event), { capture: true });
    canvas.addEventListener('pointermove', (event) => this.move(event));
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, () => this.release());
    addEventListener('resize', () => this.fit());
    addEventListener('keydown', (event) => {
      if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement) return;
      if (event.key === ' ') event.preventDefault(), this.setPlaying(!this.playing);
      if (event.key === '.') this.stepOnce();
      if (event.key === 'Home') this.seeAll();
    });
  }

  fit() { this.stage.fit(); }

  /** The camera as at first, following nobody. */
  seeAll() {
    this.stage.followed = null;
    this.stage.frameAll(this.engine);
    this.show();
  }

  press(event) {
    if (event.button !== 0 || !event.isPrimary) return;
    const { from, along } = this.stage.ray(event);
    if (this.tool === 'ray') {
      if (this.engine.rayPlaces(from, along).length === 0) return;
      event.stopImmediatePropagation();
      this.ray = { from, along, places: [] };
      return this.show();
    }
    const hit = this.engine.cast(from, along);
    if (!hit) return;
    event.stopImmediatePropagation();
    if (this.tool === 'follow') return this.stage.follow(hit.body);
    this.resume();
    if (this.tool === 'poke') {
      this.engine.poke(along, this.sound.contactTime);
      this.sound.collect(0);
    }
    if (this.tool === 'pin') this.engine.pin();
    if (this.tool === 'drag' && this.engine.grab()) {
      this.dragged = hit.point;
      event.target.setPointerCapture(event.pointerId);
      event.target.style.cursor = 'grabbing';
    }
    this.show();
  }

  move(event) {
    if (this.dragged) this.engine.dragTo((this.dragged = this.stage.across(event, this.dragged)));
    this.pointer = event.pointerType === 'mouse' && event.buttons === 0 ? event : null;
  }

  /** The cursor tells whether a press would meet a body. */
  hover() {
    if (this.pointer === null) return;
    const { from, along } = this.stage.ray(this.pointer);
    this.stage.renderer.domElement.style.cursor = this.engine.cast(from, along) ? (this.tool === 'drag' ? 'grab' : 'pointer') : '';
    this.pointer = null;
  }

  release() {
    if (this.dragged) this.engine.letGo();
    this.dragged = null;
    this.stage.renderer.domElement.style.cursor = '';
    this.show();
  }

  /** What is done to the world happens now, not in the past that one looked at. */
  resume() {
    this.key = null;
    this.mode = null;
    if (!this.dragged) this.engine.letGo();
  }

  setPlaying(playing) {
    if (playing) this.resume();
    this.playing = playing;
    this.left = 0;
    this.show();
  }

  /** @param delay s, after which one hears it */
  step(delay = 0) {
    const began = performance.now();
    this.engine.step();
    this.sound.collect(delay);
    this.panel.note(this.engine.numbers(), performance.now() - began, this.engine.stages());
  }

  stepOnce() {
    this.setPlaying(false);
    this.resume();
    this.step();
    this.show();
  }

  restart() { this.begin(() => this.engine.restart(this.settings)); }

  /** @param factor on Young's modulus; Infinity: rigid */
  setStiffness(model, factor) { this.begin(() => this.engine.setStiffness(model, factor)); }

  /** The clock begins anew, with other models. */
  begin(act) {
    this.dragged = null;
    this.key = this.mode = null;
    try {
      act();
    } catch (error) {
      return tell(error.message);
    }
    this.stage.load(this.engine);
    this.sound.begin();
    for (const chart of [this.panel.energy, this.panel.time, this.panel.contacts]) chart.clear();
    this.panel.build();
    this.show();
  }

  goTo(key) {
    this.playing = false;
    this.mode = null;
    this.engine.goTo(key);
    this.key = key;
    this.settings.gravity = this.engine.scene.settings.gravity;
    this.stage.syncBodies(this.engine);
    this.show();
  }

  /** A file of what was kept, to the browser's downloads. */
  save() {
    let bytes;
    try {
      bytes = this.engine.recording();
    } catch (error) {
      return tell(error.message);
    }
    download(bytes, 'model/gltf-binary', `${this.engine.scene.name}.glb`);
  }

  /** The page with the scene as it stands, to the browser's downloads. */
  share() {
    try {
      download(this.original.with(standing(this)), 'text/html', `${this.engine.scene.name}.html`);
    } catch (error) {
      tell(error.message);
    }
  }

  /** Goes on from what another page was saved with. */
  goOn({ state, view, playing }) {
    this.engine.restore(state);
    this.settings = structuredClone(this.engine.scene.settings);
    this.stage.load(this.engine);
    this.panel.build();
    this.stage.camera.position.fromArray(view.position);
    this.stage.controls.target.fromArray(view.target);
    this.setPlaying(playing && this.playing);
  }

  unpin() {
    this.resume();
    this.engine.unpin();
    this.show();
  }

  drop(model) {
    this.resume();
    const { x, y, z } = this.stage.controls.target;
    this.engine.drop(model, [x, y, z + 0.5 * this.stage.size]);
    this.stage.syncBodies(this.engine);
    this.show();
  }

  showMode(body, mode, share) {
    this.playing = false;
    this.mode = null;
    this.engine.showMode(body, mode, share);
    this.show();
  }

  playMode(body, mode) {
    this.playing = false;
    this.mode = { body, mode, began: performance.now() };
  }

  /** One frame. @param seconds since the last one */
  frame(seconds) {
    if (this.playing) {
      this.left = Math.min(this.left + this.speed * seconds, MOST_STEPS_A_FRAME * this.engine.scene.settings.step);
      const began = performance.now(), { step } = this.engine.scene.settings;
      for (let delay = 0; this.left >= step && performance.now() - began < LONGEST_FRAME; this.left -= step, delay += step / this.speed)
        this.step(delay);
    }
    // Modes of any frequency are seen to swing once a second.
    if (this.mode) this.engine.showMode(this.mode.body, this.mode.mode, Math.sin((2e-3 * Math.PI) * (performance.now() - this.mode.began)));
    this.hover();
    this.sound.send();
    this.show();
  }

  show() {
    const hand = this.stage.place(this.engine);
    if (this.ray) this.ray.places = this.engine.rayPlaces(this.ray.from, this.ray.along);
    this.stage.drawRay(this.ray?.from, this.ray?.places ?? []);
    this.panel.marks.show();
    this.panel.show(this.engine.numbers(), hand);
    this.stage.draw();
  }
}

/** @param wasm of limber/posing, bytes */
async function openPosing(wasm, files, model, joints) {
  const name = (path) => path.slice(path.lastIndexOf('/') + 1);
  await load(wasm);
  return Posing.open(Object.fromEntries(await Promise.all(files.map(async (file) => [name(file.path), await fileOf(file)]))), name(model), name(joints));
}

async function main() {
  const original = new Original();
  const stage = new Stage(document.getElementById('view'));
  stage.prepare();
  const { scene, joints, files, stands } = JSON.parse(document.getElementById('files').textContent);
  const wasm = await unzipped(bytesOf(document.getElementById('engine').textContent));
  const engine = joints ? await openPosing(wasm, files, scene, joints) : await openScene(wasm, files, scene);
  document.title = `${engine.scene.name} – limber`;
  const app = joints ? new PoseApp(engine, stage) : new App(engine, stage);
  if (!joints) {
    await new Promise((seen) => requestAnimationFrame(() => setTimeout(seen)));
    app.start();
  }
  app.original = original;
  if (stands) app.goOn(stands);
  globalThis.limber = app;
  let last = performance.now();
  const draw = (now) => {
    try {
      app.frame(Math.max(0, now - last) / 1000);
    } catch (error) {
      return tell(error.message);
    }
    last = now;
    requestAnimationFrame(draw);
  };
  requestAnimationFrame(draw);
}

main().catch((error) => tell(error.message)).finally(() => document.getElementById('loading').remove());
