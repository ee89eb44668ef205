// The controls at the side.
import { button, choice, element, section, Sheets, slider } from './dom.js';
import { Chart } from './charts.js';
import { JointControls } from './joints.js';
import { Marks } from './marks.js';

const TOOLS = [['drag', 'Drag'], ['poke', 'Poke'], ['pin', 'Pin'], ['ray', 'Ray'], ['follow', 'Follow']];
const KEYS = [['Space', 'pause, play'], ['.', 'one step'], ['Home', 'see all'], ['Ctrl', 'with a drag beside the bodies: move the view']];
const MANY = 6;  // models: more fill the panel
const SOLVERS = [['game', 'game'], ['exact', 'exact']];

const STIFFNESS = [['null', 'rigid'], ['10', '× 10'], ['1', 'as baked'], ['0.1', '÷ 10'], ['0.01', '÷ 100'], ['0.001', '÷ 1,000']];  // of Young's modulus

const count = (number, one, many) => `${number} ${number === 1 ? one : many}`;

export class Panel {
  constructor(host, app) {
    this.app = app;
    this.energy = new Chart('Energy', 'J', [['motion', '#3d7ab8'], ['modes', '#d9822b'], ['all', '#1d2430']]);
    this.time = new Chart('A step takes', 'ms', [['all', '#1d2430'], ['contacts looked for', '#3d7ab8'], ['contacts and joints solved', '#d9822b'], ['the rest', '#5f9e4f']]);
    this.means = [0, 0, 0, 0];  // ms: a step, and its parts
    this.contacts = new Chart('Contacts', '', [['', '#b0508c']]);
    this.state = element('small');
    this.joints = new JointControls(app);
    this.marks = new Marks(app);
    this.sheets = new Sheets(host, ['Controls', 'Details'], () => app.fit());
    if (app.sound.possible) host.querySelector('nav').append(app.sound.button());
    this.build();
  }

  build() {
    const { app } = this, { scene } = app.engine;
    this.scrub = slider('Time', { min: 0, max: 0, step: 1, value: 0, show: () => '' }, (key) => app.goTo(key));
    this.tools = TOOLS.map(([name, text]) => button(text, () => this.choose(name)));
    this.sheets.fill([
      element('h1', { textContent: scene.name }),
      this.clock(),
      section('Hand', true, element('div', { className: 'row' }, ...this.tools, button('Let pins go', () => app.unpin())),
        this.live('drag_frequency', 'Hand', { min: 0.5, max: 12, step: 0.1, show: (x) => `${x.toFixed(1)} Hz` }),
        this.live('poke_speed', 'Poke', { min: 0.05, max: 5, step: 0.05, show: (x) => `${x.toFixed(2)} m/s` }),
        this.drops()),
      ...(app.sound.possible ? [section('Sound', true, ...app.sound.controls())] : [])], [
      section('World', true, ...this.world()),
      section('Modes', scene.joints.length === 0 && !scene.contact, ...this.modes()),
      section('Stiffness', scene.joints.length > 0 && scene.models.length <= MANY, ...this.stiffness()),
      section('Joints', scene.joints.length > 0, ...this.joints.build()),
      section('Show', true, this.marks.build()),
      section('Charts', true, this.energy.element, this.time.element, this.contacts.element, this.state),
      section('Keys', false, element('table', {}, ...KEYS.map(([key, does]) =>
        element('tr', {}, element('td', { textContent: key }), element('td', { textContent: does }))))),
      section('About', false, element('small', { textContent: document.getElementById('licences').textContent }))]);
    this.choose('drag');
  }

  clock() {
    const { app } = this;
    this.play = button('Pause', () => app.setPlaying(!app.playing));
    return element('div', {}, element('div', { className: 'row' }, this.play, button('Step', () => app.stepOnce()),
      button('Start again', () => app.restart()), button('See all', () => app.seeAll()), button('Save GLB', () => app.save()),
      button('Share', () => app.share(), { title: 'Saves this page with the scene as it stands' })),
      slider('Speed', { min: 0.02, max: 1, step: 0.02, value: app.speed, show: (x) => `× ${x.toFixed(2)}` }, (x) => { app.speed = x; }),
      this.scrub);
  }

  live(name, text, options) {
    const { app } = this;
    return slider(text, { ...options, value: app.settings[name] }, (x) => {
      app.settings[name] = x;
      app.engine.setLive(app.settings);
    });
  }

  anew(name, text, options) {
    const { app } = this;
    return slider(text, { ...options, value: Math.min(app.settings[name], options.max) }, (x) => { app.settings[name] = x; });
  }

