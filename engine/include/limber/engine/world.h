/// @file limber/engine/world.h
/// What a game loop drives: bodies, forces, a fixed step.
///
///   World world({.step = 1.0 / 60.0});
///   BodyId bell = world.add_body(model, {.pose = {.p = {0, 0, 2}}});
///   while (running) {
///     world.advance(frame_seconds);                  // 0, 1 or more fixed steps
///     world.reconstruct(bell, positions, normals);   // only what is drawn costs
///   }
///
/// Every body moves exactly over a step of any length: modes in closed form, the free rotation in closed form,
/// translation under gravity as its parabola; held torques and the swing of bodies hung from a point or line are second
/// order in the step (limber/dynamics/rigid_frame.h). Deterministic: same calls, same bits, for any Jobs. Once warm, a
/// step allocates nothing. A World is used by one thread at a time; it spreads the work over its Jobs itself.
///
/// Handles, joints and contacts are answered by small steps, in bounded work (ContactSolver::kGame,
/// limber/constraints/small_steps.h), or, by choice, as islands, each one problem per step, solved at the step's end
/// (kExact, limber/constraints/island_solver.h): held points and joints are then where they should be to round-off, and
/// the island's energy does not rise but by the work of what drives it. An island that a limit of work ends, as piles
/// of contacts often do, may miss that: ConstraintReport counts such islands and tells how far they are from their
/// rows' law. set_contact_source() chooses. Bodies without constraints cost what they cost without. Contact:
/// docs/contact.md.
///
/// All functions throw InvalidArgument, and then change nothing, for an id that names no body, for numbers that are not
/// finite, and for arrays of the wrong length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <tuple>
#include <vector>

#include "limber/collision/rigid_model.h"
#include "limber/collision/spatial_index.h"
#include "limber/constraints/contact_constraint.h"
#include "limber/constraints/handle.h"
#include "limber/constraints/island_solver.h"
#include "limber/constraints/island_status.h"
#include "limber/constraints/joint_constraint.h"
#include "limber/constraints/manipulation.h"
#include "limber/constraints/step_attempts.h"
#include "limber/core/jobs.h"
#include "limber/core/rigid_transform.h"
#include "limber/core/stage_times.h"
#include "limber/dynamics/body_energy.h"
#include "limber/dynamics/rigid_frame.h"
#include "limber/dynamics/surface_point.h"
#include "limber/model/modal_model.h"

