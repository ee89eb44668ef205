// Ten soft bodies to drag. limber moves them on the processor; three.js bends them on the GPU, by morph targets whose weights are all
// that is sent a frame. `npm start` in this folder packs limber, installs it and serves the page.
import { Asset, load, Shape, World } from 'limber';
import * as THREE from 'three';

await load();
const world = World.create();
world.setContacts();
world.addStatic(Shape.createHalfSpace([0, 0, 1], 0));

const renderer = new THREE.WebGLRenderer({ antialias: true });
document.body.append(renderer.domElement);
const scene = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40, 1, 0.05, 100);
scene.background = new THREE.Color(0xdfe6ee);
camera.up.set(0, 0, 1);
camera.position.set(0, -5, 2.6);
camera.lookAt(0, 0, 0.6);
const sun = new THREE.DirectionalLight(0xffffff, 2.5);
sun.position.set(2, -3, 6);
const floor = new THREE.Mesh(new THREE.PlaneGeometry(40, 40), new THREE.MeshStandardMaterial({ color: 0xb8c0c8 }));
scene.add(sun, new THREE.HemisphereLight(0xffffff, 0x8090a0, 1.2), floor);

/** What three.js draws of a model at rest, with a morph target for each mode. */
function geometryOf(model) {
  const { modes, render } = model.getData(), geometry = new THREE.BufferGeometry();
  geometry.setAttribute('position', new THREE.BufferAttribute(render.rest.slice(), 3));
  geometry.setIndex([...render.corner]);
  geometry.computeVertexNormals();
  geometry.morphTargetsRelative = true;
  geometry.morphAttributes.position = Array.from({ length: modes }, (_, mode) => {
    const displacements = new Float32Array(3 * render.vertices);
    model.morphTarget(mode, displacements);
    return new THREE.BufferAttribute(displacements, 3);
  });
  return geometry;
}

const jelly = { youngsModulus: 6e4, poissonRatio: 0.4, density: 1000 };
const assets = [Asset.createSoftBall(0.3, 6, jelly, 12, 0.1), Asset.createSoftBox([0.2, 0.2, 0.35], [4, 4, 6], jelly, 12, 0.1)];
const geometries = assets.map((asset) => geometryOf(asset.model(0)));
const bodies = Array.from({ length: 10 }, (_, i) => {
  const id = world.addBody(assets[i % 2], 0, { pose: { p: [(i % 5 - 2) * 0.75, Math.floor(i / 5) * 0.7 - 0.3, 0.6 + 0.35 * (i % 3)] }, userData: i });
  const material = new THREE.MeshStandardMaterial({ color: new THREE.Color().setHSL(i / 10, 0.6, 0.55), roughness: 0.5 });
  const mesh = new THREE.Mesh(geometries[i % 2], material);
  mesh.frustumCulled = false;  // it bends out of its bounds at rest
  scene.add(mesh);
  return { id, mesh, weights: new Float32Array(mesh.morphTargetInfluences.length) };
});
const ids = bodies.map(({ id }) => id), poses = new Float64Array(7 * ids.length);

// Drag: a handle at the place that a ray meets goes with the pointer, in the plane across the view there.
const pointer = new THREE.Vector2(), rays = new THREE.Raycaster(), plane = new THREE.Plane(), target = new THREE.Vector3();
let handle = null;
function aim(event) {
  pointer.set(2 * event.clientX / innerWidth - 1, 1 - 2 * event.clientY / innerHeight);
  rays.setFromCamera(pointer, camera);
  return rays.ray;
}
addEventListener('pointerdown', (event) => {
  const { origin, direction } = aim(event), hit = world.castRay(origin, direction.clone().multiplyScalar(50));
  if (!hit?.hasPoint) return;
  target.copy(hit.position);
  plane.setFromNormalAndCoplanarPoint(camera.getWorldDirection(new THREE.Vector3()), target);
  handle = world.addHandle(hit.body, hit.at, { stiffness: 3000, damping: 150 });
});
addEventListener('pointermove', (event) => { if (handle) aim(event).intersectPlane(plane, target); });
addEventListener('pointerup', () => {
  if (handle) world.removeHandle(handle);
  handle = null;
});

function resize() {
  renderer.setPixelRatio(devicePixelRatio);
  renderer.setSize(innerWidth, innerHeight);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
}
addEventListener('resize', resize);
resize();

let before = performance.now();
renderer.setAnimationLoop((now) => {
  if (handle) world.setHandleTarget(handle, target, [0, 0, 0]);
  world.advance(Math.max(now - before, 0) / 1000);
  before = now;
  const between = world.interpolationFactor();
  world.interpolatedPoses(ids, between, poses);
  bodies.forEach(({ id, mesh, weights }, i) => {
    const [w, x, y, z, ...p] = poses.subarray(7 * i, 7 * i + 7);
    mesh.quaternion.set(x, y, z, w);
    mesh.position.set(...p);
    world.interpolatedWeights(id, between, weights);
    mesh.morphTargetInfluences.splice(0, weights.length, ...weights);
  });
  renderer.render(scene, camera);
});
globalThis.example = { world, ids };
