// The controls of a model that is posed: its parts, its joints.
import { button, choice, element, section, Sheets } from './dom.js';

const TYPES = ['ball', 'revolute', 'cylindrical', 'prismatic', 'planar', 'fixed'];
/** Members of `limits` (docs/formats/joints.md) that a person may set, with what they are called here. */
const MEMBERS = {
  ball: [['cone', 'cone']], revolute: [['rotation', 'turn']], cylindrical: [['rotation', 'turn'], ['translation', 'slide']],
  prismatic: [['translation', 'slide']], planar: [['rotation', 'turn'], ['translation', 'slides']], fixed: [],
};

export class PosePanel {
  constructor(host, app) {
    this.app = app;
    this.state = element('small');
    this.lists = [];  // of joints
    this.sheets = new Sheets(host, ['Pose', 'Parts and joints'], () => app.fit());
    this.build();
  }

  build() {
    const { app } = this, { scene } = app.engine;
    this.coordinates = [];
    const opened = this.lists.map((list) => list.open);  // an event of it may still be on its way
    this.lists = scene.joints.map((joint, j) => this.joint(joint, j, opened[j] ?? false));
    this.sheets.fill([
      element('h1', { textContent: scene.name }),
      element('div', { className: 'row' }, button('Undo', () => app.undo()), button('Back to rest', () => app.reset()),
        button('Let all go', () => app.change(() => app.engine.removeHandles())),
        button('Cut', () => app.setCutting(!app.cutting), { 'aria-pressed': String(app.cutting), title: 'The next line that you draw across a part cuts it in two, with a joint between' }),
        button('Save', () => app.save())),
      element('small', { textContent: 'Pull at any point: it stays where it is let go. Pull at a red point to move it again.' }),
      this.state], [
      section('Parts', true, ...scene.parts.map((part, i) => this.part(part, i))),
      section('Joints', true, ...this.lists),
      section('About', false, element('small', { textContent: document.getElementById('licences').textContent }))]);
  }

  part(part, i) {
    const { app } = this;
    const box = (text, checked, act) => element('label', { className: 'box' }, element('input', { type: 'checkbox', checked,
      onchange: (event) => app.change(() => act(event.target.checked)) }), text);
    return element('div', { className: 'part' }, element('input', { type: 'text', value: part.name, title: 'Its name',
      onchange: (event) => app.change(() => app.engine.setName(i, event.target.value.trim())) }),
      box('soft', part.soft, (on) => app.engine.setSoft(i, on)), box('pinned', part.pinned, (on) => app.engine.setPinned(i, on)));
  }

  joint(joint, j, open) {
    const { app } = this, coordinates = element('small');
    this.coordinates.push(coordinates);
    const set = (told) => app.change(() => app.engine.setJoint(j, told));
    return section(`${joint.a} – ${joint.b}`, open, choice('Type', TYPES.map((type) => [type, type]), joint.type, (type) => set({ type, limits: null })),
      ...MEMBERS[joint.type].flatMap(([member, text]) => this.limits(joint, member, text, set)), coordinates);
  }

  /** Fields for the ends of a member; an empty one is open. Angles in degrees. */
  limits(joint, member, text, set) {
    const limits = joint.limits ?? {}, angle = member !== 'translation', unit = angle ? 180 / Math.PI : 1;
    const pairs = joint.type === 'planar' && member === 'translation';
    const value = limits[member] ?? (member === 'cone' ? null : pairs ? [[null, null], [null, null]] : [null, null]);
    const rows = member === 'cone' ? [[value]] : pairs ? value : [value];
    const fields = rows.map((row) => row.map((x) => element('input', { type: 'number', step: 'any', placeholder: 'open',
      value: x === null ? '' : String(Number((unit * x).toPrecision(6))), onchange: () => {
        const read = fields.map((ends) => ends.map(({ value: typed }) => (typed === '' ? null : Number(typed) / unit)));
        set({ type: joint.type, limits: { ...limits, [member]: member === 'cone' ? read[0][0] : pairs ? read : read[0] } });
      } })));
    return fields.map((ends) => element('label', { className: 'ends' }, `${text}${angle ? ' °' : ''}`, ...ends));
  }

  show(result, handles) {
    const { app } = this, frames = app.engine.jointFrames();
    this.coordinates.forEach((line, j) => {
      const { type } = app.engine.scene.joints[j], turns = type !== 'prismatic' && type !== 'fixed';
      const count = { ball: 1, revolute: 1, cylindrical: 2, prismatic: 1, planar: 3, fixed: 0 }[type];
      line.textContent = [...frames.slice(9 * j + 6, 9 * j + 6 + count)]
        .map((x, i) => (turns && i === 0 ? `${((180 / Math.PI) * x).toFixed(1)}°` : x.toPrecision(3))).join(', ');
    });
    this.state.textContent = result && `Held: ${handles}, off by ${result.handleError.toPrecision(2)} at most; ${result.status}, ` +
      `joints to ${result.jointError.toExponential(0)}`;
  }
}
