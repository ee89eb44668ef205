// What a step of ten soft bodies costs by the npm package over C++: CPU time, the least of many rounds, both sides by turns.
//   node benchmarks/npm_times.mjs PACKAGE STEP_TIMES    the folder build/release/view/engine/npm/package and the program step_times
import { execFileSync } from 'node:child_process';
import path from 'node:path';

if (process.argv.length !== 4) throw new Error('give the folder of the package and the program step_times');
const [folder, program] = process.argv.slice(2).map((given) => path.resolve(given));
const { Asset, load, Shape, World } = await import(path.join(folder, 'node.js'));
await load();

function addBodies(world, height) {
  const jelly = { youngsModulus: 6e4, poissonRatio: 0.4, density: 1000 };
  const assets = [Asset.createSoftBall(0.3, 6, jelly, 12, 0.1), Asset.createSoftBox([0.2, 0.2, 0.35], [4, 4, 6], jelly, 12, 0.1)];
  for (let i = 0; i < 10; ++i)
    world.addBody(assets[i % 2], 0, { pose: { p: [(i % 5 - 2) * 0.75, Math.floor(i / 5) * 0.7 - 0.3, height + 0.35 * (i % 3)] } });
  return world;
}

/** us a step: `step` calls for 20 */
function least(world) {
  world.step(600);
  for (let round = 0; round < 300; ++round) world.step(20);  // until V8 has compiled it
  let best = Infinity;
  for (let round = 0; round < 60; ++round) {
    const before = process.cpuUsage();
    world.step(20);
    const { user, system } = process.cpuUsage(before);
    best = Math.min(best, (user + system) / 20);
  }
  return best;
}

const flight = addBodies(World.create(), 0), contact = World.create();
contact.setContacts();
contact.addStatic(Shape.createHalfSpace([0, 0, 1], 0));
addBodies(contact, 0.6);
const worlds = { flight, contact }, cpp = {}, wasm = {};
for (let turn = 0; turn < 5; ++turn) {
  for (const line of execFileSync(program, { encoding: 'utf8' }).trim().split('\n')) {
    const [name, us] = line.split(' ');
    cpp[name] = Math.min(Number(us), cpp[name] ?? Infinity);
  }
  for (const name in worlds) wasm[name] = Math.min(least(worlds[name]), wasm[name] ?? Infinity);
}
console.log('| scene | C++, us a step | WebAssembly | ratio |\n|---|---|---|---|');
for (const name in worlds)
  console.log(`| ${name} | ${cpp[name].toFixed(1)} | ${wasm[name].toFixed(1)} | ${(wasm[name] / cpp[name]).toFixed(2)} |`);
