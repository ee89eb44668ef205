// The joints of a scene: a slider for each coordinate, which leads it to a place, a motor, and a stop.
import { button, element, section, slider } from './dom.js';

/** Which coordinates of a joint are angles, and what they are called. */
const COORDINATES = {
  revolute: [[true, 'turn']], prismatic: [[false, 'slide']], cylindrical: [[true, 'turn'], [false, 'slide']],
  planar: [[false, 'along'], [false, 'across'], [true, 'turn']], ball: [[true, 'about x'], [true, 'about y'], [true, 'about z']], fixed: [],
};
const MANY = 8;  // joints: more are folded
const DEGREE = Math.PI / 180;
const RUN = [90 * DEGREE, 0.1];  // rad/s, m/s: of a motor

const told = (angle, x) => (angle ? `${(x / DEGREE).toFixed(1)}°` : `${(1000 * x).toFixed(1)} mm`);

/** Names without the machine's, where there is one alone. */
function shortNames(bodies) {
  const [machine] = bodies[0].name.split('/', 1), alone = bodies.every(({ name }) => name.startsWith(`${machine}/`));
  return (name) => (alone ? name.slice(machine.length + 1) : name);
}

export class JointControls {
  constructor(app) {
    this.app = app;
    this.rows = [];  // {joint, coordinate, angle, slider, run}
  }

  /** @return the elements, made anew */
  build() {
    const { joints, bodies } = this.app.engine.scene, name = shortNames(bodies);
    this.rows = [];
    return joints.map((joint, j) => {
      const title = `${joint.a ? name(joint.a) : 'world'} – ${name(joint.b)}, ${joint.type}`;
      if (COORDINATES[joint.type].length === 0) return element('small', { className: 'fixed', textContent: title });
      return section(title, joints.length <= MANY, ...COORDINATES[joint.type].map((kind, c) => this.coordinate(joint, j, c, kind)));
    });
  }

  coordinate(joint, j, c, [angle, name]) {
    const { app } = this, [low, high] = joint.limits[c], reach = angle ? Math.PI : app.stage.size;
    const ends = [low ?? -reach, high ?? reach];
    const row = { j, c, angle, direction: 1 };
    row.slider = slider(name, { min: ends[0], max: ends[1], step: (ends[1] - ends[0]) / 1000, value: 0, show: (x) => told(angle, x) }, (x) => {
      app.resume();
      app.engine.leadJoint(j, c, x);
      app.show();
    });
    row.run = button('Run', () => {
      app.resume();
      app.engine.runJoint(j, c, row.direction * RUN[angle ? 0 : 1]);
      row.direction = -row.direction;  // the next time the other way
      app.show();
    });
    const stop = button('Stop', () => {
      app.resume();
      app.engine.leaveJoint(j, c);
      app.show();
    });
    const stops = element('small', { textContent: low === null && high === null ? 'no stops' :
      `stops at ${[low, high].map((x) => (x === null ? '∞' : told(angle, x))).join(' and ')}` });
    this.rows.push(row);
    return element('div', {}, row.slider, element('div', { className: 'row' }, row.run, stop, stops));
  }

  /** A slider shows where its joint is, or where a person leads it. */
  show() {
    const frames = this.app.engine.jointFrames(), wishes = this.app.engine.jointWishes();
    for (const { j, c, angle, slider: shown, run } of this.rows) {
      const place = frames[9 * j + 6 + c], wish = wishes[j][c];
      shown.set(Number.isNaN(wish.place) ? place : wish.place);
      shown.querySelector('output').textContent = told(angle, place);
      run.setAttribute('aria-pressed', String(!Number.isNaN(wish.speed)));
    }
  }
}