  world() {
    const { app } = this, most = Math.max(0, ...app.engine.scene.models.map((m) => m.frequencies.length));
    if (this.mostModes === undefined) this.mostModes = most;
    const gravity = slider('Gravity', { min: -20, max: 20, step: 0.1, value: -app.settings.gravity[2], show: (x) => `${x.toFixed(1)} m/s²` }, (x) => {
      app.settings.gravity = [app.settings.gravity[0], app.settings.gravity[1], -x];
      app.engine.setLive(app.settings);
    });
    const rates = [[1 / 30, '1/30 s'], [1 / 60, '1/60 s'], [1 / 120, '1/120 s'], [1 / 240, '1/240 s'], [1 / 1000, '1/1000 s']];
    if (!rates.some(([h]) => Math.abs(h - app.settings.step) < 1e-9)) rates.unshift([app.settings.step, `${app.settings.step} s`]);
    const nearest = rates.find(([h]) => Math.abs(h - app.settings.step) < 1e-9)[0];
    return [gravity,
      element('small', { textContent: 'From the next start:' }),
      choice('Step', rates.map(([h, text]) => [String(h), text]), String(nearest), (h) => { app.settings.step = Number(h); }),
      this.anew('modes', 'Modes', { min: 0, max: this.mostModes, step: 1, show: (x) => `${x}` }),
      this.anew('damping', 'Damping', { min: 0, max: 5, step: 0.05, show: (x) => `× ${x.toFixed(2)}` }),
      this.anew('friction', 'Friction', { min: 0, max: 1.5, step: 0.05, show: (x) => x.toFixed(2) }),
      ...(app.engine.scene.joints.length > 0 ? [this.anew('joint_friction', 'In joints', { min: 0, max: 2, step: 0.05, show: (x) => `× ${x.toFixed(2)}` })] : []),
      choice('Contact', SOLVERS, app.settings.solver, (solver) => { app.settings.solver = solver; }),
      element('div', { className: 'row' }, button('Start again', () => app.restart()))];
  }

  drops() {
    const { app } = this;
    return section('Drop', app.engine.scene.models.length <= MANY, element('div', { className: 'row' }, ...app.engine.scene.models.map((model, i) =>
      button(model.name, () => app.drop(i)))));
  }

  /** By model: at once, from where bodies stand. */
  stiffness() {
    const { app } = this, { models, settings } = app.engine.scene;
    return models.flatMap(({ name, frequencies }, i) => {
      const now = settings.stiffness[i];
      return frequencies.length === 0 && now !== null ? [] : [choice(name, STIFFNESS, String(now), (factor) =>
        app.setStiffness(i, factor === 'null' ? Infinity : Number(factor)))];
    });
  }

  modes() {
    const { app } = this;
    return app.engine.scene.bodies.slice(0, 8).filter(({ model }) => app.engine.scene.models[model].frequencies.length > 0)
      .map((body, number) => {
        const { frequencies } = app.engine.scene.models[body.model];
        const rows = () => frequencies.map((hz, mode) => {
          const moved = slider(`${hz.toPrecision(4)} Hz`, { min: -1, max: 1, step: 0.01, value: 0, show: (x) => x.toFixed(2) },
            (x) => app.showMode(number, mode, x));
          return element('div', { className: 'mode' }, moved, button('Play', () => app.playMode(number, mode)));
        });
        const list = section(body.name, false);
        list.addEventListener('toggle', () => { if (list.open && list.children.length === 1) list.append(...rows()); });
        return list;
      });
  }

  choose(tool) {
    this.app.tool = tool;
    this.app.ray = null;
    TOOLS.forEach(([name], i) => this.tools[i].setAttribute('aria-pressed', String(name === tool)));
  }

  /** After steps, and when something was set. */
  show(numbers, hand) {
    const { app } = this, range = this.scrub.querySelector('input');
    this.play.textContent = app.playing ? 'Pause' : 'Play';
    range.max = app.engine.kept() - 1;
    range.value = app.key ?? range.max;
    this.scrub.querySelector('output').textContent = `${numbers.time.toFixed(2)} s`;
    for (const chart of [this.energy, this.time, this.contacts]) chart.draw();
    const force = Math.hypot(...hand.force);
    this.state.textContent = (hand.holds ? `hand pulls ${force.toPrecision(3)} N; ` : '') +
      `${count(app.engine.scene.bodies.length, 'body', 'bodies')}, ${numbers.asleep} asleep, ${count(hand.pins, 'pin', 'pins')}, state ${app.engine.hash()}` +
      (numbers.solved ? '' : '; some islands ended at a limit');
    this.joints.show();
    this.showRay();
  }

  showRay() {
    const { ray, engine } = this.app;
    if (ray === null) return;
    const name = (body) => (body < 0 ? 'what stands still' : engine.scene.bodies[body].name);
    this.state.textContent += `; the ray meets ${ray.places.map(({ body, point }) =>
      `${name(body)} at ${Math.hypot(...point.map((x, i) => x - ray.from[i])).toPrecision(4)} m`).join(', ') || 'nothing'}`;
  }

  /** @param stages seconds: the browser's clock is coarse, so that only means over many steps tell something */
  note(numbers, milliseconds, stages) {
    const [, ahead, broad, narrow, rows, , solve, commit] = stages;
    const looked = 1000 * (ahead + broad + narrow), solved = 1000 * (rows + solve + commit);
    [milliseconds, looked, solved, milliseconds - looked - solved].forEach((x, i) => { this.means[i] += (x - this.means[i]) / 30; });
    this.energy.add([numbers.rigid, numbers.modal + numbers.elastic, numbers.rigid + numbers.modal + numbers.elastic + numbers.potential]);
    this.time.add([...this.means]);
    this.contacts.add([numbers.contacts]);
  }
}
