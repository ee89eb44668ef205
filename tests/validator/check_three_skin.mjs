// Plays a recording of a body with a modal skin in three.js and compares every vertex at every key with limber's own:
//   node check_three_skin.mjs RECORDING.glb EXPECTED.json
// EXPECTED.json: { "mesh", "size", "keys": [{ "time", "positions": [[x, y, z]…] }…] }, positions in world axes, z up.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { AnimationMixer, Vector3 } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

const ASKED = 1e-4; // of the size

const [recording, expectation] = process.argv.slice(2);
const bytes = await readFile(recording);
const expected = JSON.parse(await readFile(expectation, 'utf8'));

const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
const mesh = gltf.scene.getObjectByProperty('isSkinnedMesh', true);
assert.ok(mesh, 'a skinned mesh');
assert.ok(mesh.morphTargetInfluences.length > 0, 'morph targets');
assert.equal(gltf.animations.length, 1, 'one animation');
const mixer = new AnimationMixer(gltf.scene);
mixer.clipAction(gltf.animations[0]).play();

let largest = 0;
let moved = 0;
const shown = new Vector3();
const upright = ([x, y, z]) => new Vector3(x, z, -y); // glTF has y up
for (const { time, positions } of expected.keys) {
  // The last key itself would be the first of the next round.
  mixer.setTime(Math.min(time, gltf.animations[0].duration * (1 - 1e-9)));
  gltf.scene.updateMatrixWorld(true);
  assert.equal(mesh.geometry.attributes.position.count, positions.length, 'vertices');
  positions.forEach((position, vertex) => {
    mesh.getVertexPosition(vertex, shown).applyMatrix4(mesh.matrixWorld);
    const place = upright(position);
    largest = Math.max(largest, shown.distanceTo(place));
    moved = Math.max(moved, place.distanceTo(upright(expected.keys[0].positions[vertex])));
  });
}
console.log(`${recording}: ${expected.keys.length} keys, vertices move by ${moved} m, largest difference ${largest} m`);
assert.ok(moved > 0.1 * expected.size, 'the body moves');
assert.ok(largest < ASKED * expected.size, 'vertices as the engine has them');
