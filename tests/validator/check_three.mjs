// Loads an asset in three.js, sets modal amplitudes and compares every vertex with limber's own answer:
//   node check_three.mjs ASSET.glb EXPECTED.json
// EXPECTED.json: { "mesh", "origin", "targets": [name…], "amplitudes": [z…], "positions": [[x, y, z]…] }, positions in the
// body frame by rest + Σ z_i shape_i. The asset says how an amplitude becomes a weight: z / mode_scales.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import { Vector3 } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

// Both sides add float32 shapes to float32 positions of size one, three in double precision.
const FLOAT_ROUND_OFF = 1e-6;

const [asset, expectation] = process.argv.slice(2);
const bytes = await readFile(asset);
const expected = JSON.parse(await readFile(expectation, 'utf8'));

const gltf = await new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
gltf.scene.updateMatrixWorld(true);
const mesh = gltf.scene.getObjectByName(expected.mesh);
assert.ok(mesh?.isMesh, `no mesh called ${expected.mesh}`);

const names = Object.entries(mesh.morphTargetDictionary).sort((a, b) => a[1] - b[1]).map(([name]) => name);
assert.deepEqual(names, expected.targets, 'names of the morph targets');
assert.deepEqual(mesh.morphTargetInfluences, expected.targets.map(() => 0), 'weights at rest');
assert.deepEqual(new Vector3().setFromMatrixPosition(mesh.matrixWorld).toArray(), expected.origin, 'origin in the scene');

const { mode_scales: scales } = mesh.userData.gltfExtensions.LIMBER_modal;
mesh.morphTargetInfluences = expected.amplitudes.map((z, i) => z / scales[i]);
assert.ok(mesh.morphTargetInfluences.some((w) => w < 0), 'a negative weight is part of the test');
assert.equal(mesh.geometry.attributes.position.count, expected.positions.length, 'vertices');

let largest = 0;
const shown = new Vector3();
expected.positions.forEach((position, vertex) => {
  mesh.getVertexPosition(vertex, shown);
  largest = Math.max(largest, shown.distanceTo(new Vector3(...position)));
});
console.log(`${asset}: ${names.length} modes, ${expected.positions.length} vertices, largest difference ${largest} m`);
assert.ok(largest < FLOAT_ROUND_OFF, 'deformed vertices');
