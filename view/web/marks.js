// What may be drawn beside the bodies: contacts with their forces, the surfaces that touch, axes of joints.
import * as THREE from 'three';
import { element } from './dom.js';
import { setLines } from './stage.js';
import { bending, SurfaceModel } from './surface.js';

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
    this.wires = new THREE.Group();
    stage.scene.add(this.points, this.wires);
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
    this.wires.clear();
    for (const model of this.models.values()) model.dispose();
    this.models.clear();
  }

  show() {
    const { stage, engine } = this.app;
    stage.joints.visible &&= this.shown.joints;
    this.showContacts(this.shown.contacts ? engine.contacts() : [], stage.size, Math.max(0, ...engine.scene.models.map(({ mass }) => mass)));
    if (this.shown.touching) this.wire(stage, engine);
    this.wires.visible = this.shown.touching;
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
    while (this.wires.children.length > bodies.length) this.wires.remove(this.wires.children.at(-1));
    for (let i = this.wires.children.length; i < bodies.length; ++i) this.wires.add(this.made(stage, engine, i));
    this.wires.children.forEach((mesh, i) => {
      mesh.position.copy(stage.bodies[i].mesh.position);
      mesh.quaternion.copy(stage.bodies[i].mesh.quaternion);
    });
  }

  made(stage, engine, i) {
    const { shape, model } = engine.scene.bodies[i];
    const material = new THREE.MeshBasicMaterial({ color: 0x1d2430, wireframe: true, transparent: true, opacity: 0.45, depthTest: false });
    const mesh = shape ? new THREE.Mesh(rigid(shape), material) : this.bent(stage, engine, i, model, material);
    mesh.renderOrder = 1;
    mesh.frustumCulled = false;
    return mesh;
  }

  bent(stage, engine, i, number, material) {
    if (!this.models.has(number)) {
      const told = engine.touching(number);
      if (told) this.models.set(number, new SurfaceModel(told));
    }
    const model = this.models.get(number) ?? stage.models[number];
    return new THREE.Mesh(model.geometry, bending(material, model, stage.bodies[i].amplitudes));
  }
}

function rigid({ points, triangles }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
  geometry.setIndex(triangles);
  return geometry;
}
