// The page of a model that is posed: points are pulled, and parts turn in their joints and bend.
import * as THREE from 'three';
import { download, element } from './dom.js';
import { PosePanel } from './pose_panel.js';
import { COLOURS } from './surface.js';
import { setLines } from './stage.js';
import { tell } from './message.js';

const NEAR = 14;  // pixels, at which a handle is taken again

export class PoseApp {
  constructor(engine, stage) {
    this.engine = engine;
    this.stage = stage;
    this.dragged = null;
    this.result = null;
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute('position', new THREE.BufferAttribute(engine.positions(), 3));
    this.geometry.setIndex(new THREE.BufferAttribute(engine.triangles, 1));
    const materials = [];
    let first = 0;
    engine.scene.parts.forEach((part, i) => {
      this.geometry.addGroup(3 * first, 3 * part.triangles, i);
      first += part.triangles;
      materials.push(new THREE.MeshStandardMaterial({ color: COLOURS[i % COLOURS.length], roughness: 0.6, side: THREE.DoubleSide, flatShading: true }));
    });
    const mesh = new THREE.Mesh(this.geometry, materials);
    mesh.castShadow = mesh.receiveShadow = true;
    mesh.frustumCulled = false;
    stage.moving.add(mesh);
    this.points = new THREE.Points(new THREE.BufferGeometry(),
      new THREE.PointsMaterial({ color: 0xc4302b, size: 9, sizeAttenuation: false, depthTest: false, transparent: true }));
    this.points.renderOrder = 2;
    this.points.frustumCulled = false;
    stage.scene.add(this.points);
    this.geometry.computeBoundingBox();
    this.panel = new PosePanel(document.getElementById('panel'), this);
    this.listen();
    this.fit();
    stage.look(this.geometry.boundingBox);
    this.changed();
  }

  listen() {
    const canvas = this.stage.renderer.domElement;
    canvas.addEventListener('pointerdown', (event) => this.press(event), { capture: true });
    canvas.addEventListener('pointermove', (event) => this.move(event));
    for (const end of ['pointerup', 'pointercancel']) canvas.addEventListener(end, () => this.release());
    addEventListener('resize', () => this.fit());
    addEventListener('keydown', (event) => {
      if (event.key === 'z' && (event.ctrlKey || event.metaKey) && !(event.target instanceof HTMLInputElement)) this.undo();
    });
  }

  fit() { this.stage.fit(); }

  /** A handle near the pointer is taken again; else the surface under it gets a new one. */
  press(event) {
    if (event.button !== 0 || !event.isPrimary) return;
    const near = this.engine.handles().map(({ point }, i) => ({ i, point, pixels: this.stage.pixelsFrom(event, point) }))
      .sort((a, b) => a.pixels - b.pixels)[0];
    const { from, along } = this.stage.ray(event);
    if (near && near.pixels < NEAR) {
      this.engine.take(near.i);
      this.dragged = near.point;
    } else {
      const hit = this.engine.cast(from, along);
      if (!hit) return;
      this.engine.grab();
      this.dragged = hit.point;
    }
    event.stopImmediatePropagation();
    event.target.setPointerCapture(event.pointerId);
    this.changed();
  }

  move(event) {
    if (!this.dragged) return;
    this.dragged = this.stage.across(event, this.dragged);
    this.engine.dragTo(this.dragged);
    this.unsettled = true;
  }

  release() {
    if (this.dragged) this.engine.letGo();
    this.dragged = null;
  }

  /** What is asked of the engine, told where it cannot be; then the pose is looked for anew. */
  change(act) {
    try {
      act();
      tell('');
    } catch (error) {
      tell(error.message);
    }
    this.panel.build();
    this.changed();
  }
  changed() {
    this.unsettled = true;
    this.frame();
  }
  undo() { this.change(() => this.engine.undo()); }
  reset() { this.change(() => { this.engine.removeHandles(); this.engine.reset(); }); }

  /** The pose as a model to bake, and its joints file. */
  save() {
    download(this.engine.modelText(), 'model/obj', `${this.engine.scene.name}.posed.obj`);
    download(this.engine.jointsText(), 'application/json', `${this.engine.scene.name}.posed.joints.json`);
  }

  /** Some way towards the pose. What cannot be found is told; the pose stays, and the next change is another try. */
  solve() {
    try {
      this.result = this.engine.solve();
      this.unsettled = this.result.status === 'going on';
      if (this.result.status === 'infeasible') tell('joints, limits and pins contradict each other: undo, or loosen one');
    } catch (error) {
      this.unsettled = false;
      tell(error.message);
    }
    this.geometry.attributes.position.array.set(this.engine.positions());
    this.geometry.attributes.position.needsUpdate = true;
  }

  frame() {
    if (this.unsettled) this.solve();
    const handles = this.engine.handles();
    this.points.geometry.dispose();
    this.points.geometry = new THREE.BufferGeometry();
    this.points.geometry.setAttribute('position', new THREE.Float32BufferAttribute(handles.flatMap(({ point }) => point), 3));
    setLines(this.stage.hand, handles.flatMap(({ point, target }) => [...point, ...target]));
    this.stage.drawAxes(this.engine.jointFrames());
    this.panel.show(this.result, handles.length);
    this.stage.draw();
  }
}
