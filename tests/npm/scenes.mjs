// The scenes of ../c/scenes.c by the package, in Node and in a browser.
export function scenes({ Asset, Axes, ContactSolver, JointType, quatFromRotationVector, Shape, Surface, World }) {
  function makeWorld(solver, findContacts) {
    const world = World.create();
    world.setContacts({ solver, findContacts });
    return world;
  }
  const addCrate = (world, p, turn) =>
    world.addRigid(Shape.createBox([0.25, 0.25, 0.25]), 700, { pose: { q: quatFromRotationVector(turn), p } });
  function addJelly(world, p, angularVelocity) {
    const bar = Asset.createSoftBox([0.1, 0.1, 0.3], [3, 3, 6], { youngsModulus: 1e5, poissonRatio: 0.4, density: 1000 }, 8, 0.02);
    return world.addBody(bar, 0, { pose: { p }, angularVelocity });
  }
  function end(world, steps) {
    world.step(steps);
    return world.stateHash().toString(16).padStart(16, '0');
  }
  function flight() {
    const world = makeWorld(ContactSolver.GAME, false), bar = addJelly(world, [0, 0, 2], [1, 2, 3]);
    world.applyImpulse(bar, { surface: Surface.COLLISION, triangle: 5, weight: [1, 0, 0] }, [0.5, 0.1, 2], Axes.BODY, 0.004);
    return end(world, 600);
  }
  function joints() {
    const world = makeWorld(ContactSolver.EXACT, false);
    const a = addCrate(world, [0, 0, 2], [0, 0, 0]), b = addJelly(world, [0, 0, 1.4], [0, 0, 0]);
    world.addJoint([0, 0], a, { type: JointType.BALL, frame: { p: [0.25, 0, 2] } });
    const hinge = world.addJoint(a, b, { type: JointType.REVOLUTE, frame: { p: [0, 0, 1.7] }, rotation: [-0.5, 0.8] });
    world.setJointActuation(hinge, 0, { motorVelocity: 2, motorMaxForce: 5, friction: 0.1 });
    return end(world, 120);
  }
  function contact(solver, crates, steps) {
    const world = makeWorld(solver, true);
    world.addStatic(Shape.createHalfSpace([0, 0, 1], 0));
    for (let i = 0; i < crates; ++i) addCrate(world, [0.02 * i, 0, 0.3 + 0.6 * i], [0.1, 0, 0.2 * i]);
    addJelly(world, [0.1, 0, 0.6 + 0.6 * crates], [0.5, 0, 0]);
    return end(world, steps);
  }
  return { flight: flight(), joints: joints(), contact_exact: contact(ContactSolver.EXACT, 2, 60), contact_game: contact(ContactSolver.GAME, 6, 240) };
}
