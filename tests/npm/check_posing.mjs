// The entry limber/posing in Node, as a user has it.
import assert from 'node:assert/strict';
import * as posing from 'limber/posing';
import { open, pull } from './pull.mjs';

const error = (pattern) => (thrown) => thrown instanceof posing.LimberError && pattern.test(thrown.message);
await assert.rejects(open(posing.Posing), error(/await load\(\)/));
const { part, found, turn, handles: [handle], positions } = await pull(posing);
assert.equal(part, 1);
assert.ok(['converged', 'local minimum'].includes(found.status), found.status);
assert.ok(found.jointError < 1e-9 && turn < -0.3 && turn > -1, `${found.jointError}, ${turn}`);
assert.deepEqual(handle.target, [1.9, 0.1, 0.7]);
assert.ok(Math.hypot(...handle.point.map((x, i) => x - handle.target[i])) < 0.2, `${handle.point}`);
assert.deepEqual(positions.slice(0, 6), [0, 0, 0, 1, 0, 0], 'the base is pinned');

// Two at once know nothing of each other; what is changed can be taken back, and goes out as files.
const [one, other] = [await open(posing.Posing), await open(posing.Posing)];
one.setPinned(1, true);
assert.deepEqual([one, other].map(({ scene }) => scene.parts[1].pinned), [true, false]);
assert.equal(one.undo(), true);
assert.equal(one.scene.parts[1].pinned, false);
other.setName(1, 'boom');
assert.equal(JSON.parse(other.jointsText()).components[1].name, 'boom');
assert.throws(() => other.setName(1, other.scene.parts[0].name), error(/another/));
assert.match(other.modelText(), /^v /m);
assert.equal(JSON.parse(other.jointsText()).joints[0].type, 'revolute');
assert.throws(() => one.setJoint(0, { type: 'hinge' }), error(/hinge/));
await assert.rejects(posing.Posing.open({}, 'none.obj', 'none.json'), error(/none\.obj/));
console.log('ok');