namespace limber {

/// Names a body of one world. Stays invalid for good once its body is removed.
struct BodyId {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no body
  friend bool operator==(const BodyId&, const BodyId&) = default;
};

/// Names a handle of one world. Stays invalid for good once it is removed, by itself or with its body.
struct HandleId {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no handle
  friend bool operator==(const HandleId&, const HandleId&) = default;
};

/// Names a joint of one world, like HandleId.
struct JointId {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no joint
  friend bool operator==(const JointId&, const JointId&) = default;
};

/// When bodies are left alone until something happens to them.
///
/// An island (bodies tied together by contacts, joints and handles) falls asleep once all its bodies have been at rest
/// for `time`: no point of the frame faster than `speed`, |v| + |ω| r with r the reach of the surface from the body
/// origin; a kinetic energy of the modes of at most ½ m speed²; a sum of contact impulses that changes from step to
/// step by at most m speed; and no handle on it whose target moves by itself. It then stops where it is: positions and
/// energies stay, to the bit, and it costs nothing but its place in the broad phase.
///
/// It wakes as a whole when a body that is awake comes within reach (contacts are found with it), by a load, a new
/// state, a handle or joint added, removed or changed on any of its bodies, when one of them or a static shape that
/// they press on is removed, and by World::wake(). A body that creeps more slowly than `speed` is stopped.
struct SleepOptions {
  bool enabled = false;
  double time = 0.5;      ///< s, ≥ 0
  double speed = 1e-3;    ///< m/s, ≥ 0
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

struct WorldOptions {
  double step = 1.0 / 60.0;  ///< s; > 0
  /// n ≥ 1: each step is taken as n equal ones, contacts found anew in each. Held forces and targets go on over all of
  /// them, and events are those of the whole step.
  int substeps = 1;
  Vec3 gravity = {0.0, 0.0, -9.80665};  ///< m/s², world
  int max_steps_per_advance = 8;  ///< ≥ 1; time beyond this is dropped (and counted), so a slow frame cannot snowball
  SleepOptions sleep{};
  /// Keeps the drawn surfaces' shapes in half precision too (half_basis.h), half as many bytes again: a body that is
  /// drawn with a tolerance is drawn from these where what they are off by is within it. Half the time to read where
  /// bodies are drawn that share no shapes. Not for bodies with a modal skin.
  bool half_precision = false;
  double hit_speed = 1.0;  ///< m/s, ≥ 0: hit_events() tells of pairs that come together at least this fast
  void validate() const;   ///< @throws InvalidArgument naming the field and its value
};

/// How a body comes to move: World::body_type().
enum class BodyType {
  kStatic,     ///< not at all: World::add_static(), add_sensor()
  kKinematic,  ///< as World::set_kinematic_frame() says, whatever it meets: add_kinematic(), or a model of that
               ///< FrameMotion, whose modes move all the same
  kDynamic,    ///< by what acts on it: add_rigid(), add_body(), also of a model that hangs from a point or a line
};

/// How a body starts. Velocities are of the body origin (docs/notation.md), world axes.
struct BodyPlacement {
  RigidTransform pose{};         ///< X_WB
  Vec3 velocity = Vec3::Zero();  ///< m/s; for bodies with fixed nodes: of what carries them
  /// rad/s; kLine: its part along the line counts; kKinematic: of what carries it
  Vec3 angular_velocity = Vec3::Zero();
  CollisionFilter filter{};  ///< whom it meets, where the world has a contact source
  /// μ, ≥ 0; that of two bodies is √(μ_a μ_b). Infinite, with ContactSolver::kGame: what touches it sticks. Not given:
  /// ContactOptions::friction.
  std::optional<double> friction{};
  /// e, 0 to 1; that of two bodies is the larger. They part with e² of the energy that their contact takes as they meet
  /// (docs/contact.md). Of rigid bodies, with ContactSolver::kGame: bodies that bend rebound by their modes.
  double restitution = 0.0;
  /// What others meet in place of the model's collision surface: it moves with the frame and does not deform, and
  /// contacts with it do not excite the modes. Any shape but a half-space; null: the surface.
  std::shared_ptr<const Shape> shape{};
  std::uint64_t user_data = 0;  ///< the caller's own: World::user_data()
  /// Gravity's share, damping and locked axes (rigid_frame.h): World::set_gravity_scale() and the next two. Velocities
  /// along locked axes are left out.
  FrameSettings frame{};
  /// Whether the body bends by the modal skin of its model (docs/large-bends.md), where it has one: drawn, held, joined
  /// and pushed there. False, or no skin: by its modes alone.
  bool modal_skin = true;
  /// Whether a free body's turning and its modes feel each other's inertia: Coriolis, Euler and centrifugal forces on
  /// the deformation, and the change of inertia by it (limber/dynamics/inertial_coupling.h). False, as [H03] has it:
  /// modes ring as in a body that does not turn, and a body turns as one that is not bent.
  /// True needs a model with a volume block, no modal skin in use, and is for flight under forces, impulses and
  /// gravity: World refuses joints, handles and manipulate() on such a body, damping and locks of its frame, and a
  /// contact source unless its filter meets nothing.
  bool inertial_coupling = false;
};

/// How a joint sits on a deforming body: on a patch of its surface, whose mean displacement and rotation it follows.
struct JointAttachment {
  std::vector<SurfacePoint> patch{};  ///< its points; empty: vertices around the joint's origin
  double radius = 0.0;                ///< m, ≥ 0; without a patch: all vertices within it, or the nearest one
  SurfacePoint::Surface surface = SurfacePoint::Surface::kCollision;  ///< without a patch: of which surface
};

/// What a handle does, as of the last step.
struct HandleView {
  HandleTarget target{};      ///< for the coming step
  Vec3 force = Vec3::Zero();  ///< mean force on the body, world, N
  double work = 0.0;   ///< done on the body in the last step, J: each substep's force along the point's way in it
  double error = 0.0;  ///< distance from the target along the held directions, m
};

/// Which bodies may answer a query, and how one does: spatial_index.h by BodyId.
using BodyFilter = QueryFilter<BodyId>;
struct BodyHit : QueryHit<BodyId> {
  std::uint64_t user_data = 0;  ///< of the body
};

/// A body that came into a sensor in the last step, or left it.
struct SensorEvent {
  BodyId sensor{}, body{};
  bool began = true;                                       ///< false: left, or was removed
  std::uint64_t user_data_sensor = 0, user_data_body = 0;  ///< theirs; 0 of a body that was removed

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.sensor.index, s.sensor.generation, s.body.index, s.body.generation, s.began, s.user_data_sensor,
                    s.user_data_body);
  }
};

