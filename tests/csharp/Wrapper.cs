// What the C# wrapper does beside the C interface: exceptions, lifetimes, arrays, layouts. Exit code 1 and a line for what does not hold.
using System;
using System.Runtime.InteropServices;
using Limber;

static class Wrapper {
  static bool holds = true;
  static void Expect(bool claim, string what) {
    if (claim) return;
    holds = false;
    Console.Error.WriteLine("does not hold: " + what);
  }
  static void Near(double seen, double expected, double tolerance, string what) {
    Expect(Math.Abs(seen - expected) <= tolerance, what + ": " + seen + ", expected " + expected);
  }

  static void ErrorsAreExceptionsWithTheLibrarysLine() {
    try {
      Shape.Sphere(-1.0);
      Expect(false, "a negative radius is refused");
    } catch (LimberException e) {
      Expect(e.Result == Result.LIMBER_INVALID_ARGUMENT && e.Message.Contains("radius"), "its line names the radius: " + e.Message);
    }
    try {
      Asset.Read("/there/is/kein Bär.glb");
      Expect(false, "a file that is not there is refused");
    } catch (LimberException e) {
      Expect(e.Result == Result.LIMBER_INPUT_ERROR && e.Message.Contains("kein Bär.glb"), "paths are UTF-8: " + e.Message);
    }
    var gone = new World();
    gone.Dispose();
    try {
      gone.Step();
      Expect(false, "a world that was disposed of is refused");
    } catch (ObjectDisposedException) {
    }
  }

  /// Free fall, a hit at the speed of the fall, a ray that finds the ball, and the same again from a saved state.
  static void ABallFalls() {
    var options = Native.limber_default_world_options();
    options.hit_speed = 2.0;
    using (var world = new World(options))
    using (var ground = Shape.HalfSpace())
    using (var sphere = Shape.Sphere(0.5)) {
      world.AddStatic(ground);
      var start = World.At(0, 0, 2);
      start.user_data = ulong.MaxValue;
      start.restitution = 0.5;
      var ball = world.AddRigid(sphere, 1000.0, start);
      world.Step(30);
      Near(world.StateOf(ball).pose.p.z, 2 - 0.5 * 9.80665 * 0.25, 1e-9, "free fall");
      Hit hit;
      Expect(world.CastRay(World.Vector(0, 0, 5), World.Vector(0, 0, -9), out hit), "a ray meets it");
      Expect(hit.body.index == ball.index && hit.user_data == ulong.MaxValue && hit.has_point, "it is the ball");
      Near(hit.position.z, world.StateOf(ball).pose.p.z + 0.5, 1e-9, "its top");
      var state = world.Save();
      var hits = new HitEvent[4];
      double speed = 0;
      for (int i = 0; i < 30; ++i) {
        world.Step();
        if (world.HitEvents(hits) > 0) speed = hits[0].speed;
      }
      Near(speed, Math.Sqrt(2 * 9.80665 * 1.5), 2 * 9.80665 / 60, "the speed of the hit");
      var hash = world.StateHash;
      world.Restore(state);
      world.Step(30);
      Expect(world.StateHash == hash, "a restored world goes on to the bit");
      Near(world.Time, 1.0, 1e-12, "its time");
    }
  }

  /// Vertices into an array and into native memory are the same, and those at rest are the asset's moved by the pose.
  static void SurfacesAreWrittenIntoMemory() {
    using (var world = new World())
    using (var soft = Asset.SoftBall(0.3, 4, 6)) {
      var model = soft.Data();
      Expect(model.modes == 6 && model.render.vertices > 0, "the asset tells its numbers");
      var id = world.AddBody(soft, World.At(1, 2, 3));
      int count = 3 * model.render.vertices;
      float[] positions = new float[count], rest = new float[count], again = new float[count];
      world.Reconstruct(id, positions);
      Marshal.Copy(model.render.rest, rest, 0, count);
      double worst = 0;
      for (int i = 0; i < count; ++i) worst = Math.Max(worst, Math.Abs(positions[i] - rest[i] - (1 + i % 3)));
      Near(worst, 0, 1e-6, "vertices at rest");
      IntPtr memory = Marshal.AllocHGlobal(4 * count);
      world.Reconstruct(id, memory, IntPtr.Zero);
      Marshal.Copy(memory, again, 0, count);
      Marshal.FreeHGlobal(memory);
      for (int i = 0; i < count; ++i) Expect(positions[i] == again[i], "native memory has the same");
    }
  }

  /// An asset of one body is a machine without joints.
  static void AMachineIsPlaced() {
    using (var world = new World())
    using (var soft = Asset.SoftBall(0.3, 4, 6)) {
      var start = Native.limber_default_machine_placement();
      start.pose.p = World.Vector(1, 2, 3);
      start.angular_velocity = World.Vector(0, 0, 4);
      BodyId[] bodies;
      JointId[] joints;
      world.AddMachine(soft, out bodies, out joints, start);
      Expect(bodies.Length == 1 && joints.Length == 0 && world.Contains(bodies[0]), "it is a body of the world");
      var state = world.StateOf(bodies[0]);
      Near(state.pose.p.z, 3, 0, "where it is put");
      Near(state.angular_velocity.z, 4, 0, "how it turns");
    }
  }

  /// Each struct is as large as C's: the library would write beyond a smaller one.
  static void AnswersFillTheirStructs() {
    Near(Marshal.SizeOf(typeof(Placement)), Size("limber_placement"), 0, "Placement");
    Near(Marshal.SizeOf(typeof(WorldOptions)), Size("limber_world_options"), 0, "WorldOptions");
    Near(Marshal.SizeOf(typeof(JointOptions)), Size("limber_joint_options"), 0, "JointOptions");
    Near(Marshal.SizeOf(typeof(Hit)), Size("limber_hit"), 0, "Hit");
    Near(Marshal.SizeOf(typeof(HitEvent)), Size("limber_hit_event"), 0, "HitEvent");
    Near(Marshal.SizeOf(typeof(ModelData)), Size("limber_model_data"), 0, "ModelData");
    Near(Marshal.SizeOf(typeof(AssetJoint)), Size("limber_asset_joint"), 0, "AssetJoint");
    Near(Marshal.SizeOf(typeof(MachinePlacement)), Size("limber_machine_placement"), 0, "MachinePlacement");
    Near(Marshal.SizeOf(typeof(StageTimes)), Size("limber_stage_times"), 0, "StageTimes");
  }
  /// From the command line, as C printed them.
  static double Size(string name) {
    foreach (var word in sizes)
      if (word.StartsWith(name + "=")) return double.Parse(word.Substring(name.Length + 1));
    return -1;
  }
  static string[] sizes;

  static int Main(string[] arguments) {
    sizes = arguments;
    ErrorsAreExceptionsWithTheLibrarysLine();
    ABallFalls();
    SurfacesAreWrittenIntoMemory();
    AMachineIsPlaced();
    AnswersFillTheirStructs();
    return holds ? 0 : 1;
  }
}
