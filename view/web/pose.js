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
    this.cutting = false;  // the next stroke cuts
    this.stroke = null;    // that cuts: events of its ends
    this.result = null;
    this.mesh = new THREE.Mesh();
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.mesh.frustumCulled = false;
    stage.moving.add(this.mesh);
    this.makeParts();
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

  /** The drawn surface, part by part: a cut, or its undoing, makes others. */
  makeParts() {
    const { engine } = this, materials = [];
    this.geometry?.dispose();
    this.geometry = new THREE.BufferGeometry();
    this.geometry.setAttribute('position', new THREE.BufferAttribute(engine.positions(), 3));
    this.geometry.setIndex(new THREE.BufferAttribute(engine.triangles, 1));
    let first = 0;
    engine.scene.parts.forEach((part, i) => {
      this.geometry.addGroup(3 * first, 3 * part.triangles, i);
      first += part.triangles;
      materials.push(new THREE.MeshStandardMaterial({ color: COLOURS[i % COLOURS.length], roughness: 0.6, side: THREE.DoubleSide, flatShading: true }));
    });
    if (Array.isArray(this.mesh.material)) for (const material of this.mesh.material) material.dispose();
    Object.assign(this.mesh, { geometry: this.geometry, material: materials });
    this.parts = materials.length;
  }

  listen() {
    const canvas = this.stage.renderer.domElement;
    canvas.addEventListener('pointerdown', (event) => this.press(event), { capture: true });
    canvas.addEventListener('pointermove', (event) => this.move(event));
    canvas.addEventListener('pointerup', () => this.release());
    canvas.addEventListener('pointercancel', () => {
      this.endStroke();
      this.release();
    });
    addEventListener('resize', () => this.fit());
    addEventListener('keydown', (event) => {
      if (event.key === 'z' && (event.ctrlKey || event.metaKey) && !(event.target instanceof HTMLInputElement)) this.undo();
    });
  }

  fit() { this.stage.fit(); }

  /** A handle near the pointer is taken again; else the surface under it gets a new one. */
  press(event) {
    if (event.button !== 0 || !event.isPrimary) return;
    if (this.cutting) {
      event.stopImmediatePropagation();
      event.target.setPointerCapture(event.pointerId);
      this.stroke = [event, event];
      return;
    }
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
    if (this.stroke) this.drawStroke([this.stroke[0], event]);
    if (!this.dragged) return;
    this.dragged = this.stage.across(event, this.dragged);
    this.engine.dragTo(this.dragged);
    this.unsettled = true;
  }

  release() {
    if (this.stroke) this.cut();
    if (this.dragged) this.engine.letGo();
    this.dragged = null;
  }

  setCutting(cutting) {
    this.cutting = cutting;
    this.panel.build();
  }

  drawStroke(stroke) {
    this.stroke = stroke;
    const middle = this.stage.controls.target.toArray();
    setLines(this.stage.rays, stroke.flatMap((event) => this.stage.across(event, middle)));
    this.stage.draw();
  }

  endStroke() {
    this.stroke = null;
    setLines(this.stage.rays, []);
  }

  /** Cuts the part that lies nearest the middle of the stroke. */
  cut() {
    const { stage, engine } = this, [from, to] = this.stroke;
    this.endStroke();
    this.cutting = false;
    const at = (s) => stage.ray({ clientX: from.clientX + s * (to.clientX - from.clientX), clientY: from.clientY + s * (to.clientY - from.clientY) });
    this.change(() => {
      const hit = [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8].some((s) => engine.cast(at(s).from, at(s).along));
      if (!hit) throw new Error('the line meets no part: draw it across one');
      engine.cut(at(0).from, at(0).along, at(1).along);
    });
  }

  /** What is asked of the engine, told where it cannot be; then the pose is looked for anew. */
  change(act) {
    try {
      act();
      tell('');
    } catch (error) {
      tell(error.message);
    }
    if (this.parts !== this.engine.scene.parts.length) this.makeParts();
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
