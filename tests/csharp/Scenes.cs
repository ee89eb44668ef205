// The scenes of tests/c/scenes.c in C#: what they print is the same. Then what the wrapper does by itself.
using System;
using Limber;

static class Scenes {
  static Vec3 V(double x, double y, double z) { return World.Vector(x, y, z); }

  static World MakeWorld(ContactSolver solver, bool contacts) {
    var options = Native.limber_default_contact_options();
    options.solver = solver;
    options.find_contacts = contacts;
    return new World(null, options);
  }

  static BodyId AddCrate(World world, Vec3 at, Vec3 turn) {
    var start = World.At(at.x, at.y, at.z);
    start.pose.q = Native.limber_quat_from_rotation_vector(turn);
    using (var box = Shape.Box(0.25, 0.25, 0.25)) return world.AddRigid(box, 700.0, start);
  }

  static BodyId AddJelly(World world, Vec3 at, Vec3 spin) {
    var start = World.At(at.x, at.y, at.z);
    start.angular_velocity = spin;
    using (var bar = Asset.SoftBox(V(0.1, 0.1, 0.3), new[] { 3, 3, 6 }, 8)) return world.AddBody(bar, start);
  }

  static void End(string name, World world, int steps) {
    world.Step(steps);
    Console.WriteLine("{0} {1:x16}", name, world.StateHash);
    world.Dispose();
  }

  static void Flight() {
    var world = MakeWorld(ContactSolver.LIMBER_CONTACT_GAME, false);
    var bar = AddJelly(world, V(0, 0, 2), V(1, 2, 3));
    var corner = new SurfacePoint { surface = Surface.LIMBER_SURFACE_COLLISION, triangle = 5 };
    corner.weight[0] = 1;
    world.ApplyImpulse(bar, corner, V(0.5, 0.1, 2), Axes.LIMBER_AXES_BODY, 0.004);
    End("flight", world, 600);
  }

  static void Joints() {
    var world = MakeWorld(ContactSolver.LIMBER_CONTACT_EXACT, false);
    var a = AddCrate(world, V(0, 0, 2), V(0, 0, 0));
    var b = AddJelly(world, V(0, 0, 1.4), V(0, 0, 0));
    var options = Native.limber_default_joint_options();
    options.type = JointType.LIMBER_JOINT_BALL;
    options.frame.p = V(0.25, 0, 2);
    world.AddJoint(new BodyId(), a, options);
    options.type = JointType.LIMBER_JOINT_REVOLUTE;
    options.frame.p = V(0, 0, 1.7);
    options.rotation = new Interval { low = -0.5, high = 0.8 };
    var hinge = world.AddJoint(a, b, options);
    world.Actuate(hinge, 0, new Actuation { motor_velocity = 2.0, motor_max_force = 5.0, friction = 0.1 });
    End("joints", world, 120);
  }

  static void Contact(string name, ContactSolver solver, int crates, int steps) {
    var world = MakeWorld(solver, true);
    using (var ground = Shape.HalfSpace()) world.AddStatic(ground);
    for (int i = 0; i < crates; ++i) AddCrate(world, V(0.02 * i, 0, 0.3 + 0.6 * i), V(0.1, 0, 0.2 * i));
    AddJelly(world, V(0.1, 0, 0.6 + 0.6 * crates), V(0.5, 0, 0));
    End(name, world, steps);
  }

  static int Main() {
    Flight();
    Joints();
    Contact("contact_exact", ContactSolver.LIMBER_CONTACT_EXACT, 2, 60);
    Contact("contact_game", ContactSolver.LIMBER_CONTACT_GAME, 6, 240);
    return 0;
  }
}
