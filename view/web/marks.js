// What may be drawn beside the bodies: contacts with their forces, the surfaces that touch, axes of joints.
import * as THREE from 'three';
import { element } from './dom.js';
import { setLines } from './stage.js';
import { BendingMesh, SurfaceModel } from './surface.js';

const WEIGHT = 0.12;   // of the scene's size, for a force of the heaviest body's weight
const LONGEST = 0.6;   // of the scene's size
const COLOUR = 0xb0508c;

export class Marks {
  constructor(app) {
    this.app = app;
    this.shown = { contacts: false, touching: false, joints: true };
    const { stage } = app;
    this.forces = stage.lines(COLOUR);
    this.points = new THREE.Points(new THREE.BufferGeometry(),
      new THREE.PointsMaterial({ color: COLOUR, size: 6, sizeAttenuation: false, depthTest: false, transparent: true }));
    this.points.renderOrder = 2;
    this.points.frustumCulled = false;
    this.group = new THREE.Group();
    this.wires = [];  // by body, as far as they were asked for: {surface, touching, bends}
    stage.scene.add(this.points, this.group);
    this.models = new Map();  // what touches, by model, as far as it was asked for
  }

  /** Boxes to tick. */
  build() {
    const box = (name, text) => element('label', { className: 'box' }, element('input', { type: 'checkbox', checked: this.shown[name],
      onchange: (event) => { this.shown[name] = event.target.checked; this.app.show(); } }), text);
    this.forget();
    return element('div', { className: 'row' }, box('contacts', 'Contacts'), box('touching', 'What touches'), box('joints', 'Axes'));
  }

  /** Models are others. */
  forget() {
    this.group.clear();
    for (const { surface } of this.wires.splice(0)) surface.dispose();
    for (const model of this.models.values()) model?.dispose();
    this.models.clear();
  }

  show() {
    const { stage, engine } = this.app;
    stage.joints.visible &&= this.shown.joints;
    this.showContacts(this.shown.contacts ? engine.contacts() : [], stage.size, Math.max(0, ...engine.scene.models.map(({ mass }) => mass)));
    if (this.shown.touching) this.wire(stage, engine);
    this.group.visible = this.shown.touching;
  }

  showContacts(contacts, size, mass) {
    const ends = [], points = [], scale = WEIGHT * size / (9.80665 * mass);
    for (let i = 0; i < contacts.length; i += 6) {
      const point = [...contacts.slice(i, i + 3)], force = [...contacts.slice(i + 3, i + 6)], newtons = Math.hypot(...force);
      const length = Math.min(scale, LONGEST * size / Math.max(newtons, 1e-30));
      points.push(...point);
      ends.push(...point, ...point.map((x, k) => x + length * force[k]));
    }
    setLines(this.forces, ends);
    this.points.geometry.dispose();
    this.points.geometry = new THREE.BufferGeometry();
    this.points.geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
    this.points.visible = points.length > 0;
  }

  /** One wire per body, as many as there are bodies now. */
  wire(stage, engine) {
    const { bodies } = engine.scene;
    for (const wire of this.wires.splice(bodies.length)) this.group.remove(wire.surface.mesh), wire.surface.dispose();
    for (let i = this.wires.length; i < bodies.length; ++i) {
      this.wires.push(this.made(stage, engine, bodies[i]));
      this.group.add(this.wires[i].surface.mesh);
    }
    this.wires.forEach(({ surface, touching, bends }, i) => {
      surface.mesh.position.copy(stage.bodies[i].mesh.position);
      surface.mesh.quaternion.copy(stage.bodies[i].mesh.quaternion);
      if (bends) surface.set(engine.bent(i, stage.unseen(i), touching, surface.vertices));
    });
  }

  made(stage, engine, { shape, model }) {
    const material = new THREE.MeshBasicMaterial({ color: 0x1d2430, wireframe: true, transparent: true, opacity: 0.45, depthTest: false });
    const own = shape ? new SurfaceModel(rigid(shape)) : this.model(engine, model);
    const surface = new BendingMesh(own ?? stage.models[model], material);
    surface.mesh.renderOrder = 1;
    return { surface, touching: own !== null, bends: !shape };
  }

  /** The surface by which a model touches; null: the drawn one. */
  model(engine, number) {
    if (!this.models.has(number)) {
      const told = engine.touching(number);
      this.models.set(number, told && new SurfaceModel(told));
    }
    return this.models.get(number);
  }
}

/** A shape's surface as models have theirs. */
function rigid({ points, triangles }) {
  return { rest: Float32Array.from(points), triangles: Uint32Array.from(triangles) };
}
