// The package in Node, as a user has it: installed from its tarball.
import assert from 'node:assert/strict';
import * as limber from 'limber';

const { Asset, Axes, Memory, Shape, Snapshot, Surface, World } = limber;
const error = (pattern) => (thrown) => thrown instanceof limber.LimberError && pattern.test(thrown.message);
const jelly = { youngsModulus: 1e5, poissonRatio: 0.4, density: 1000 };

assert.throws(() => World.create(), error(/await load\(\)/));
await limber.load();

// Defaults of C and given members come together.
assert.equal(limber.defaultWorldOptions().step, 1 / 60);
const world = World.create({ gravity: { z: -5 }, hitSpeed: 3 });
assert.deepEqual(world.getOptions().gravity, { x: 0, y: 0, z: -5 });
assert.equal(world.getOptions().hitSpeed, 3);
assert.equal(limber.version(), '0.1.0');
assert.equal(limber.materialPreset('jelly').poissonRatio > 0, true);

// A sphere falls as Galileo's: 30 steps of the midpoint rule are exact.
const id = world.addRigid(Shape.createSphere(0.2), 1000, { pose: { p: [0, 0, 10] }, userData: 2n ** 63n + 1n });
world.step(30);
const { pose } = world.bodyState(id);
assert.ok(Math.abs(pose.p.z - (10 - 5 * 0.5 ** 2 / 2)) < 1e-9, `${pose.p.z}`);
assert.equal(world.bodyUserData(id), 2n ** 63n + 1n);
assert.equal(world.castRay([0, 0, 20], [0, 0, -1]), null);
const hit = world.castRay({ x: 0, y: 0, z: 20 }, [0, 0, -20]);
assert.deepEqual(hit.body, id);
assert.ok(Math.abs(hit.distance - (20 - pose.p.z - 0.2)) < 1e-9);
assert.deepEqual(world.listBodies(), [id]);

// What the library fills is there without a copy, after memory has grown too; arrays of the script's get the same.
const soft = Asset.createSoftBall(0.3, 6, jelly, 12, 0.02), ball = world.addBody(soft, 0, { pose: { p: [3, 0, 0] } });
const { render } = soft.model(0).getData(), corner = render.rest[0], positions = new Memory(Float32Array, 3 * render.vertices);
const copy = new Float32Array(positions.length), normals = new Float32Array(positions.length), before = positions.array.buffer;
world.reconstruct(ball, positions, normals, 1);
new Memory(Float32Array, 2e7).dispose();
assert.notEqual(positions.array.buffer, before, 'memory has grown');
world.reconstruct(ball, copy, null, 1);
assert.deepEqual(positions.array, copy);
assert.equal(copy[0], Math.fround(corner + 3));  // at rest: nothing has moved yet
assert.ok(Math.abs(Math.hypot(...normals.subarray(0, 3)) - 1) < 1e-5);
const poses = new Float64Array(14);
world.interpolatedPoses([id, ball], 1, poses);
assert.deepEqual([...poses.subarray(4, 7)], Object.values(pose.p));

// An asset of one body is a machine without joints.
const machine = world.addMachine(soft, { pose: { p: [0, 9, 4] }, angularVelocity: { z: 2 } });
assert.equal(machine.bodies.length, 1);
assert.deepEqual(machine.joints, []);
assert.equal(world.bodyState(machine.bodies[0]).pose.p.z, 4);
assert.throws(() => soft.getJoint(0), error(/joint 0 of an asset of 0/));

// Snapshots.
const kept = Snapshot.create(), hash = world.stateHash();
world.saveState(kept);
world.applyImpulse(ball, { surface: Surface.COLLISION, triangle: 5, weight: [1, 0, 0] }, [5, 0, 0], Axes.WORLD, 0);
world.step(3);
assert.notEqual(world.stateHash(), hash);
world.restoreState(kept.bytes());
assert.equal(world.stateHash(), hash);

// Errors: the library's line, and what C could not see.
assert.throws(() => world.step(-1), error(/step/));
assert.throws(() => world.step(0.5), error(/whole number/));
assert.throws(() => world.addRigid(Shape.createSphere(1), 1000, { position: [0, 0, 0] }), error(/has no position, expected one of: pose/));
assert.throws(() => world.setGravity([0, 1]), error(/2 items, expected 3/));
assert.throws(() => world.reconstruct(ball, new Float32Array(3), null, 1), error(/3 numbers, expected/));
assert.throws(() => Asset.readMemory(new Uint8Array(12), 'nothing.glb'), error(/nothing\.glb/));
assert.throws(() => new World(), error(/static method/));
soft.dispose();
soft.dispose();
assert.throws(() => soft.bodyCount(), error(/disposed/));
world.step(1);  // keeps what it needs
world.dispose();
console.log('ok');
