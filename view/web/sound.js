// What one hears: blows of the scene, sent once a frame to the thread that plays (sound_worklet.js). A page from disk shares
// no memory between threads, so they go by the node's message port.
import { button, element, slider } from './dom.js';
import { bytesOf, unzipped } from './unpack.js';
import { tell } from './message.js';

const HEAD = 0.09;     // m, from the middle to an ear
const HEADROOM = 0.5;  // of full scale, for the loudest poke as it would be heard from where one looks at first
const BLOW = 15;        // numbers of a blow, Scene's takeBlows()

/** Where a person's ears are who looks through the camera. */
function ears({ camera }) {
  camera.updateMatrixWorld();
  const right = camera.matrixWorld.elements;
  return [-HEAD, HEAD].map((aside) => camera.position.toArray().map((x, i) => x + aside * right[i]));
}

export class Sound {
  constructor(app) {
    this.app = app;
    this.on = false;
    this.context = null;  // browsers let it sound once a person has pressed something
    this.decibels = -6;
    this.contactTime = 5e-4;
    this.waiting = [];    // numbers of blows of this frame
    this.numbers = [];    // per body of the scene {model, number}, as the synthesizer has it
    this.count = this.kindCount = 0;  // of the synthesizer's bodies, and of its models
  }

  /** Whether there is something to hear. */
  get possible() { return this.app.engine.scene.models.some(({ sound }) => sound.modes > 0); }

  /** For the panel's bar. */
  button() {
    this.switch = button('Sound', () => this.toggle(), { 'aria-pressed': String(this.on) });
    return this.switch;
  }

  controls() {
    this.told = element('small');
    return [slider('Volume', { min: -40, max: 20, step: 1, value: this.decibels, show: (x) => `${x} dB` }, (x) => {
      this.decibels = x;
      this.setVolume();
    }), slider('Mallet', { min: -4.7, max: -2.3, step: 0.1, value: Math.log10(this.contactTime), show: (x) => `${(10 ** (x + 3)).toPrecision(2)} ms` },
      (x) => { this.contactTime = 10 ** x; }), this.told];
  }

  async toggle() {
    this.on = !this.on;
    this.switch.setAttribute('aria-pressed', String(this.on));
    this.app.engine.listen(this.on);
    try {
      if (this.context === null) await this.open(new AudioContext({ latencyHint: 'interactive' }));
      if (this.on) await this.context.resume();
      else await this.context.suspend();
    } catch (error) {
      tell(`no sound: ${error.message}`);
    }
  }

  /** @param context of Web Audio, one that is not in real time too */
  async open(context) {
    this.context = context;
    if (!context.audioWorklet) throw new Error('the browser plays it in pages from disk or by https only');
    const text = document.getElementById('sound-worklet').textContent;
    await context.audioWorklet.addModule(`data:text/javascript,${encodeURIComponent(text)}`);
    const wasm = await unzipped(bytesOf(document.getElementById('sound-engine').textContent));
    this.node = new AudioWorkletNode(context, 'limber-sound',
      { numberOfInputs: 0, outputChannelCount: [2], processorOptions: { wasm } });
    this.node.onprocessorerror = () => tell('the sound ended by an error');
    this.volume = new GainNode(context);
    this.node.connect(this.volume).connect(context.destination);
    this.sendKinds();
    this.scale = HEADROOM * this.app.stage.camera.position.distanceTo(this.app.stage.controls.target) / this.loudest();
    this.setVolume();
  }

  /** Pascals at one metre that no poke exceeds. */
  loudest() {
    const { engine, settings } = this.app;
    return settings.poke_speed * Math.max(...engine.scene.models.map(({ sound }, i) => (sound.modes > 0 ? engine.loudness(i, this.contactTime) : 0)));
  }

  setVolume() {
    if (this.volume) this.volume.gain.setTargetAtTime(this.scale * 10 ** (this.decibels / 20), this.context.currentTime, 0.02);
  }

  sendKinds() {
    const { engine } = this.app;
    this.kinds = engine.scene.models.map((_, i) => engine.sound(i));
    for (const kind of this.kinds) {
      if (kind === null) continue;
      const { modes, vertices, eigenvalues, decays, gains, shapes } = kind, numbers = new Float64Array(3 * modes);
      [eigenvalues, decays, gains].forEach((part, i) => numbers.set(part, i * modes));
      this.node.port.postMessage({ kind: { modes, vertices, numbers, shapes } }, [numbers.buffer, shapes.buffer]);
      kind.number = this.kindCount++;
      kind.shapes = null;
    }
  }

  /** Models are others. */
  begin() {
    if (!this.node) return;
    this.numbers = [];
    this.sendKinds();
  }

  /** The number of a body in the synthesizer, which gets it where it has none. */
  number(body) {
    const { model } = this.app.engine.scene.bodies[body];
    if (this.numbers[body]?.model !== model) {
      this.numbers[body] = { model, number: this.count++ };
      this.node.port.postMessage({ body: this.kinds[model].number });
    }
    return this.numbers[body].number;
  }

  /** Takes the blows of a step, or of a poke. @param delay s, from now to its start */
  collect(delay) {
    if (!this.on || !this.node) return;
    const blows = this.app.engine.takeBlows(), [left, right] = ears(this.app.stage);
    for (let at = 0; at < blows.length; at += BLOW) {
      const place = blows.slice(at + 12, at + 15), number = this.number(blows[at]);
      this.waiting.push(number, ...blows.slice(at + 1, at + 11), delay + blows[at + 11] / this.app.speed,
        ...[left, right].map((ear) => 1 / Math.max(Math.hypot(...ear.map((x, i) => x - place[i])), HEAD)));
    }
  }

  /** Once a frame: one message, if something was struck. */
  send() {
    if (this.waiting.length > 0) {
      const blows = Float64Array.from(this.waiting);
      this.waiting = [];
      this.node.port.postMessage({ blows }, [blows.buffer]);
    }
    if (this.told && this.node && this.context.outputLatency !== undefined)
      this.told.textContent = this.on ? `heard ${Math.round(1000 * (this.context.baseLatency + this.context.outputLatency))} ms after the frame` : '';
  }
}