/// A joint that broke in the last step: World::set_joint_strength().
struct JointBreak {
  JointId joint{};              ///< is gone
  BodyId a{}, b{};              ///< as add_joint() took them
  std::uint64_t user_data = 0;  ///< the joint's
  Vec3 force = Vec3::Zero();    ///< that broke it: JointView::lock_force

  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.joint.index, s.joint.generation, s.a.index, s.a.generation, s.b.index, s.b.generation,
                    s.user_data, s.force);
  }
};

/// A pair of bodies that came together fast in the last step: for sounds and damage.
struct HitEvent {
  BodyId a{}, b{};
  std::uint64_t user_data_a = 0, user_data_b = 0;       ///< theirs
  Vec3 position = Vec3::Zero(), normal = Vec3::Zero();  ///< of the fastest contact, as in ContactEvent: out of b into a
  double speed = 0.0;           ///< at which they came together there: ContactEvent::approach, m/s
  Vec3 impulse = Vec3::Zero();  ///< of all their contacts on a, over the step, world, N·s
};

/// One direction in which a point of a body is to do something: PointWish of manipulation.h by BodyId.
struct BodyWish {
  BodyId body{};
  SurfacePoint at{};
  Vec3 direction = Vec3::UnitX();  ///< unit, world
  double wanted = 0.0;             ///< along it: m/s², m/s, or the world coordinate at the coming step's end, m
};

/// One direction in which a force may act on a point of a body.
struct BodyForce {
  BodyId body{};
  SurfacePoint at{};
  Vec3 direction = Vec3::UnitX();  ///< unit, world
};

/// What a joint does, as of the last step. The first `coordinates` numbers of each array count.
struct JointView {
  int coordinates = 0;
  std::array<double, 3> position{};  ///< m or rad, with full turns; see joint_constraint.h for which
  std::array<double, 3> force{};     ///< along each: limit, motor, drive and friction together, N or N·m
  Vec3 lock_force = Vec3::Zero();    ///< of the locked translations on b, world, N
  double distance_error = 0.0;       ///< of the locked freedoms, m
  double angle_error = 0.0;          ///< rad
};

/// What the constraints of all islands took in the last step.
struct ConstraintReport {
  int islands = 0, bodies = 0, rows = 0;
  int iterations = 0;    ///< the most that an island needed
  int newton_steps = 0;  ///< the same, of the contacts with friction: bounded (island_solver.h)
  /// What is left where the solver ended, of the island that is farthest from its rows' law, in units of what rows are
  /// met to (3e-9 of the arms of a contact's points, 1e-11 of those of joints and hands): at most 1 where all is met.
  /// By ContactSolver::kGame: the largest motion that a row's law still forbids in the last of the small steps, m.
  double residual = 0.0;
  StepAttempts attempts{};        ///< how many islands' steps, or parts of them, were cut or tried in another way
  IslandStatusCounts statuses{};  ///< islands by how their steps ended; of a step in parts, those of all parts
  /// Every row of every island is within its tolerance: all are kSolved. By kGame, which solves all islands as one: no
  /// force pulls, is outside its cone or is not finite; kFailed otherwise.
  bool solved = true;
  double energy_removed = 0.0;  ///< J; negative: given back (island_solver.h)
};

enum class Axes { kWorld, kBody };

