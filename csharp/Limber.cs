// limber for C#: soft and stiff bodies that fall, touch and hang on joints, over liblimber.so (limber.dll) by P/Invoke.
//
//   using (var world = new World())                                      // 1/60 s a step; gravity is -z; bodies meet
//   using (var ground = Shape.HalfSpace())
//   using (var ball = Asset.SoftBall(0.3)) {
//     world.AddStatic(ground);
//     var id = world.AddBody(ball, World.At(0, 0, 2));
//     world.Step(120);
//     Console.WriteLine(world.StateOf(id).pose.p.z);
//   }
//
// Units are m, kg, s, N, rad. What options and members mean, the C headers tell (c/include/limber/c): types have their names
// without the prefix. All functions of the C interface are in Native; World has those that a game needs, and World.Pointer is
// for the rest. Not one call needs unsafe code. A world is used by one thread at a time.
using System;
using System.Runtime.InteropServices;

namespace Limber {

/// What limber throws; its text is the library's line.
public sealed class LimberException : Exception {
  public readonly Result Result;
  internal LimberException(Result result, string line) : base(line) { Result = result; }

  /// Throws what a call that failed tells.
  public static void Check(Result result) {
    if (result != Result.LIMBER_OK) throw new LimberException(result, Text(Native.limber_last_error()));
  }

  internal static string Text(IntPtr utf8) {
    int length = 0;
    while (Marshal.ReadByte(utf8, length) != 0) ++length;
    var bytes = new byte[length];
    Marshal.Copy(utf8, bytes, 0, length);
    return System.Text.Encoding.UTF8.GetString(bytes);
  }
}

/// An object of the library: destroyed by Dispose(), or with the last reference to it.
public abstract class NativeObject : IDisposable {
  IntPtr pointer;
  protected NativeObject(IntPtr made) { pointer = made; }
  ~NativeObject() { Release(); }
  public void Dispose() {
    Release();
    GC.SuppressFinalize(this);
  }
  public IntPtr Pointer {
    get {
      if (pointer == IntPtr.Zero) throw new ObjectDisposedException(GetType().Name);
      return pointer;
    }
  }
  protected abstract void Destroy(IntPtr pointer);
  void Release() {
    if (pointer != IntPtr.Zero) Destroy(pointer);
    pointer = IntPtr.Zero;
  }
}

/// A rigid shape. Does not change; worlds hold what they need of it.
public sealed class Shape : NativeObject {
  Shape(IntPtr made) : base(made) {}
  protected override void Destroy(IntPtr pointer) { Native.limber_shape_destroy(pointer); }
  static Shape Made(Result result, IntPtr made) {
    LimberException.Check(result);
    return new Shape(made);
  }

  /// All points with z at most `offset`.
  public static Shape HalfSpace(double offset = 0.0) {
    IntPtr made;
    return Made(Native.limber_shape_create_half_space(new Vec3 { z = 1.0 }, offset, out made), made);
  }
  public static Shape Sphere(double radius) {
    IntPtr made;
    return Made(Native.limber_shape_create_sphere(radius, out made), made);
  }
  /// Within `radius` of a segment on z from -halfLength to halfLength.
  public static Shape Capsule(double radius, double halfLength) {
    IntPtr made;
    return Made(Native.limber_shape_create_capsule(radius, halfLength, out made), made);
  }
  /// By half extents.
  public static Shape Box(double x, double y, double z) {
    IntPtr made;
    return Made(Native.limber_shape_create_box(World.Vector(x, y, z), out made), made);
  }
  /// The convex hull of points, three numbers each.
  public static Shape Hull(double[] points) {
    IntPtr made;
    return Made(Native.limber_shape_create_hull(points, (UIntPtr)(points.Length / 3), out made), made);
  }
  /// A surface that does not deform: corners counter-clockwise, seen from outside.
  public static Shape Mesh(double[] vertices, int[] corners) {
    IntPtr made;
    return Made(Native.limber_shape_create_mesh(vertices, (UIntPtr)(vertices.Length / 3), corners, (UIntPtr)(corners.Length / 3),
                                                out made), made);
  }
}

/// Bodies that were baked together, or a soft one made on the spot.
public sealed class Asset : NativeObject {
  Asset(IntPtr made) : base(made) {}
  protected override void Destroy(IntPtr pointer) { Native.limber_asset_destroy(pointer); }
  static Asset Made(Result result, IntPtr made) {
    LimberException.Check(result);
    return new Asset(made);
  }

