// What is seen: camera, light, bodies, shapes that stand still, outlines of sensors, axes of joints, the hand, a ray.
import * as THREE from 'three';
import { OrbitControls } from 'three/examples/jsm/controls/OrbitControls.js';
import { NARROW } from './dom.js';
import { SurfaceBody, SurfaceModel } from './surface.js';

const UP = new THREE.Vector3(0, 0, 1);
const UNSEEN = 0.25;  // of a pixel

export class Stage {
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.shadowMap.enabled = true;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0xe9ecf1);
    this.camera = new THREE.PerspectiveCamera(40, 1, 0.01, 1000);
    this.camera.up.copy(UP);
    this.controls = new OrbitControls(this.camera, canvas);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a8f99, 1.6));
    this.sun = new THREE.DirectionalLight(0xffffff, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.bias = -0.0015;
    this.scene.add(this.sun, this.sun.target);
    this.still = new THREE.Group();
    this.moving = new THREE.Group();
    this.sensors = new THREE.Group();
    this.scene.add(this.still, this.moving, this.sensors);
    this.joints = this.lines(0x1b1f27);
    this.hand = this.lines(0xc4302b);
    this.rays = this.lines(0x7a3db8);
    this.models = [];
    this.bodies = [];
    this.caster = new THREE.Raycaster();
    this.followed = null;  // {body, position}
    this.size = 1;         // m, of all there is to see
    this.free = 1;         // of the picture's height: the smaller side of what the panel leaves
  }

  lines(color) {
    const made = new THREE.LineSegments(new THREE.BufferGeometry(),
      new THREE.LineBasicMaterial({ color, depthTest: false, transparent: true }));
    made.renderOrder = 1;
    made.frustumCulled = false;
    this.scene.add(made);
    return made;
  }

  /** Has the GPU make its programs ready while the engine is unpacked: what is drawn is smaller than a pixel. */
  prepare() {
    const speck = { points: [0, 0, 0, 0, 0, 0, 0, 0, 0], triangles: [0, 1, 2] }, geometry = surface(speck);
    geometry.computeVertexNormals();
    const specks = [new SurfaceBody({ geometry }, 0).mesh, standing({ ...speck, ground: true })];
    for (const mesh of specks) mesh.frustumCulled = false, this.scene.add(mesh);
    this.draw();
    for (const mesh of specks) this.scene.remove(mesh);
  }

  /** Models and shapes anew; bodies by syncBodies(). */
  load(engine) {
    for (const body of this.bodies) this.moving.remove(body.mesh), body.dispose();
    for (const model of this.models) model.dispose();
    this.bodies = [];
    this.models = engine.scene.models.map((_, i) => new SurfaceModel(engine.model(i)));
    for (const group of [this.still, this.sensors])
      for (const child of [...group.children]) {
        group.remove(child);
        child.geometry.dispose();
        child.material.dispose();
      }
    for (const shape of engine.scene.statics) this.still.add(standing(shape));
    for (const shape of engine.scene.sensors) this.sensors.add(outline(shape));
    this.syncBodies(engine);
  }

  syncBodies(engine) {
    const wanted = engine.scene.bodies;
    while (this.bodies.length > wanted.length) {
      const body = this.bodies.pop();
      this.moving.remove(body.mesh);
      body.dispose();
    }
    for (let i = this.bodies.length; i < wanted.length; ++i) {
      this.bodies.push(new SurfaceBody(this.models[wanted[i].model], i));
      this.moving.add(this.bodies[i].mesh);
    }
  }

  place(engine) {
    this.placeBodies(engine);
    this.drawJoints(engine);
    engine.sensorCounts().forEach((count, i) => this.sensors.children[i].material.color.set(count > 0 ? 0xd9822b : 0x2f7d5b));
    const hand = engine.hand();
    setLines(this.hand, hand.holds ? [...hand.point, ...hand.target] : []);
    return hand;
  }

  placeBodies(engine) {
    const frame = engine.frame();
    let at = 0;
    this.bodies.forEach((body, i) => {
      body.place(frame.subarray(at, at + engine.sizes[i]));
      at += engine.sizes[i];
    });
    this.goAlong();
    this.bend(engine, frame);
  }

  /** Bodies by so few modes that no vertex is seen to be off. */
  bend(engine, frame) {
    let at = 0;
    this.bodies.forEach((body, i) => {
      const tolerance = this.unseen(i);
      body.bend(frame.subarray(at, at + engine.sizes[i]), tolerance, () => engine.bent(i, tolerance, false, body.surface.vertices));
      at += engine.sizes[i];
    });
  }

  /** m, by which a vertex of a body may be off unseen: a part of a pixel where the body is nearest. */
  unseen(body) {
    const { mesh, surface } = this.bodies[body];
    const nearest = Math.max(this.camera.near, this.camera.position.distanceTo(mesh.position) - surface.model.radius);
    return UNSEEN * 2 * nearest * Math.tan(0.5 * THREE.MathUtils.degToRad(this.camera.fov)) / this.renderer.domElement.height;
  }

  follow(body) { this.followed = { body, position: this.bodies[body].mesh.position.clone() }; }

  /** The camera goes where the body that it follows went. */
  goAlong() {
    const mesh = this.bodies[this.followed?.body]?.mesh;
    if (mesh === undefined) return;
    const way = mesh.position.clone().sub(this.followed.position);
    this.camera.position.add(way);
    this.controls.target.add(way);
    this.followed.position.copy(mesh.position);
  }

  /** A ray as far as the last place that it meets, and the normals there. */
  drawRay(from, places) {
    const ends = [], half = 0.06 * this.size;
    if (places.length > 0) ends.push(...from, ...places.at(-1).point);
    for (const { point, normal } of places) ends.push(...point, ...point.map((x, i) => x + half * normal[i]));
    setLines(this.rays, ends);
  }

  drawJoints(engine) {
    this.drawAxes(engine.jointFrames());
  }

  /** @param frames nine numbers each: origin, axis, coordinates */
  drawAxes(frames) {
    const ends = [], half = 0.06 * this.size;
    for (let j = 0; j < frames.length; j += 9) {
      const [x, y, z, ax, ay, az] = frames.subarray(j, j + 6);
      ends.push(x - half * ax, y - half * ay, z - half * az, x + half * ax, y + half * ay, z + half * az);
    }
    setLines(this.joints, ends);
  }

  /** Looks at all bodies as they are. */
  frameAll(engine) {
    const box = new THREE.Box3(), point = new THREE.Vector3();
    for (const { mesh } of this.bodies) box.expandByObject(mesh, true);
    for (const shape of engine.scene.statics)
      if (!shape.ground) for (let k = 0; k < shape.points.length; k += 3) box.expandByPoint(point.fromArray(shape.points, k));
    this.look(box, engine.scene.statics.some((shape) => shape.ground));
  }

  /** At a box, from in front and above. @param onGround which is at z = 0 */
  look(box, onGround = false) {
    if (onGround) box.min.z = Math.min(box.min.z, 0);
    const middle = box.getCenter(new THREE.Vector3());
    this.size = Math.max(box.getSize(new THREE.Vector3()).length(), 1e-3);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).addScaledVector(new THREE.Vector3(0.35, -1, 0.45).normalize(), (1.5 * this.size) / this.free);
    this.camera.near = 0.01 * this.size;
    this.camera.far = 60 * this.size;
    this.sun.position.copy(middle).addScaledVector(new THREE.Vector3(0.4, -0.5, 1).normalize(), 2 * this.size);
    this.sun.target.position.copy(middle);
    Object.assign(this.sun.shadow.camera,
      { left: -this.size, right: this.size, top: this.size, bottom: -this.size, near: 0.1 * this.size, far: 5 * this.size });
    this.sun.shadow.camera.updateProjectionMatrix();
    this.sun.shadow.normalBias = 0.004 * this.size;
    this.controls.update();
  }

  /** @return {from, along} in the world, of a pointer event */
  ray(event) {
    const box = this.renderer.domElement.getBoundingClientRect();
    const at = new THREE.Vector2((2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height);
    this.camera.updateMatrixWorld();
    this.caster.setFromCamera(at, this.camera);
    return { from: this.caster.ray.origin.toArray(), along: this.caster.ray.direction.toArray() };
  }

  /** How far from the pointer a point is seen. */
  pixelsFrom(event, point) {
    const box = this.renderer.domElement.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const seen = new THREE.Vector3(...point).project(this.camera);
    return Math.hypot((0.5 + 0.5 * seen.x) * box.width - (event.clientX - box.left), (0.5 - 0.5 * seen.y) * box.height - (event.clientY - box.top));
  }

  /** Where the pointer is in the plane through a point across the line of sight. */
  across(event, point) {
    const normal = this.camera.getWorldDirection(new THREE.Vector3());
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(normal, new THREE.Vector3(...point));
    this.ray(event);
    return this.caster.ray.intersectPlane(plane, new THREE.Vector3())?.toArray() ?? point;
  }

  /** To the window: the scene is in the middle of what the panel leaves free. */
  fit() {
    const width = innerWidth, height = innerHeight, panel = document.getElementById('panel').getBoundingClientRect();
    const below = matchMedia(NARROW).matches, right = below ? 0 : panel.width, foot = below ? panel.height : 0;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.free = Math.min(1, (width - right) / height, (height - foot) / height);
    this.camera.setViewOffset(width, height, right / 2, foot / 2, width, height);
    this.camera.updateProjectionMatrix();
  }

  draw() {
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }
}