/// The state of one body, for reading. Valid until the world changes.
struct BodyView {
  RigidTransform pose;                 ///< X_WB
  Vec3 velocity;                       ///< of the body origin, world, m/s
  Vec3 angular_velocity;               ///< world, rad/s
  std::span<const double> amplitudes;  ///< z, kg^½·m
  std::span<const double> rates;       ///< ż, kg^½·m/s
};

/// Where the vertices of one body go.
struct DrawTarget {
  BodyId id;
  std::span<float> positions;  ///< 3V floats of the render surface
  std::span<float> normals{};  ///< empty, or 3V floats
  /// m, ≥ 0: modes that together move no vertex by more than this are not drawn, so that a body that is far away is
  /// drawn by few (visible_displacement() of mode_selection.h); what WorldOptions::half_precision is off by is part of
  /// it. More or fewer from frame to frame show as a jump of no more than this; normals go by the vertices.
  double tolerance = 0.0;
};

class World {
 public:
  /// @param jobs must outlive the world
  explicit World(const WorldOptions& options = {}, Jobs& jobs = serial_jobs());
  ~World();
  World(World&&) noexcept;
  World& operator=(World&&) noexcept;

  // Bodies -----------------------------------------------------------------------------------------------------------
  BodyId add_body(std::shared_ptr<const ModalModel> model, const BodyPlacement& placement = {});
  /// A rigid body of a shape that bounds a solid, without a bake: rigid_model.h. `placement.pose` places its centre of
  /// mass, which need not be the shape's own origin (RigidModel); `placement.shape` is not given. Bodies that share
  /// their shape and mass share a model.
  BodyId add_rigid(const std::shared_ptr<const Shape>& shape, const MassProperties& mass,
                   const BodyPlacement& placement = {});
  /// The same, of even density. @param density kg/m³, > 0
  BodyId add_rigid(const std::shared_ptr<const Shape>& shape, double density, const BodyPlacement& placement = {});
  /// A compound of shapes that bound solids: a table, a hammer, a chair. Others meet its parts; events, queries and
  /// filters know the whole, and loads take hold of the surface of all parts. `placement.pose` places its centre of
  /// mass (RigidModel).
  BodyId add_rigid(const std::vector<ShapePart>& parts, const MassProperties& mass,
                   const BodyPlacement& placement = {});
  /// The same, of even density: what parts share counts for each. @param density kg/m³, > 0
  BodyId add_rigid(const std::vector<ShapePart>& parts, double density, const BodyPlacement& placement = {});
  /// A rigid shape that goes where it is led, whatever it meets: a lift, a door of a machine, a hand. It stands, or
  /// goes on at the velocities it is placed with, until set_kinematic_frame() tells of another way.
  /// @param shape one that bounds a solid; `placement.pose` places its own origin
  BodyId add_kinematic(const std::shared_ptr<const Shape>& shape, const BodyPlacement& placement = {});
  /// The same of a compound: a basket, a lift's cabin. `placement.pose` places the frame that its parts are told in.
  BodyId add_kinematic(const std::vector<ShapePart>& parts, const BodyPlacement& placement = {});
  /// A rigid shape that never moves: the ground, a triangle mesh, a height field. Only contains() and remove_body()
  /// take its id.
  /// @param friction as in BodyPlacement
  BodyId add_static(std::shared_ptr<const Shape> shape, const RigidTransform& pose = {},
                    const CollisionFilter& filter = {}, std::optional<double> friction = {});
  /// A convex shape that tells which bodies it overlaps and pushes none: a trigger. It overlaps what queries see and
  /// the filters of both let meet, as find_overlaps() tells, static bodies too. contains(), remove_body(), user data
  /// and the functions below take its id.
  BodyId add_sensor(std::shared_ptr<const Shape> shape, const RigidTransform& pose = {},
                    const CollisionFilter& filter = {});
  void set_sensor_pose(BodyId id, const RigidTransform& pose);  ///< from the coming step on
  /// Who came and went in the last step, by sensor and body; at most once each, whatever happened within the step.
  std::span<const SensorEvent> sensor_events() const;
  /// Who is inside, as of the last step; replaces `bodies`.
  void list_inside(BodyId sensor, std::vector<BodyId>& bodies) const;
  void remove_body(BodyId id);  ///< and with it its handles and joints
  bool contains(BodyId id) const;
  std::size_t body_count() const;
  // All there are, by index, static bodies and sensors too; these replace what is in the vector.
  void list(std::vector<BodyId>& bodies) const;
  void list(std::vector<HandleId>& handles) const;
  void list(std::vector<JointId>& joints) const;
  BodyId id_of(Index body) const;  ///< the body of an event, by its index; BodyId{}: there is none
  // A number of the caller's own, 0 at first; part of a saved state.
  void set_user_data(BodyId id, std::uint64_t data);
  void set_user_data(HandleId id, std::uint64_t data);
  void set_user_data(JointId id, std::uint64_t data);
  std::uint64_t user_data(BodyId id) const;
  std::uint64_t user_data(HandleId id) const;
  std::uint64_t user_data(JointId id) const;
  const ModalModel& model(BodyId id) const;
  BodyType body_type(BodyId id) const;
  /// Whether a body sleeps; see SleepOptions.
  bool is_asleep(BodyId id) const;
  /// Wakes a body and all that sleeps with it; one that is awake counts its time at rest anew.
  void wake(BodyId id);

