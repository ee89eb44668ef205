// The C interface as C# sees it: what each thing is, the C headers tell (c/include/limber/c).
// Written by csharp/generate from them: not to be changed by hand.
using System;
using System.Runtime.InteropServices;

namespace Limber {

/// A bool of C, of one byte.
[StructLayout(LayoutKind.Sequential)]
public struct Bool {
  byte value;
  public static implicit operator bool(Bool b) { return b.value != 0; }
  public static implicit operator Bool(bool b) { return new Bool { value = b ? (byte)1 : (byte)0 }; }
}

public enum Result {
  LIMBER_OK = 0,
  LIMBER_INVALID_ARGUMENT = 1,
  LIMBER_INPUT_ERROR = 2,
  LIMBER_COMPUTATION_ERROR = 3,
  LIMBER_OUT_OF_MEMORY = 4,
  LIMBER_INTERNAL_ERROR = 5,
}

public enum Surface {
  LIMBER_SURFACE_RENDER = 0,
  LIMBER_SURFACE_COLLISION = 1,
}

public enum FrameMotion {
  LIMBER_FRAME_FREE = 0,
  LIMBER_FRAME_POINT = 1,
  LIMBER_FRAME_LINE = 2,
  LIMBER_FRAME_KINEMATIC = 3,
}

public enum BodyType {
  LIMBER_BODY_STATIC = 0,
  LIMBER_BODY_KINEMATIC = 1,
  LIMBER_BODY_DYNAMIC = 2,
}

public enum Axes {
  LIMBER_AXES_WORLD = 0,
  LIMBER_AXES_BODY = 1,
}

public enum JointType {
  LIMBER_JOINT_BALL = 0,
  LIMBER_JOINT_REVOLUTE = 1,
  LIMBER_JOINT_CYLINDRICAL = 2,
  LIMBER_JOINT_PRISMATIC = 3,
  LIMBER_JOINT_PLANAR = 4,
  LIMBER_JOINT_FIXED = 5,
}

public enum ManipulationLevel {
  LIMBER_MANIPULATE_ACCELERATION = 0,
  LIMBER_MANIPULATE_VELOCITY = 1,
  LIMBER_MANIPULATE_POSITION = 2,
  LIMBER_MANIPULATE_POSITION_IMPULSE = 3,
}

public enum ContactSolver {
  LIMBER_CONTACT_GAME = 0,
  LIMBER_CONTACT_EXACT = 1,
}

public enum ContactPhase {
  LIMBER_CONTACT_BEGUN = 0,
  LIMBER_CONTACT_LASTING = 1,
  LIMBER_CONTACT_ENDED = 2,
}

/// 3 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct DoubleArray3 {
  double e0, e1, e2;
  public double this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 9 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct DoubleArray9 {
  double e0, e1, e2, e3, e4, e5, e6, e7, e8;
  public double this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        case 3: return e3;
        case 4: return e4;
        case 5: return e5;
        case 6: return e6;
        case 7: return e7;
        case 8: return e8;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        case 3: e3 = value; break;
        case 4: e4 = value; break;
        case 5: e5 = value; break;
        case 6: e6 = value; break;
        case 7: e7 = value; break;
        case 8: e8 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 3 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct BoolArray3 {
  Bool e0, e1, e2;
  public Bool this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 9 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct LongArray9 {
  long e0, e1, e2, e3, e4, e5, e6, e7, e8;
  public long this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        case 3: return e3;
        case 4: return e4;
        case 5: return e5;
        case 6: return e6;
        case 7: return e7;
        case 8: return e8;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        case 3: e3 = value; break;
        case 4: e4 = value; break;
        case 5: e5 = value; break;
        case 6: e6 = value; break;
        case 7: e7 = value; break;
        case 8: e8 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 3 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct Vec3Array3 {
  Vec3 e0, e1, e2;
  public Vec3 this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 2 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct IntervalArray2 {
  Interval e0, e1;
  public Interval this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 3 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct IntervalArray3 {
  Interval e0, e1, e2;
  public Interval this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

/// 3 in a row.
[StructLayout(LayoutKind.Sequential)]
public struct ActuationArray3 {
  Actuation e0, e1, e2;
  public Actuation this[int i] {
    get {
      switch (i) {
        case 0: return e0;
        case 1: return e1;
        case 2: return e2;
        default: throw new IndexOutOfRangeException();
      }
    }
    set {
      switch (i) {
        case 0: e0 = value; break;
        case 1: e1 = value; break;
        case 2: e2 = value; break;
        default: throw new IndexOutOfRangeException();
      }
    }
  }
}

[StructLayout(LayoutKind.Sequential)]
public struct Vec3 {
  public double x;
  public double y;
  public double z;
}

[StructLayout(LayoutKind.Sequential)]
public struct Quat {
  public double w;
  public double x;
  public double y;
  public double z;
}

[StructLayout(LayoutKind.Sequential)]
public struct Transform {
  public Quat q;
  public Vec3 p;
}

[StructLayout(LayoutKind.Sequential)]
public struct BodyId {
  public uint index;
  public uint generation;
}

[StructLayout(LayoutKind.Sequential)]
public struct HandleId {
  public uint index;
  public uint generation;
}

[StructLayout(LayoutKind.Sequential)]
public struct JointId {
  public uint index;
  public uint generation;
}

[StructLayout(LayoutKind.Sequential)]
public struct SurfacePoint {
  public Surface surface;
  public int triangle;
  public DoubleArray3 weight;
}

[StructLayout(LayoutKind.Sequential)]
public struct Filter {
  public uint layers;
  public uint mask;
  public Bool self;
}

[StructLayout(LayoutKind.Sequential)]
public struct Material {
  public double youngs_modulus;
  public double poisson_ratio;
  public double density;
}

[StructLayout(LayoutKind.Sequential)]
public struct SurfaceData {
  public int vertices;
  public int triangles;
  public IntPtr rest;
  public IntPtr corner;
}

[StructLayout(LayoutKind.Sequential)]
public struct ModelData {
  public IntPtr name;
  public FrameMotion motion;
  public int modes;
  public double mass;
  public double volume;
  public Vec3 center_of_mass;
  public Vec3 origin_in_input;
  public DoubleArray9 inertia;
  public IntPtr eigenvalue;
  public IntPtr decay;
  public IntPtr mode_scale;
  public SurfaceData render;
  public SurfaceData collision;
  public Bool has_modal_skin;
  public Bool has_volume;
}

[StructLayout(LayoutKind.Sequential)]
public struct MassProperties {
  public double mass;
  public Vec3 center_of_mass;
  public DoubleArray9 inertia;
}

[StructLayout(LayoutKind.Sequential)]
public struct ShapePart {
  public IntPtr shape;
  public Transform pose;
}

[StructLayout(LayoutKind.Sequential)]
public struct Jobs {
  public IntPtr context;
  public int concurrency;
  public IntPtr parallel_for;
}

[StructLayout(LayoutKind.Sequential)]
public struct WorldOptions {
  public double step;
  public int substeps;
  public Vec3 gravity;
  public int max_steps_per_advance;
  public Bool sleep;
  public double sleep_time;
  public double sleep_speed;
  public Bool half_precision;
  public double hit_speed;
  public Jobs jobs;
}

[StructLayout(LayoutKind.Sequential)]
public struct FrameSettings {
  public double gravity_scale;
  public double linear_damping;
  public double angular_damping;
  public BoolArray3 lock_translation;
  public BoolArray3 lock_rotation;
}

[StructLayout(LayoutKind.Sequential)]
public struct Placement {
  public Transform pose;
  public Vec3 velocity;
  public Vec3 angular_velocity;
  public Filter filter;
  public double friction;
  public double restitution;
  public IntPtr shape;
  public ulong user_data;
  public FrameSettings frame;
  public Bool modal_skin;
  public Bool inertial_coupling;
}

[StructLayout(LayoutKind.Sequential)]
public struct KinematicFrame {
  public Transform pose;
  public Vec3 velocity;
  public Vec3 acceleration;
  public Vec3 angular_velocity;
  public Vec3 angular_acceleration;
}

[StructLayout(LayoutKind.Sequential)]
public struct BodyState {
  public Transform pose;
  public Vec3 velocity;
  public Vec3 angular_velocity;
  public IntPtr amplitude;
  public IntPtr rate;
  public int modes;
}

[StructLayout(LayoutKind.Sequential)]
public struct Energy {
  public double kinetic_rigid;
  public double potential;
  public double kinetic_modal;
  public double elastic;
}

[StructLayout(LayoutKind.Sequential)]
public struct DrawTarget {
  public BodyId id;
  public IntPtr positions;
  public IntPtr normals;
  public double tolerance;
}

[StructLayout(LayoutKind.Sequential)]
public struct StageTimes {
  public DoubleArray9 seconds;
  public LongArray9 units;
}

[StructLayout(LayoutKind.Sequential)]
public struct HandleOptions {
  public Vec3Array3 direction;
  public int directions;
  public double max_force;
  public double stiffness;
  public double damping;
}

[StructLayout(LayoutKind.Sequential)]
public struct HandleState {
  public Vec3 target;
  public Vec3 target_velocity;
  public Vec3 force;
  public double work;
  public double error;
}

[StructLayout(LayoutKind.Sequential)]
public struct Interval {
  public double low;
  public double high;
}

[StructLayout(LayoutKind.Sequential)]
public struct Attachment {
  public IntPtr patch;
  public UIntPtr patch_count;
  public double radius;
  public Surface surface;
}

[StructLayout(LayoutKind.Sequential)]
public struct JointOptions {
  public JointType type;
  public Transform frame;
  public Interval rotation;
  public IntervalArray2 translation;
  public double cone;
  public IntervalArray3 euler;
  public double pitch;
  public Attachment on_a;
  public Attachment on_b;
  public Bool collide_connected;
}

[StructLayout(LayoutKind.Sequential)]
public struct Actuation {
  public double motor_velocity;
  public double motor_max_force;
  public double drive_target;
  public double drive_stiffness;
  public double drive_damping;
  public double friction;
}

[StructLayout(LayoutKind.Sequential)]
public struct JointState {
  public int coordinates;
  public DoubleArray3 position;
  public DoubleArray3 force;
  public Vec3 lock_force;
  public double distance_error;
  public double angle_error;
}

[StructLayout(LayoutKind.Sequential)]
public struct JointBreak {
  public JointId joint;
  public BodyId a;
  public BodyId b;
  public ulong user_data;
  public Vec3 force;
}

[StructLayout(LayoutKind.Sequential)]
public struct AssetJoint {
  public int a;
  public int b;
  public JointOptions options;
  public int coordinates;
  public ActuationArray3 actuation;
}

[StructLayout(LayoutKind.Sequential)]
public struct MachinePlacement {
  public Transform pose;
  public Vec3 velocity;
  public Vec3 angular_velocity;
  public Bool tied;
  public Filter filter;
}

[StructLayout(LayoutKind.Sequential)]
public struct ConstraintReport {
  public int islands;
  public int bodies;
  public int rows;
  public int iterations;
  public int solved_islands;
  public int limit_islands;
  public int failed_islands;
  public double residual;
  public Bool solved;
  public double energy_removed;
}

[StructLayout(LayoutKind.Sequential)]
public struct PointDirection {
  public BodyId body;
  public SurfacePoint at;
  public Vec3 direction;
}

[StructLayout(LayoutKind.Sequential)]
public struct ContactOptions {
  public ContactSolver solver;
  public Bool find_contacts;
  public int substeps;
  public double slop;
  public double push_speed;
  public double friction;
  public double rolling_friction;
  public double recovery_speed;
  public Bool residual_compliance;
  public double compliance;
}

[StructLayout(LayoutKind.Sequential)]
public struct Contact {
  public ulong id;
  public BodyId a;
  public BodyId b;
  public Vec3 position;
  public Vec3 normal;
  public double gap;
}

[StructLayout(LayoutKind.Sequential)]
public struct ContactEvent {
  public ulong id;
  public BodyId a;
  public BodyId b;
  public ContactPhase phase;
  public Vec3 position;
  public Vec3 normal;
  public Vec3 impulse;
  public double approach;
}

[StructLayout(LayoutKind.Sequential)]
public struct HitEvent {
  public BodyId a;
  public BodyId b;
  public ulong user_data_a;
  public ulong user_data_b;
  public Vec3 position;
  public Vec3 normal;
  public double speed;
  public Vec3 impulse;
}

[StructLayout(LayoutKind.Sequential)]
public struct SensorEvent {
  public BodyId sensor;
  public BodyId body;
  public Bool began;
  public ulong user_data_sensor;
  public ulong user_data_body;
}

[StructLayout(LayoutKind.Sequential)]
public struct QueryFilter {
  public uint mask;
  public IntPtr accepts;
  public IntPtr context;
}

[StructLayout(LayoutKind.Sequential)]
public struct Hit {
  public BodyId body;
  public Bool has_point;
  public SurfacePoint at;
  public Vec3 position;
  public Vec3 normal;
  public double fraction;
  public double distance;
  public ulong user_data;
}

public static class Native {
  const string Library = "limber";
  [DllImport(Library)]
  public static extern IntPtr limber_last_error();
  [DllImport(Library)]
  public static extern IntPtr limber_version();
  [DllImport(Library)]
  public static extern Quat limber_quat_from_rotation_vector(Vec3 r);
  [DllImport(Library)]
  public static extern Transform limber_identity();
  [DllImport(Library)]
  public static extern Result limber_asset_read_file([MarshalAs(UnmanagedType.LPUTF8Str)] string path, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_read_memory(byte[] bytes, UIntPtr size, [MarshalAs(UnmanagedType.LPUTF8Str)] string name, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_read_memory(IntPtr bytes, UIntPtr size, [MarshalAs(UnmanagedType.LPUTF8Str)] string name, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_write_file(IntPtr asset, [MarshalAs(UnmanagedType.LPUTF8Str)] string path);
  [DllImport(Library)]
  public static extern void limber_asset_destroy(IntPtr asset);
  [DllImport(Library)]
  public static extern UIntPtr limber_asset_body_count(IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_model(IntPtr asset, UIntPtr body, out IntPtr model);
  [DllImport(Library)]
  public static extern Result limber_material_preset([MarshalAs(UnmanagedType.LPUTF8Str)] string name, out Material material);
  [DllImport(Library)]
  public static extern Result limber_asset_create_soft_ball(double radius, int cells, ref Material material, int modes, double damping_ratio, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_create_soft_ball(double radius, int cells, IntPtr material, int modes, double damping_ratio, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_create_soft_box(Vec3 half_extents, [In] int[] cells, ref Material material, int modes, double damping_ratio, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_create_soft_box(Vec3 half_extents, IntPtr cells, IntPtr material, int modes, double damping_ratio, out IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_model_get_data(IntPtr model, out ModelData data);
  [DllImport(Library)]
  public static extern Result limber_model_morph_target(IntPtr model, int mode, [In, Out] float[] displacements);
  [DllImport(Library)]
  public static extern Result limber_model_morph_target(IntPtr model, int mode, IntPtr displacements);
  [DllImport(Library)]
  public static extern Result limber_shape_create_half_space(Vec3 normal, double offset, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_sphere(double radius, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_capsule(double radius, double half_length, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_box(Vec3 half_extents, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_cylinder(double radius, double half_length, int sides, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_hull([In] double[] points, UIntPtr count, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_hull(IntPtr points, UIntPtr count, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_mesh([In] double[] vertices, UIntPtr vertex_count, [In] int[] corners, UIntPtr triangle_count, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_mesh(IntPtr vertices, UIntPtr vertex_count, IntPtr corners, UIntPtr triangle_count, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_height_field(int columns, int rows, double spacing_x, double spacing_y, [In] float[] heights, out IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_create_height_field(int columns, int rows, double spacing_x, double spacing_y, IntPtr heights, out IntPtr shape);
  [DllImport(Library)]
  public static extern void limber_shape_destroy(IntPtr shape);
  [DllImport(Library)]
  public static extern Result limber_shape_mass_properties(IntPtr shape, double density, out MassProperties mass);
  [DllImport(Library)]
  public static extern Result limber_parts_mass_properties([In] ShapePart[] parts, UIntPtr count, double density, out MassProperties mass);
  [DllImport(Library)]
  public static extern Result limber_parts_mass_properties(IntPtr parts, UIntPtr count, double density, out MassProperties mass);
  [DllImport(Library)]
  public static extern WorldOptions limber_default_world_options();
  [DllImport(Library)]
  public static extern Result limber_world_create(ref WorldOptions options, out IntPtr world);
  [DllImport(Library)]
  public static extern Result limber_world_create(IntPtr options, out IntPtr world);
  [DllImport(Library)]
  public static extern void limber_world_destroy(IntPtr world);
  [DllImport(Library)]
  public static extern Result limber_world_get_options(IntPtr world, out WorldOptions options);
  [DllImport(Library)]
  public static extern FrameSettings limber_default_frame_settings();
  [DllImport(Library)]
  public static extern Placement limber_default_placement();
  [DllImport(Library)]
  public static extern Result limber_world_add_body(IntPtr world, IntPtr asset, UIntPtr body, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_body(IntPtr world, IntPtr asset, UIntPtr body, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_rigid(IntPtr world, IntPtr shape, double density, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_rigid(IntPtr world, IntPtr shape, double density, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_rigid_with_mass(IntPtr world, IntPtr shape, ref MassProperties mass, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_rigid_with_mass(IntPtr world, IntPtr shape, IntPtr mass, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_compound(IntPtr world, [In] ShapePart[] parts, UIntPtr count, double density, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_compound(IntPtr world, IntPtr parts, UIntPtr count, double density, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_compound_with_mass(IntPtr world, [In] ShapePart[] parts, UIntPtr count, ref MassProperties mass, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_compound_with_mass(IntPtr world, IntPtr parts, UIntPtr count, IntPtr mass, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_kinematic(IntPtr world, IntPtr shape, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_kinematic(IntPtr world, IntPtr shape, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_kinematic_compound(IntPtr world, [In] ShapePart[] parts, UIntPtr count, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_kinematic_compound(IntPtr world, IntPtr parts, UIntPtr count, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_static(IntPtr world, IntPtr shape, ref Placement placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_add_static(IntPtr world, IntPtr shape, IntPtr placement, out BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_remove_body(IntPtr world, BodyId id);
  [DllImport(Library)]
  public static extern Bool limber_world_contains_body(IntPtr world, BodyId id);
  [DllImport(Library)]
  public static extern UIntPtr limber_world_body_count(IntPtr world);
  [DllImport(Library)]
  public static extern Result limber_world_list_bodies(IntPtr world, [In, Out] BodyId[] ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_list_bodies(IntPtr world, IntPtr ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern BodyId limber_world_body_at(IntPtr world, uint index);
  [DllImport(Library)]
  public static extern Result limber_world_set_body_user_data(IntPtr world, BodyId id, ulong data);
  [DllImport(Library)]
  public static extern Result limber_world_body_user_data(IntPtr world, BodyId id, out ulong data);
  [DllImport(Library)]
  public static extern Result limber_world_body_model(IntPtr world, BodyId id, out IntPtr model);
  [DllImport(Library)]
  public static extern Result limber_world_body_type(IntPtr world, BodyId id, out BodyType type);
  [DllImport(Library)]
  public static extern Result limber_world_is_asleep(IntPtr world, BodyId id, out Bool asleep);
  [DllImport(Library)]
  public static extern Result limber_world_wake(IntPtr world, BodyId id);
  [DllImport(Library)]
  public static extern Result limber_world_step(IntPtr world, int steps);
  [DllImport(Library)]
  public static extern Result limber_world_advance(IntPtr world, double seconds, out int steps);
  [DllImport(Library)]
  public static extern Result limber_world_set_step(IntPtr world, double seconds);
  [DllImport(Library)]
  public static extern Result limber_world_set_gravity(IntPtr world, Vec3 gravity);
  [DllImport(Library)]
  public static extern Result limber_world_set_gravity_scale(IntPtr world, BodyId id, double scale);
  [DllImport(Library)]
  public static extern Result limber_world_set_damping(IntPtr world, BodyId id, double linear, double angular);
  [DllImport(Library)]
  public static extern Result limber_world_set_locks(IntPtr world, BodyId id, [In] Bool[] translation, [In] Bool[] rotation);
  [DllImport(Library)]
  public static extern Result limber_world_set_locks(IntPtr world, BodyId id, IntPtr translation, IntPtr rotation);
  [DllImport(Library)]
  public static extern Result limber_world_frame_settings(IntPtr world, BodyId id, out FrameSettings settings);
  [DllImport(Library)]
  public static extern double limber_world_interpolation_factor(IntPtr world);
  [DllImport(Library)]
  public static extern double limber_world_time(IntPtr world);
  [DllImport(Library)]
  public static extern ulong limber_world_step_count(IntPtr world);
  [DllImport(Library)]
  public static extern double limber_world_dropped_seconds(IntPtr world);
  [DllImport(Library)]
  public static extern Result limber_world_apply_force(IntPtr world, BodyId id, SurfacePoint at, Vec3 force, Axes axes);
  [DllImport(Library)]
  public static extern Result limber_world_apply_impulse(IntPtr world, BodyId id, SurfacePoint at, Vec3 impulse, Axes axes, double delay);
  [DllImport(Library)]
  public static extern Result limber_world_set_kinematic_frame(IntPtr world, BodyId id, ref KinematicFrame target);
  [DllImport(Library)]
  public static extern Result limber_world_set_kinematic_frame(IntPtr world, BodyId id, IntPtr target);
  [DllImport(Library)]
  public static extern Result limber_world_body_state(IntPtr world, BodyId id, out BodyState state);
  [DllImport(Library)]
  public static extern Result limber_world_set_pose(IntPtr world, BodyId id, Transform pose);
  [DllImport(Library)]
  public static extern Result limber_world_set_velocity(IntPtr world, BodyId id, Vec3 velocity, Vec3 angular_velocity);
  [DllImport(Library)]
  public static extern Result limber_world_set_amplitudes(IntPtr world, BodyId id, [In] double[] amplitudes, [In] double[] rates, int modes);
  [DllImport(Library)]
  public static extern Result limber_world_set_amplitudes(IntPtr world, BodyId id, IntPtr amplitudes, IntPtr rates, int modes);
  [DllImport(Library)]
  public static extern Result limber_world_set_node_displacements(IntPtr world, BodyId id, [In] double[] displacements, [In] double[] velocities, UIntPtr numbers);
  [DllImport(Library)]
  public static extern Result limber_world_set_node_displacements(IntPtr world, BodyId id, IntPtr displacements, IntPtr velocities, UIntPtr numbers);
  [DllImport(Library)]
  public static extern Result limber_world_energy(IntPtr world, BodyId id, out Energy energy);
  [DllImport(Library)]
  public static extern Result limber_world_linear_momentum(IntPtr world, BodyId id, out Vec3 momentum);
  [DllImport(Library)]
  public static extern Result limber_world_angular_momentum(IntPtr world, BodyId id, out Vec3 momentum);
  [DllImport(Library)]
  public static extern Result limber_world_point_position(IntPtr world, BodyId id, SurfacePoint at, out Vec3 position);
  [DllImport(Library)]
  public static extern Result limber_world_point_velocity(IntPtr world, BodyId id, SurfacePoint at, out Vec3 velocity);
  [DllImport(Library)]
  public static extern Result limber_world_point_indentation(IntPtr world, BodyId id, SurfacePoint at, out Vec3 displacement);
  [DllImport(Library)]
  public static extern ulong limber_world_state_hash(IntPtr world);
  [DllImport(Library)]
  public static extern Result limber_snapshot_create(out IntPtr snapshot);
  [DllImport(Library)]
  public static extern void limber_snapshot_destroy(IntPtr snapshot);
  [DllImport(Library)]
  public static extern IntPtr limber_snapshot_bytes(IntPtr snapshot, out UIntPtr size);
  [DllImport(Library)]
  public static extern Result limber_world_save_state(IntPtr world, IntPtr snapshot);
  [DllImport(Library)]
  public static extern Result limber_world_restore_state(IntPtr world, byte[] bytes, UIntPtr size);
  [DllImport(Library)]
  public static extern Result limber_world_restore_state(IntPtr world, IntPtr bytes, UIntPtr size);
  [DllImport(Library)]
  public static extern Result limber_world_reconstruct_all(IntPtr world, [In] DrawTarget[] targets, UIntPtr count, double interpolation, Vec3 origin);
  [DllImport(Library)]
  public static extern Result limber_world_reconstruct_all(IntPtr world, IntPtr targets, UIntPtr count, double interpolation, Vec3 origin);
  [DllImport(Library)]
  public static extern Result limber_world_reconstruct(IntPtr world, BodyId id, [In, Out] float[] positions, [In, Out] float[] normals, double interpolation);
  [DllImport(Library)]
  public static extern Result limber_world_reconstruct(IntPtr world, BodyId id, IntPtr positions, IntPtr normals, double interpolation);
  [DllImport(Library)]
  public static extern Result limber_world_interpolated_poses(IntPtr world, [In] BodyId[] ids, UIntPtr count, double interpolation, [In, Out] Transform[] poses);
  [DllImport(Library)]
  public static extern Result limber_world_interpolated_poses(IntPtr world, IntPtr ids, UIntPtr count, double interpolation, IntPtr poses);
  [DllImport(Library)]
  public static extern Result limber_world_interpolated_amplitudes(IntPtr world, BodyId id, double interpolation, [In, Out] float[] amplitudes);
  [DllImport(Library)]
  public static extern Result limber_world_interpolated_amplitudes(IntPtr world, BodyId id, double interpolation, IntPtr amplitudes);
  [DllImport(Library)]
  public static extern Result limber_world_interpolated_weights(IntPtr world, BodyId id, double interpolation, [In, Out] float[] weights);
  [DllImport(Library)]
  public static extern Result limber_world_interpolated_weights(IntPtr world, BodyId id, double interpolation, IntPtr weights);
  [DllImport(Library)]
  public static extern Result limber_world_has_modal_skin(IntPtr world, BodyId id, out Bool has);
  [DllImport(Library)]
  public static extern Result limber_world_set_stage_times(IntPtr world, Bool on);
  [DllImport(Library)]
  public static extern Result limber_world_get_stage_times(IntPtr world, out StageTimes times);
  [DllImport(Library)]
  public static extern IntPtr limber_stage_name(int stage);
  [DllImport(Library)]
  public static extern HandleOptions limber_default_handle_options();
  [DllImport(Library)]
  public static extern Result limber_world_add_handle(IntPtr world, BodyId id, SurfacePoint at, ref HandleOptions options, out HandleId handle);
  [DllImport(Library)]
  public static extern Result limber_world_add_handle(IntPtr world, BodyId id, SurfacePoint at, IntPtr options, out HandleId handle);
  [DllImport(Library)]
  public static extern Result limber_world_remove_handle(IntPtr world, HandleId id);
  [DllImport(Library)]
  public static extern Bool limber_world_contains_handle(IntPtr world, HandleId id);
  [DllImport(Library)]
  public static extern Result limber_world_list_handles(IntPtr world, [In, Out] HandleId[] ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_list_handles(IntPtr world, IntPtr ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_set_handle_target(IntPtr world, HandleId id, Vec3 position, Vec3 velocity);
  [DllImport(Library)]
  public static extern Result limber_world_handle_state(IntPtr world, HandleId id, out HandleState state);
  [DllImport(Library)]
  public static extern Result limber_world_set_handle_user_data(IntPtr world, HandleId id, ulong data);
  [DllImport(Library)]
  public static extern Result limber_world_handle_user_data(IntPtr world, HandleId id, out ulong data);
  [DllImport(Library)]
  public static extern JointOptions limber_default_joint_options();
  [DllImport(Library)]
  public static extern Result limber_world_add_joint(IntPtr world, BodyId a, BodyId b, ref JointOptions options, out JointId joint);
  [DllImport(Library)]
  public static extern Result limber_world_add_joint(IntPtr world, BodyId a, BodyId b, IntPtr options, out JointId joint);
  [DllImport(Library)]
  public static extern Result limber_world_remove_joint(IntPtr world, JointId id);
  [DllImport(Library)]
  public static extern Bool limber_world_contains_joint(IntPtr world, JointId id);
  [DllImport(Library)]
  public static extern Result limber_world_list_joints(IntPtr world, [In, Out] JointId[] ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_list_joints(IntPtr world, IntPtr ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_ignore_collision(IntPtr world, BodyId a, BodyId b, Bool ignore);
  [DllImport(Library)]
  public static extern Result limber_world_set_joint_actuation(IntPtr world, JointId id, int coordinate, ref Actuation actuation);
  [DllImport(Library)]
  public static extern Result limber_world_set_joint_actuation(IntPtr world, JointId id, int coordinate, IntPtr actuation);
  [DllImport(Library)]
  public static extern Result limber_world_joint_state(IntPtr world, JointId id, out JointState state);
  [DllImport(Library)]
  public static extern Result limber_world_set_joint_strength(IntPtr world, JointId id, double newtons);
  [DllImport(Library)]
  public static extern Result limber_world_joint_strength(IntPtr world, JointId id, out double newtons);
  [DllImport(Library)]
  public static extern Result limber_world_joint_breaks(IntPtr world, [In, Out] JointBreak[] breaks, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_joint_breaks(IntPtr world, IntPtr breaks, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_set_joint_user_data(IntPtr world, JointId id, ulong data);
  [DllImport(Library)]
  public static extern Result limber_world_joint_user_data(IntPtr world, JointId id, out ulong data);
  [DllImport(Library)]
  public static extern UIntPtr limber_asset_joint_count(IntPtr asset);
  [DllImport(Library)]
  public static extern Result limber_asset_get_joint(IntPtr asset, UIntPtr joint, out AssetJoint data);
  [DllImport(Library)]
  public static extern MachinePlacement limber_default_machine_placement();
  [DllImport(Library)]
  public static extern Result limber_world_add_machine(IntPtr world, IntPtr asset, ref MachinePlacement placement, [In, Out] BodyId[] bodies, [In, Out] JointId[] joints);
  [DllImport(Library)]
  public static extern Result limber_world_add_machine(IntPtr world, IntPtr asset, IntPtr placement, IntPtr bodies, IntPtr joints);
  [DllImport(Library)]
  public static extern Result limber_world_constraint_report(IntPtr world, out ConstraintReport report);
  [DllImport(Library)]
  public static extern Result limber_world_manipulate(IntPtr world, ManipulationLevel level, [In] PointDirection[] wishes, [In] double[] wanted, UIntPtr wish_count, [In] PointDirection[] forces, UIntPtr force_count, int max_iterations, [In, Out] double[] impulses, out double residual);
  [DllImport(Library)]
  public static extern Result limber_world_manipulate(IntPtr world, ManipulationLevel level, IntPtr wishes, IntPtr wanted, UIntPtr wish_count, IntPtr forces, UIntPtr force_count, int max_iterations, IntPtr impulses, out double residual);
  [DllImport(Library)]
  public static extern ContactOptions limber_default_contact_options();
  [DllImport(Library)]
  public static extern Result limber_world_set_contacts(IntPtr world, ref ContactOptions options);
  [DllImport(Library)]
  public static extern Result limber_world_set_contacts(IntPtr world, IntPtr options);
  [DllImport(Library)]
  public static extern Result limber_world_set_contact_veto(IntPtr world, IntPtr veto, IntPtr context);
  [DllImport(Library)]
  public static extern Result limber_world_contact_events(IntPtr world, [In, Out] ContactEvent[] events, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_contact_events(IntPtr world, IntPtr events, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_hit_events(IntPtr world, [In, Out] HitEvent[] events, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_hit_events(IntPtr world, IntPtr events, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_contact_impulse(IntPtr world, BodyId a, BodyId b, out Vec3 impulse);
  [DllImport(Library)]
  public static extern Result limber_world_set_surface_velocity(IntPtr world, BodyId id, Vec3 velocity);
  [DllImport(Library)]
  public static extern Result limber_world_surface_velocity(IntPtr world, BodyId id, out Vec3 velocity);
  [DllImport(Library)]
  public static extern Result limber_world_add_sensor(IntPtr world, IntPtr shape, Transform pose, Filter filter, out BodyId id);
  [DllImport(Library)]
  public static extern Filter limber_default_filter();
  [DllImport(Library)]
  public static extern Result limber_world_set_sensor_pose(IntPtr world, BodyId id, Transform pose);
  [DllImport(Library)]
  public static extern Result limber_world_sensor_events(IntPtr world, [In, Out] SensorEvent[] events, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_sensor_events(IntPtr world, IntPtr events, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_list_inside(IntPtr world, BodyId sensor, [In, Out] BodyId[] ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_list_inside(IntPtr world, BodyId sensor, IntPtr ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern QueryFilter limber_default_query_filter();
  [DllImport(Library)]
  public static extern Result limber_world_cast_ray(IntPtr world, Vec3 from, Vec3 way, ref QueryFilter filter, out Bool found, out Hit hit);
  [DllImport(Library)]
  public static extern Result limber_world_cast_ray(IntPtr world, Vec3 from, Vec3 way, IntPtr filter, out Bool found, out Hit hit);
  [DllImport(Library)]
  public static extern Result limber_world_cast_ray_all(IntPtr world, Vec3 from, Vec3 way, ref QueryFilter filter, [In, Out] Hit[] hits, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_cast_ray_all(IntPtr world, Vec3 from, Vec3 way, IntPtr filter, IntPtr hits, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_cast_shape(IntPtr world, IntPtr shape, Transform pose, Vec3 way, ref QueryFilter filter, out Bool found, out Hit hit);
  [DllImport(Library)]
  public static extern Result limber_world_cast_shape(IntPtr world, IntPtr shape, Transform pose, Vec3 way, IntPtr filter, out Bool found, out Hit hit);
  [DllImport(Library)]
  public static extern Result limber_world_find_overlaps(IntPtr world, IntPtr shape, Transform pose, ref QueryFilter filter, [In, Out] BodyId[] ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_find_overlaps(IntPtr world, IntPtr shape, Transform pose, IntPtr filter, IntPtr ids, UIntPtr capacity, out UIntPtr count);
  [DllImport(Library)]
  public static extern Result limber_world_nearest_point(IntPtr world, Vec3 point, double max_distance, ref QueryFilter filter, out Bool found, out Hit hit);
  [DllImport(Library)]
  public static extern Result limber_world_nearest_point(IntPtr world, Vec3 point, double max_distance, IntPtr filter, out Bool found, out Hit hit);
}

}
