// What a person does on a page, by the page's own scripts over the package, in Node: takes and pins, pokes, leads, goes back.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { LimberError } from 'limber';
import { load, Scene } from 'limber/scene';
import { Engine } from './engine.js';
import { History } from './history.js';

const GRAVITY = 9.80665;
const [, , folder] = process.argv, files = { 'markup.json': readFileSync(`${folder}/markup.json`), 'block.glb': readFileSync(`${folder}/block.glb`) };
await load();
function begun() {
  const engine = new Engine(Scene.open(files, 'markup.json'));
  engine.begin();
  engine.keep();
  return engine;
}
const step = (engine, count) => { for (let i = 0; i < count; ++i) engine.step(); };
const height = (engine) => engine.frame()[2], close = (x, y, by) => assert.ok(Math.abs(x - y) <= by, `${x} is not ${y} to ${by}`);
const velocity = (engine, body) => engine.world.bodyState(engine.played.bodies[body]).velocity;

{ // rays
  const engine = begun(), { body, point, distance } = engine.cast([-10, 0.1, 0.9], [2, 0, 0]);
  assert.equal(body, 0);
  close(point[0], -1, 1e-6);
  close(distance, 9, 1e-6);
  assert.equal(engine.cast([-10, 0.1, 5], [1, 0, 0]), null);
}
{ // a hand lifts by what the body weighs, and lets go
  const engine = begun();
  step(engine, 60);
  engine.cast([0, 0, 10], [0, 0, -1]);
  assert.ok(engine.grab());
  engine.dragTo([0, 0, 4]);
  step(engine, 200);
  assert.ok(engine.hand().holds && height(engine) > 2);
  const weight = GRAVITY * engine.surfaces[0].mass, count = 1000;
  let mean = 0;
  for (let i = 0; i < count; ++i) {
    engine.step();
    mean += engine.hand().force[2] / count;
  }
  close(mean, weight, 0.1 * weight);
  engine.letGo();
  assert.ok(!engine.hand().holds);
  step(engine, 300);
  assert.ok(height(engine) < 1.2, 'it has fallen');
}
{ // a poke gives the mass its speed; a pin holds against a gravity that turns, until it goes
  const engine = begun(), { gravity } = engine.scene.settings;
  engine.setLive({ gravity, drag_frequency: 3, poke_speed: 2 });
  engine.cast([0, 10, 0.8], [0, -1, 0]);
  const before = engine.world.linearMomentum(engine.played.bodies[0]).y;
  engine.poke([0, -3, 0], 0);
  close(engine.world.linearMomentum(engine.played.bodies[0]).y - before, -2 * engine.surfaces[0].mass, 1e-9);
  const { body, point } = engine.cast([0, 0, 10], [0, 0, -1]), { at } = engine.hit;
  engine.pin();
  assert.equal(engine.hand().pins, 1);
  engine.setLive({ gravity: [0, 0, 3], drag_frequency: 3, poke_speed: 2 });
  step(engine, 100);
  const there = () => engine.world.pointPosition(engine.played.bodies[body], at).z;
  close(there(), point[2], 1e-3);
  engine.unpin();
  assert.equal(engine.hand().pins, 0);
  step(engine, 100);
  assert.ok(there() > point[2] + 1, 'it rises');
}
{ // a joint goes where it is led, runs, and is led again when one goes back
  const engine = begun(), angle = () => engine.jointFrames()[6];
  engine.leadJoint(0, 0, 0.4);
  step(engine, 200);
  close(angle(), 0.4, 0.05);
  const led = engine.kept() - 1;
  engine.runJoint(0, 0, -1);
  step(engine, 50);
  close(angle(), 0.4 - 50 / 60, 0.1);
  assert.deepEqual(engine.jointWishes()[0][0], { place: NaN, speed: -1 });
  engine.leaveJoint(0, 0);
  assert.deepEqual(engine.jointWishes()[0][0], { place: NaN, speed: NaN });
  engine.goTo(led);
  assert.equal(engine.jointWishes()[0][0].place, 0.4);
  step(engine, 50);
  close(angle(), 0.4, 0.05);
  assert.throws(() => engine.leadJoint(0, 3, 0), LimberError);
}
{ // back and forth to the bit, with a body dropped on the way
  const engine = begun();
  step(engine, 20);
  engine.drop(0, [0.2, 0, 5]);
  step(engine, 20);
  const [there, bodies] = [engine.hash(), engine.scene.bodies.length];
  engine.goTo(10);
  assert.equal(engine.scene.bodies.length, bodies - 1);
  engine.goTo(engine.kept() - 1);
  assert.deepEqual([engine.hash(), engine.scene.bodies.length], [there, bodies]);
}
{ // a long past gets coarser, and does not end
  const engine = begun();
  engine.history = new History(20 * engine.history.bytes);
  engine.keep();
  const hashes = [engine.hash()];
  for (let i = 0; i < 100; ++i) {
    engine.step();
    hashes.push(engine.hash());
  }
  const kept = Array.from({ length: engine.kept() }, (_, key) => engine.keptStep(key));
  assert.ok(kept.length <= 20 && kept.length >= 5, `${kept.length} states`);
  assert.deepEqual([kept[0], kept.at(-1)], [0, 100]);
  for (const [key, at] of kept.entries()) {
    engine.goTo(key);
    assert.equal(engine.hash(), hashes[at]);
  }
}
{ // what becomes stiffer goes on from where it is, as fast
  const engine = begun();
  step(engine, 20);
  const before = { ...velocity(engine, 1) };
  engine.setStiffness(0, 4);
  assert.deepEqual({ ...velocity(engine, 1) }, before);
  assert.equal(engine.steps(), 0);
}
console.log('ok');