  // Time -------------------------------------------------------------------------------------------------------------
  /// Adds real seconds to the accumulator and takes as many fixed steps as fit. @return steps taken.
  int advance(double real_seconds);
  /// Takes one step.
  void step();
  /// Changes the length of the steps to come, for loops whose frames vary; given before the loads of the coming step.
  /// What advance() keeps for the next step stays the same fraction of one, so that drawing goes on where it is.
  /// @param seconds > 0. @throws InvalidArgument also while an impulse waits for a later time within the coming step
  void set_step(double seconds);
  /// Fraction of a step left in the accumulator, in [0, 1): how far to draw between the last two states.
  double interpolation_factor() const;
  double time() const;  ///< s: the lengths of all steps taken
  std::uint64_t step_count() const;
  double dropped_seconds() const;  ///< real time given up by max_steps_per_advance
  const WorldOptions& options() const;
  /// From the coming step on, m/s², world. Wakes all bodies.
  void set_gravity(const Vec3& gravity);
  // Of one body, from the coming step on: rigid_frame.h. They wake it.
  void set_gravity_scale(BodyId id, double scale);  ///< finite
  /// @param linear, angular c of v̇ = … − c v and L̇ = … − c L, 1/s, ≥ 0: by e^{−ct} in a time t, whatever the step.
  /// Modes have damping of their own. @throws InvalidArgument also for a linear one of a body with fixed nodes, and by
  /// ContactSolver::kExact
  void set_damping(BodyId id, double linear, double angular);
  /// Axes of the world along which the body does not move and about which it does not turn. What is locked takes up
  /// all force, as an infinite mass would; contacts and joints reckon with it. Velocities there are lost at once.
  /// @throws InvalidArgument also for a body with fixed nodes, and by ContactSolver::kExact
  void set_locks(BodyId id, const AxisLocks& locks);
  FrameSettings frame_settings(BodyId id) const;

  // Loads, all at the deformed point ----------------------------------------------------------------------------------
  /// Held over the next step; several add up. World axes once applied: a force in body axes does not turn with the body
  /// within the step.
  void apply_force(BodyId id, const SurfacePoint& at, const Vec3& newtons, Axes axes = Axes::kWorld);
  /// Acts now, at the start of the next step: velocities change at once. @param delay seconds into the next step at
  /// which the modes get it, in [0, step): exact for the modes; the frame gets it now, or at the start of the substep.
  void apply_impulse(BodyId id, const SurfacePoint& at, const Vec3& newton_seconds, Axes axes = Axes::kWorld,
                     double delay = 0.0);
  /// Where the parent of a body with fixed nodes is at the end of the coming step. A body that is not told goes on at
  /// its parent's velocity and angular velocity without acceleration; at rest unless told otherwise.
  /// @throws InvalidArgument for a free body
  void set_kinematic_frame(BodyId id, const KinematicFrame& target);