  /// A GLB that limber-precompute wrote.
  public static Asset Read(string path) {
    IntPtr made;
    return Made(Native.limber_asset_read_file(path, out made), made);
  }
  /// The same from memory. `name` is shown in messages.
  public static Asset Read(byte[] bytes, string name) {
    IntPtr made;
    return Made(Native.limber_asset_read_memory(bytes, (UIntPtr)bytes.Length, name, out made), made);
  }
  /// Of jelly, unless told otherwise. `cells`: across.
  public static Asset SoftBall(double radius, int cells = 6, int modes = 12, Material? material = null) {
    IntPtr made;
    var of = material ?? Jelly;
    return Made(Native.limber_asset_create_soft_ball(radius, cells, ref of, modes, 0.02, out made), made);
  }
  /// `cells`: along x, y and z.
  public static Asset SoftBox(Vec3 halfExtents, int[] cells, int modes = 12, Material? material = null) {
    IntPtr made;
    var of = material ?? Jelly;
    return Made(Native.limber_asset_create_soft_box(halfExtents, cells, ref of, modes, 0.02, out made), made);
  }
  public static Material Jelly {
    get { return new Material { youngs_modulus = 1e5, poisson_ratio = 0.4, density = 1000.0 }; }
  }

  /// Numbers and surfaces of a body. `Data.render` has rest positions and corners in the asset's memory.
  public ModelData Data(int body = 0) {
    IntPtr model;
    ModelData data;
    LimberException.Check(Native.limber_asset_model(Pointer, (UIntPtr)body, out model));
    LimberException.Check(Native.limber_model_get_data(model, out data));
    return data;
  }
}

/// Bodies in a space, moved in fixed steps.
public sealed class World : NativeObject {
  /// Bodies meet by these contacts; by the defaults where none are given.
  public World(WorldOptions? options = null, ContactOptions? contacts = null) : base(Create(options)) {
    var touch = contacts ?? Native.limber_default_contact_options();
    LimberException.Check(Native.limber_world_set_contacts(Pointer, ref touch));
  }
  static IntPtr Create(WorldOptions? options) {
    IntPtr made;
    var chosen = options ?? Native.limber_default_world_options();
    LimberException.Check(Native.limber_world_create(ref chosen, out made));
    return made;
  }
  protected override void Destroy(IntPtr pointer) { Native.limber_world_destroy(pointer); }

  public static Vec3 Vector(double x, double y, double z) { return new Vec3 { x = x, y = y, z = z }; }
  /// A placement by the body's origin, m.
  public static Placement At(double x, double y, double z) {
    var placement = Native.limber_default_placement();
    placement.pose.p = Vector(x, y, z);
    return placement;
  }

  // Bodies. Without a placement they start at the world's origin.
  public BodyId AddBody(Asset asset, Placement? placement = null, int body = 0) {
    BodyId id;
    var at = placement ?? At(0, 0, 0);
    LimberException.Check(Native.limber_world_add_body(Pointer, asset.Pointer, (UIntPtr)body, ref at, out id));
    return id;
  }
  /// Of even density, kg/m³.
  public BodyId AddRigid(Shape shape, double density, Placement? placement = null) {
    BodyId id;
    var at = placement ?? At(0, 0, 0);
    LimberException.Check(Native.limber_world_add_rigid(Pointer, shape.Pointer, density, ref at, out id));
    return id;
  }
  /// Goes where Lead() leads it.
  public BodyId AddKinematic(Shape shape, Placement? placement = null) {
    BodyId id;
    var at = placement ?? At(0, 0, 0);
    LimberException.Check(Native.limber_world_add_kinematic(Pointer, shape.Pointer, ref at, out id));
    return id;
  }
  public BodyId AddStatic(Shape shape, Placement? placement = null) {
    BodyId id;
    var at = placement ?? At(0, 0, 0);
    LimberException.Check(Native.limber_world_add_static(Pointer, shape.Pointer, ref at, out id));
    return id;
  }
  public void Remove(BodyId id) { LimberException.Check(Native.limber_world_remove_body(Pointer, id)); }
  public bool Contains(BodyId id) { return Native.limber_world_contains_body(Pointer, id); }
  /// Pose, velocities, and the modes' amplitudes in the world's memory.
  public BodyState StateOf(BodyId id) {
    BodyState state;
    LimberException.Check(Native.limber_world_body_state(Pointer, id, out state));
    return state;
  }
  public void SetPose(BodyId id, Transform pose) { LimberException.Check(Native.limber_world_set_pose(Pointer, id, pose)); }
  public void SetVelocity(BodyId id, Vec3 velocity, Vec3 angularVelocity) {
    LimberException.Check(Native.limber_world_set_velocity(Pointer, id, velocity, angularVelocity));
  }
  public void Lead(BodyId id, KinematicFrame target) {
    LimberException.Check(Native.limber_world_set_kinematic_frame(Pointer, id, ref target));
  }
  public void ApplyForce(BodyId id, SurfacePoint at, Vec3 newtons, Axes axes = Axes.LIMBER_AXES_WORLD) {
    LimberException.Check(Native.limber_world_apply_force(Pointer, id, at, newtons, axes));
  }
  public void ApplyImpulse(BodyId id, SurfacePoint at, Vec3 newtonSeconds, Axes axes = Axes.LIMBER_AXES_WORLD, double delay = 0.0) {
    LimberException.Check(Native.limber_world_apply_impulse(Pointer, id, at, newtonSeconds, axes, delay));
  }