export function setLines(lines, ends) {
  lines.geometry.dispose();
  lines.geometry = new THREE.BufferGeometry();
  lines.geometry.setAttribute('position', new THREE.Float32BufferAttribute(ends, 3));
  lines.visible = ends.length > 0;
}

function surface({ points, triangles }) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.Float32BufferAttribute(points, 3));
  geometry.setIndex(triangles);
  return geometry;
}

/** Edges between faces that are not flush: of a round shape, those of the facets that stand for it. */
function outline(shape) {
  const geometry = surface(shape), edges = new THREE.EdgesGeometry(geometry);
  geometry.dispose();
  return new THREE.LineSegments(edges, new THREE.LineBasicMaterial());
}

function standing({ points, triangles, ground }) {
  const geometry = surface({ points, triangles });
  const flat = geometry.toNonIndexed();
  geometry.dispose();
  flat.computeVertexNormals();
  const side = ground ? THREE.FrontSide : THREE.DoubleSide;  // a camera below the ground looks through it
  const mesh = new THREE.Mesh(flat, new THREE.MeshStandardMaterial({ color: ground ? 0xdfe3ea : 0xa9b1bd, roughness: 0.9, side }));
  mesh.receiveShadow = true;
  mesh.castShadow = !ground;
  return mesh;
}