  // Handles ----------------------------------------------------------------------------------------------------------
  /// Takes hold of a point where it is now.
  HandleId add_handle(BodyId id, const SurfacePoint& at, const HandleOptions& options = {});
  void remove_handle(HandleId id);
  bool contains(HandleId id) const;
  /// Where the point is wanted at the end of the coming step, and how it goes on from there.
  void set_handle_target(HandleId id, const HandleTarget& target);
  HandleView handle(HandleId id) const;

  // Manipulation -----------------------------------------------------------------------------------------------------
  /// Gives points accelerations, velocities or places by forces at the same or at other points, of least norm, in the
  /// least-squares sense ([H03] section 3.4.1; manipulation.h). They are loads of the coming step like those of
  /// apply_force() and apply_impulse(), and reckon with gravity and the loads given before. Handles, joints and
  /// contacts are not foreseen: they answer in the step. Allocates.
  /// @param forces where forces may act; empty: along the wishes themselves
  /// @param impulses out, one per force: N for kAcceleration, N·s else
  /// @param max_iterations of places, which are nonlinear where bodies turn; ≥ 1
  /// @throws InvalidArgument also for a direction that is not a unit vector, for kAcceleration of a body with fixed
  /// nodes, and for places in a world with substeps: its held forces would end before the step does
  ManipulationResult manipulate(std::span<const BodyWish> wishes, std::span<const BodyForce> forces,
                                std::span<double> impulses, ManipulationLevel level = ManipulationLevel::kPosition,
                                int max_iterations = 6);

  // Joints -----------------------------------------------------------------------------------------------------------
  /// Joins two bodies as they stand: the pose now is the joint's reference, all its coordinates are 0.
  /// @param a, b part b moves relative to part a; BodyId{} is the world, for one of them
  /// @param spec its frame in world axes @throws InvalidArgument if it is not valid, or a and b are the same
  /// @param collide_connected whether a and b have contacts with each other. They have none as long as any joint
  /// between
  ///   them says so: parts overlap where a hinge is
  JointId add_joint(BodyId a, BodyId b, const JointSpec& spec, const JointAttachment& on_a = {},
                    const JointAttachment& on_b = {}, bool collide_connected = false);
  void remove_joint(JointId id);
  /// Whether two bodies have no contacts with each other even where no joint keeps them from it: parts of a machine
  /// that are drawn into each other. They have contacts at first. @throws InvalidArgument if a and b are the same
  void ignore_collision(BodyId a, BodyId b, bool ignore = true);
  bool contains(JointId id) const;
  /// Motor, drive and friction of one coordinate.
  void set_joint_actuation(JointId id, int coordinate, const JointActuation& actuation);
  JointView joint(JointId id) const;
  /// Lets a joint break: at the end of a step in which JointView::lock_force is larger it is removed.
  /// @param newtons > 0; infinite, as it is at first: nothing breaks it
  void set_joint_strength(JointId id, double newtons);
  double joint_strength(JointId id) const;
  std::span<const JointBreak> joint_breaks() const;  ///< of the last step

  ConstraintReport constraint_report() const;

  /// Makes what takes the steps of islands from now on, by ContactSolver::kExact alone; empty: limber's own
  /// (make_island_solver()). Solvers keep nothing from step to step, so they are no part of the state that is saved.
  void set_island_solver(IslandSolverFactory make);

  /// What steps and reconstruct() spend on their stages from here on is added to `times`, which outlives the world or
  /// the next call; null, the default: no clock is read. The stages of a step sum to it; what many threads do at once
  /// is the wall clock's time split in the proportions of what they spent.
  void set_stage_times(StageTimes* times);