  // Joints and handles. A BodyId of zeros is the world.
  public JointId AddJoint(BodyId a, BodyId b, JointOptions options) {
    JointId joint;
    LimberException.Check(Native.limber_world_add_joint(Pointer, a, b, ref options, out joint));
    return joint;
  }
  /// Bodies and joints of an asset, per number; without a placement where its input has them. Joints that are left out are zeros.
  public void AddMachine(Asset asset, out BodyId[] bodies, out JointId[] joints, MachinePlacement? placement = null) {
    var start = placement ?? Native.limber_default_machine_placement();
    bodies = new BodyId[(int)Native.limber_asset_body_count(asset.Pointer)];
    joints = new JointId[(int)Native.limber_asset_joint_count(asset.Pointer)];
    LimberException.Check(Native.limber_world_add_machine(Pointer, asset.Pointer, ref start, bodies, joints));
  }
  public void Actuate(JointId joint, int coordinate, Actuation actuation) {
    LimberException.Check(Native.limber_world_set_joint_actuation(Pointer, joint, coordinate, ref actuation));
  }
  public HandleId Hold(BodyId id, SurfacePoint at, HandleOptions? options = null) {
    HandleId handle;
    var chosen = options ?? Native.limber_default_handle_options();
    LimberException.Check(Native.limber_world_add_handle(Pointer, id, at, ref chosen, out handle));
    return handle;
  }
  public void MoveTo(HandleId handle, Vec3 position, Vec3 velocity = new Vec3()) {
    LimberException.Check(Native.limber_world_set_handle_target(Pointer, handle, position, velocity));
  }
  public void Release(HandleId handle) { LimberException.Check(Native.limber_world_remove_handle(Pointer, handle)); }

  // Time.
  public void Step(int steps = 1) { LimberException.Check(Native.limber_world_step(Pointer, steps)); }
  /// Takes as many fixed steps as fit into the seconds of a frame; returns how many.
  public int Advance(double seconds) {
    int steps;
    LimberException.Check(Native.limber_world_advance(Pointer, seconds, out steps));
    return steps;
  }
  public double Time { get { return Native.limber_world_time(Pointer); } }
  /// How far to draw between the last two states.
  public double InterpolationFactor { get { return Native.limber_world_interpolation_factor(Pointer); } }

  // Queries and events. Arrays are the caller's: what does not fit is left out, and the full number returned.
  /// The first place that a ray from `from` along `way`, as long as that, meets.
  public bool CastRay(Vec3 from, Vec3 way, out Hit hit) {
    Bool found;
    LimberException.Check(Native.limber_world_cast_ray(Pointer, from, way, IntPtr.Zero, out found, out hit));
    return found;
  }
  public int ContactEvents(ContactEvent[] events) {
    UIntPtr count;
    LimberException.Check(Native.limber_world_contact_events(Pointer, events, (UIntPtr)events.Length, out count));
    return (int)count;
  }
  public int HitEvents(HitEvent[] events) {
    UIntPtr count;
    LimberException.Check(Native.limber_world_hit_events(Pointer, events, (UIntPtr)events.Length, out count));
    return (int)count;
  }

  // Drawing: 3 floats a vertex of the render surface, world; `normals` may be null.
  public void Reconstruct(BodyId id, float[] positions, float[] normals = null, double interpolation = 1.0) {
    LimberException.Check(Native.limber_world_reconstruct(Pointer, id, positions, normals, interpolation));
  }
  /// The same into memory of another's, as that of an engine's vertex buffer.
  public void Reconstruct(BodyId id, IntPtr positions, IntPtr normals, double interpolation = 1.0) {
    LimberException.Check(Native.limber_world_reconstruct(Pointer, id, positions, normals, interpolation));
  }
  public void Poses(BodyId[] ids, Transform[] poses, double interpolation = 1.0) {
    if (poses.Length < ids.Length) throw new ArgumentException("there is room for fewer poses than ids");
    LimberException.Check(Native.limber_world_interpolated_poses(Pointer, ids, (UIntPtr)ids.Length, interpolation, poses));
  }

  // Rollback.
  public byte[] Save() {
    IntPtr snapshot;
    LimberException.Check(Native.limber_snapshot_create(out snapshot));
    try {
      LimberException.Check(Native.limber_world_save_state(Pointer, snapshot));
      UIntPtr size;
      IntPtr bytes = Native.limber_snapshot_bytes(snapshot, out size);
      var state = new byte[(int)size];
      Marshal.Copy(bytes, state, 0, state.Length);
      return state;
    } finally {
      Native.limber_snapshot_destroy(snapshot);
    }
  }
  public void Restore(byte[] state) {
    LimberException.Check(Native.limber_world_restore_state(Pointer, state, (UIntPtr)state.Length));
  }
  /// Equal for worlds with the same calls behind them, from C++, C and Python too.
  public ulong StateHash { get { return Native.limber_world_state_hash(Pointer); } }
}

}
