// What a user writes in TypeScript, and what the types refuse. tsc checks it with the package's own declarations.
import { Asset, load, Memory, Shape, World } from 'limber';
import { Scene, load as loadScenes } from 'limber/scene';
import { Posing, load as loadPosing, type PoseResult } from 'limber/posing';

await load();
const world: World = World.create();
world.setContacts();
world.addStatic(Shape.createHalfSpace([0, 0, 1], 0));
const ball = world.addRigid(Shape.createSphere(0.3), 1000, { pose: { p: [0, 0, 2] } });
world.step(120);
const height: number = world.bodyState(ball).pose.p.z;
const asset: Asset = Asset.createSoftBall(0.3, 6, { youngsModulus: 6e4, poissonRatio: 0.4, density: 1000 }, 12, 0.1);
const displacements = new Float32Array(3 * asset.model(0).getData().render.vertices);
asset.model(0).morphTarget(0, displacements);
const room = new Memory(Float64Array, 7);
console.log(height, room.array.length);

// @ts-expect-error a shape is no text
world.addStatic('ground');
// @ts-expect-error no member of a body's placement is called so
world.addBody(asset, 0, { position: [0, 0, 1] });

await loadPosing();
const posing = await Posing.open({ 'm.obj': '', 'm.json': new Uint8Array() }, 'm.obj', 'm.json');
if (posing.cast([0, 0, 1], [0, 0, -1])) posing.grab();
posing.dragTo([0, 1, 0]);
posing.setName(0, 'base');
posing.cut([0, 0, 1], [0, 1, -1], [1, 0, -1]);
const found: PoseResult = posing.solve();
if (found.status === 'converged') console.log(posing.modelText(), posing.scene.parts[0]?.name);
// @ts-expect-error handles are numbers
posing.take('first');

await loadScenes();
const scene = Scene.open({ 's.json': '{}' }, 's.json'), played: World = scene.begin({ modes: 3, stiffness: [null, 0.5] });
scene.step();
played.applyImpulse(scene.addBody(0, [0, 0, 1], 'more'), { triangle: 0 }, [0, 0, 1], 0, 0);
const drawn: Float32Array | undefined = scene.bent(0, 1e-4)?.positions;
console.log(drawn?.length, scene.sums().asleep, scene.joints[0]?.index);
// @ts-expect-error settings have names
scene.begin({ speed: 3 });