  // Contacts ---------------------------------------------------------------------------------------------------------
  /// Who finds the contacts, such as ManifoldFinder of collision/, or ContactFinder for kExact: without one, bodies
  /// pass through each other. It is not told of bodies that meet nothing: those in no layer or with an empty mask, and
  /// those without a shape whose model is not touchable. Its bodies are those of the world, numbered by BodyId::index;
  /// it must outlive the world and holds none at first. Null: none.
  /// @param options choose, too, who answers contacts, handles and joints (ContactOptions::solver)
  void set_contact_source(ContactSource* source, const ContactOptions& options = {});
  /// Asked of every contact found, before it acts: false leaves it out of the step. From the thread that calls step();
  /// empty: all act.
  void set_contact_veto(std::function<bool(const ContactPoint&)> acts);
  /// What pressed, or ceased to, in the last step; bodies by BodyId::index: id_of(). Impulses of substeps are summed.
  /// Contacts of bodies that sleep are not told; those that press when they wake go on as kLasting.
  std::span<const ContactEvent> contact_events() const;
  /// Pairs that came together in the last step, at WorldOptions::hit_speed or faster; at most one each, by a and b.
  std::span<const HitEvent> hit_events() const;
  /// What two bodies pressed each other with in the last step, all contacts together: on a, N·s, world.
  /// @throws InvalidArgument if a and b are the same
  Vec3 contact_impulse(BodyId a, BodyId b) const;
  /// Lets a body's surface run over it, as a conveyor's belt does: contacts rub against it as if they slid at so much
  /// more. Static, kinematic and dynamic bodies alike. Wakes all that sleeps.
  /// @param velocity m/s, body axes; of it, a contact feels what lies along the surface
  /// @throws InvalidArgument also by ContactSolver::kExact
  void set_surface_velocity(BodyId id, const Vec3& velocity);
  Vec3 surface_velocity(BodyId id) const;

  // State ------------------------------------------------------------------------------------------------------------
  BodyView body(BodyId id) const;
  // What is set is the state before the last step too: nothing is drawn between. Velocities as in BodyPlacement;
  // amplitudes z in kg^½·m and rates ż in kg^½·m/s, one per mode.
  void set_pose(BodyId id, const RigidTransform& pose);
  void set_velocity(BodyId id, const Vec3& velocity, const Vec3& angular_velocity);
  void set_amplitudes(BodyId id, std::span<const double> amplitudes, std::span<const double> rates);
  /// Displacements (m) and velocities (m/s) of all nodes, body frame, 3 per node: z₀ = WᵀM d₀. What no kept mode can
  /// show is lost.
  /// @throws InvalidArgument if the asset has no `volume` block (bake with --volume)
  void set_node_displacements(BodyId id, std::span<const double> displacements, std::span<const double> velocities);
  /// `elastic` holds what contacts store in the residual compliance, too.
  BodyEnergy energy(BodyId id) const;
  Vec3 angular_momentum(BodyId id) const;  ///< world, about the body origin, kg·m²/s (rigid part)
  Vec3 linear_momentum(BodyId id) const;   ///< world, kg·m/s

  /// World position of a surface point, deformed by the modes: what handles hold.
  Vec3 position(BodyId id, const SurfacePoint& at) const;
  /// World velocity of a surface point, deformation included.
  Vec3 velocity(BodyId id, const SurfacePoint& at) const;
  /// The residual displacement of a surface point, world, m: G F of the last step's contact forces
  /// (residual_compliance.h), beyond the modes. Drawn surfaces show it, position() and velocity() do not. Zero where
  /// the model has no residual compliance or ContactOptions::residual_compliance is off. A point of the render surface
  /// goes with the point of the collision surface that was nearest at rest.
  Vec3 indentation(BodyId id, const SurfacePoint& at) const;

  // Queries ----------------------------------------------------------------------------------------------------------
  // Of bodies as they are now, moved and bent: limber/collision/spatial_index.h tells what each gives, and throws. They
  // need no contact source. Bodies in no layer, and those without a shape whose model is not touchable, do not answer.
  // The first query after a step brings the index up to date, O(bodies). `at` may be given to loads and handles.
  std::optional<BodyHit> cast_ray(const Ray& ray, const BodyFilter& filter = {}) const;  ///< the first place of all
  /// The first place on each body, by fraction; replaces `hits`.
  void cast_ray(const Ray& ray, std::vector<BodyHit>& hits, const BodyFilter& filter = {}) const;
  /// Where a convex shape first touches that is moved without turning.
  std::optional<BodyHit> cast_shape(const Shape& shape, const RigidTransform& pose, const Vec3& way,
                                    const BodyFilter& filter = {}) const;
  /// Bodies that a convex shape touches or lies in; replaces `bodies`.
  void find_overlaps(const Shape& shape, const RigidTransform& pose, std::vector<BodyId>& bodies,
                     const BodyFilter& filter = {}) const;
  std::optional<BodyHit> nearest_point(const Vec3& point, double max_distance, const BodyFilter& filter = {}) const;

