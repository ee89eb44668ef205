// Hello: ground, a box and a soft ball that fall, a step, a ray: examples/00_hello.cpp in C#.
//   run:   mcs Hello.cs ../../csharp/Limber.cs ../../csharp/Native.cs && LD_LIBRARY_PATH=… mono Hello.exe
//   see:   the heights of a wooden crate and of a ball of jelly, ten times a second, to the last digit those of 00_hello
//   next:  docs/unity.md
using System;
using System.Globalization;
using Limber;

static class Hello {
  static int Main() {
    CultureInfo.CurrentCulture = CultureInfo.InvariantCulture;
    using (var world = new World())  // 1/60 s a step; gravity is -z; bodies meet
    using (var ground = Shape.HalfSpace())
    using (var crate = Shape.Box(0.5, 0.5, 0.5))  // half extents, m
    using (var wobbly = Asset.SoftBall(0.3)) {    // radius; six cells across, twelve modes
      world.AddStatic(ground);
      var askew = World.At(0, 0, 3);
      askew.pose.q = Native.limber_quat_from_rotation_vector(World.Vector(0.3, 0.2, 0));
      var box = world.AddRigid(crate, 700.0, askew);  // kg/m³
      var ball = world.AddBody(wobbly, World.At(3, 0, 1));

      for (int step = 0; step <= 180; ++step) {
        if (step % 6 == 0)
          Console.WriteLine("{0:F1} s: crate at {1:F3} m, ball at {2:F3} m", world.Time, world.StateOf(box).pose.p.z,
                            world.StateOf(ball).pose.p.z);
        world.Step();
      }
      var above = world.StateOf(ball).pose.p;
      above.z += 1.0;
      Hit hit;
      if (world.CastRay(above, World.Vector(0, 0, -2), out hit))
        Console.WriteLine("a ray from above meets the {0} at {1:F3} m", hit.body.index == ball.index ? "ball" : "ground",
                          hit.position.z);
    }
    return 0;
  }
}