  // Drawing ----------------------------------------------------------------------------------------------------------
  /// Deformed render surfaces, residual displacement included, less `origin` (pass a point near the camera far from the
  /// world's origin). Instances of one model are made together: their basis is read once, so one call for all that is
  /// drawn is faster than one for each.
  /// @param interpolation s in [0, 1] between the last two states; 1: the newest.
  void reconstruct(std::span<const DrawTarget> targets, double interpolation = 1.0,
                   const Vec3& origin = Vec3::Zero()) const;
  /// The same for one body.
  void reconstruct(BodyId id, std::span<float> positions, std::span<float> normals, double interpolation = 1.0,
                   const Vec3& origin = Vec3::Zero()) const;

  /// For a caller that deforms on its GPU: pose and modes between the last two states. The rotation between them is the
  /// shortest one: a body that turns by more than half a turn in a step is better drawn at its states.
  RigidTransform interpolated_pose(BodyId id, double interpolation) const;
  /// z, kg^½·m, one per mode: vertex v is rest_v + Σ z_i shape_i,v, with the shapes of ModalModel::render(), unless the
  /// body bends by its modal skin.
  void interpolated_amplitudes(BodyId id, double interpolation, std::span<float> amplitudes) const;
  /// z_i/s_i, one per mode: weights of the morph targets of the asset (docs/formats/asset.md), as a glTF viewer takes
  /// them. Base and targets, weighted and moved by the pose, are what reconstruct() draws, but for indentations and of
  /// bodies without a modal skin.
  void interpolated_weights(BodyId id, double interpolation, std::span<float> weights) const;
  /// Whether the body bends by its model's modal skin.
  bool has_modal_skin(BodyId id) const;
  /// Its handles, 18 numbers each (SkinPose::numbers), for the formula of limber/model/skin_pose.h.
  /// @throws InvalidArgument for a body without a skin
  void interpolated_handles(BodyId id, double interpolation, std::span<float> numbers) const;

  /// Hash of the whole state, for determinism checks: two worlds with the same calls behind them have the same, for any
  /// Jobs. It covers what the next step depends on: time, poses, momenta, amplitudes and rates, targets of handles,
  /// coordinates of joints, what contacts remember (their forces, by id), who sleeps and how long the others have been
  /// at rest. set_pose(), set_velocity() and set_amplitudes() set a body's own state alone: a body put back to where it
  /// was meets contacts that remember other forces, and friction that was held starts anew: see save_state().
  std::uint64_t state_hash() const;

  // Rollback ---------------------------------------------------------------------------------------------------------
  /// Replaces `state` by all that coming steps depend on: bodies, loads that wait, handles, joints and their actuation,
  /// what contacts remember, who sleeps, gravity, the step, contact options, time; and the last two states for drawing.
  /// A world that is restored goes on as it did then, bit for bit, with the same calls. Allocates nothing where `state`
  /// has room, as after saving a world like this before.
  ///
  /// The bytes are for worlds with the same bodies in builds of the same version of limber and machines of the same
  /// byte order: keep them in memory or send them to another player, but do not store them for later versions.
  void save_state(std::vector<std::byte>& state) const;
  /// Goes back to a saved state. Bodies added since are removed, handles and joints made since are too, and those
  /// removed since are there again: ids mean what they meant. Ids given since may be given again.
  /// Not part of a state: the Jobs, the contact source and the veto, and constraint_report(), which stays that of the
  /// last step taken.
  /// @throws InvalidArgument, and changes nothing, for bytes that are damaged or of another version, for
  /// substeps other than this world's, a body that was removed since or is another one now, and a contact source where
  /// there was none or none where there was one
  void restore_state(std::span<const std::byte> state);

 private:
  struct Impl;
  Index require_sensor(BodyId id, const char* function) const;
  void set_frame_settings(BodyId id, const FrameSettings& settings, const char* function);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limber
