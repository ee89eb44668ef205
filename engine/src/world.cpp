#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "argument_checks.h"
#include "limber/core/error.h"
#include "world_impl.h"

namespace limber {
namespace {

using Entry = internal::BodyTable::Entry;
using internal::extent_of;
using internal::require_count;
using internal::require_finite;
using internal::require_pose;

double checked(std::optional<double> friction, ContactSolver solver, const char* function) {
  constexpr double kNotGiven = -1.0;
  const bool may_be_infinite = solver == ContactSolver::kGame;
  if (friction && !(*friction >= 0.0 && (may_be_infinite || std::isfinite(*friction))))
    throw InvalidArgument(std::string("World::") + function + ": friction is " + std::to_string(*friction) +
                          ", expected at least 0, and finite but for ContactSolver::kGame");
  return friction.value_or(kNotGiven);
}

const FrameSettings& settings_of(const internal::BodyTable& bodies, BodyId id, const char* function) {
  const Entry& e = bodies.entry(id, function);
  return bodies.group(e).frame(e.slot).settings();
}

/// @param motion of the body's model
void check(const FrameSettings& settings, FrameMotion motion, ContactSolver solver, const char* function) {
  settings.validate();
  const std::string in = std::string("World::") + function + ": ";
  if (motion != FrameMotion::kFree && (settings.linear_damping > 0.0 || settings.locks.any()))
    throw InvalidArgument(in + "the body has fixed nodes, expected no linear damping and no locked axes");
  if (solver == ContactSolver::kExact && settings.alter_free_motion())
    throw InvalidArgument(in + "damping and locked axes are for ContactSolver::kGame");
}

void check_restitution(double restitution, ContactSolver solver) {
  const double most = solver == ContactSolver::kGame ? 1.0 : 0.0;
  if (!(restitution >= 0.0 && restitution <= most))
    throw InvalidArgument("World::add_body: restitution is " + std::to_string(restitution) +
                          ", expected 0 to 1, and 0 but for ContactSolver::kGame");
}

/// @param contacts whether the world has them
void require_flight(const ModalModel& model, const BodyPlacement& placement, bool skinned, bool contacts) {
  const auto refuse = [&](const std::string& why) {
    throw InvalidArgument("World::add_body: \"" + model.name() + "\" cannot have inertial coupling: " + why);
  };
  if (model.data().motion != FrameMotion::kFree) refuse("it has fixed nodes, expected a free body");
  if (model.modes() > 0 && !model.data().volume_block) refuse("it has no volume block; bake it with --volume");
  if (placement.frame.alter_free_motion()) refuse("it has damping or locked axes, expected none");
  if (skinned) refuse("it bends by its modal skin; set modal_skin = false");
  const CollisionFilter& filter = placement.filter;
  if (contacts && (filter.self || (filter.layers != 0 && filter.mask != 0)))
    refuse("it may meet others, expected a filter whose mask is 0");
}

}  // namespace

void SleepOptions::validate() const {
  const auto number = [](double value, const char* name) {
    if (!(value >= 0.0 && std::isfinite(value)))
      throw InvalidArgument(std::string("SleepOptions: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number of at least 0");
  };
  number(time, "time");
  number(speed, "speed");
}

void WorldOptions::validate() const {
  if (!(step > 0.0 && step <= 1e100))
    throw InvalidArgument("WorldOptions: step is " + std::to_string(step) + " s, expected more than 0, at most 1e100");
  if (!gravity.allFinite()) throw InvalidArgument("WorldOptions: gravity is not finite");
  if (max_steps_per_advance < 1)
    throw InvalidArgument("WorldOptions: max_steps_per_advance is " + std::to_string(max_steps_per_advance) +
                          ", expected at least 1");
  if (substeps < 1)
    throw InvalidArgument("WorldOptions: substeps is " + std::to_string(substeps) + ", expected at least 1");
  if (!(hit_speed >= 0.0))
    throw InvalidArgument("WorldOptions: hit_speed is " + std::to_string(hit_speed) + " m/s, expected at least 0");
  sleep.validate();
}

World::World(const WorldOptions& options, Jobs& jobs) {
  options.validate();
  impl_ = std::make_unique<Impl>(options, jobs);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

// Bodies --------------------------------------------------------------------------------------------------------------

BodyId World::add_body(std::shared_ptr<const ModalModel> model, const BodyPlacement& placement) {
  return impl_->add_moving(std::move(model), placement, {});
}

BodyId World::Impl::add_moving(std::shared_ptr<const ModalModel> model, const BodyPlacement& placement,
                               std::span<const ShapePart> shown_parts) {
  if (!model) throw InvalidArgument("World::add_body: the model is null");
  require_pose(placement.pose, "add_body");
  require_finite(placement.velocity, "add_body", "velocity");
  require_finite(placement.angular_velocity, "add_body", "angular velocity");
  const double friction = checked(placement.friction, paths.solver, "add_body");
  check(placement.frame, model->data().motion, paths.solver, "add_body");
  check_restitution(placement.restitution, paths.solver);
  if (placement.shape) {
    validate(*placement.shape);
    if (std::holds_alternative<HalfSpace>(*placement.shape))
      throw InvalidArgument("World::add_body: the shape is a half-space, expected one that ends");
  }
  const internal::ShapeExtent extent = !shown_parts.empty() ? extent_of(shown_parts)
                                       : placement.shape    ? extent_of(*placement.shape)
                                                            : extent_of(*model);
  const bool skinned = placement.modal_skin && model->data().skin.has_value();
  if (placement.inertial_coupling) require_flight(*model, placement, skinned, paths.registry.source() != nullptr);
  const Index group = bodies.group_of(std::move(model), parts.length());
  BodyGroup& alike = *bodies.model_group(group).bodies;
  const Index slot = alike.add(placement.pose, placement.velocity, placement.angular_velocity, skinned);
  alike.set_frame_settings(slot, placement.frame);
  alike.set_velocity(slot, placement.velocity, placement.angular_velocity);
  if (placement.inertial_coupling) alike.couple(slot);
  const BodyId id = bodies.add({.group = group,
                                .slot = slot,
                                .shape = placement.shape,
                                .filter = placement.filter,
                                .friction = friction,
                                .restitution = placement.restitution,
                                .extent = extent,
                                .user_data = placement.user_data});
  const auto index = static_cast<Index>(id.index);
  constraints.set_body(index, {.group = &alike, .slot = slot});
  sleep.add(index);
  for (const ShapePart& part : shown_parts) add_part(index, part);
  paths.registry.add_body(index);
  paths.registry.keep_parts_apart(index);
  probes.queries.tell_changed();
  return id;
}

BodyId World::add_rigid(const std::shared_ptr<const Shape>& shape, const MassProperties& mass,
                        const BodyPlacement& placement) {
  if (placement.shape) throw InvalidArgument("World::add_rigid: placement.shape is given, expected none");
  const RigidModel rigid = impl_->rigid.get(shape, mass);
  BodyPlacement placed = placement;
  placed.shape = rigid.shape;
  return add_body(rigid.model, placed);
}

BodyId World::add_rigid(const std::shared_ptr<const Shape>& shape, double density, const BodyPlacement& placement) {
  if (!shape) throw InvalidArgument("World::add_rigid: the shape is null");
  return add_rigid(shape, mass_properties(*shape, density), placement);
}

BodyId World::add_rigid(const std::vector<ShapePart>& parts, const MassProperties& mass,
                        const BodyPlacement& placement) {
  if (placement.shape) throw InvalidArgument("World::add_rigid: placement.shape is given, expected none");
  const RigidModel rigid = impl_->rigid.get(parts, mass);
  return impl_->add_moving(rigid.model, placement, rigid.parts);
}

BodyId World::add_rigid(const std::vector<ShapePart>& parts, double density, const BodyPlacement& placement) {
  return add_rigid(parts, mass_properties(parts, density), placement);
}

void World::Impl::add_part(Index body, const ShapePart& part) {
  const BodyId id =
      bodies.add({.group = -1, .shape = part.shape, .pose = part.pose, .filter = bodies[body].filter, .whole = body});
  const auto entry = static_cast<Index>(id.index);
  bodies[body].parts.push_back(entry);
  constraints.set_body(entry, {.pose = bodies.standing_pose(bodies[entry])});
  sleep.add(entry);
  paths.registry.add_body(entry);
  probes.queries.tell_changed();
}

BodyId World::add_kinematic(const std::shared_ptr<const Shape>& shape, const BodyPlacement& placement) {
  if (placement.shape) throw InvalidArgument("World::add_kinematic: placement.shape is given, expected none");
  BodyPlacement placed = placement;
  placed.shape = shape;
  return add_body(impl_->rigid.get_kinematic(shape).model, placed);
}

BodyId World::add_kinematic(const std::vector<ShapePart>& parts, const BodyPlacement& placement) {
  if (placement.shape) throw InvalidArgument("World::add_kinematic: placement.shape is given, expected none");
  const RigidModel led = impl_->rigid.get_kinematic(parts);
  return impl_->add_moving(led.model, placement, led.parts);
}

BodyType World::body_type(BodyId id) const {
  const Entry& e = impl_->bodies.any_entry(id, "body_type");
  if (e.group < 0) return BodyType::kStatic;
  const bool led = impl_->bodies.group(e).frame_constants().motion == FrameMotion::kKinematic;
  return led ? BodyType::kKinematic : BodyType::kDynamic;
}

BodyId World::add_sensor(std::shared_ptr<const Shape> shape, const RigidTransform& pose,
                         const CollisionFilter& filter) {
  if (!shape) throw InvalidArgument("World::add_sensor: the shape is null");
  if (!SpatialIndex::may_ask(*shape))
    throw InvalidArgument("World::add_sensor: the shape is not convex, expected a sphere, capsule, box or hull");
  const BodyId id = add_static(std::move(shape), pose, {.layers = 0, .mask = 0});
  Entry& e = impl_->bodies[static_cast<Index>(id.index)];
  e.sensor = true;
  e.filter = filter;
  impl_->probes.sensors.add(static_cast<Index>(id.index));
  return id;
}

void World::set_sensor_pose(BodyId id, const RigidTransform& pose) {
  require_pose(pose, "set_sensor_pose");
  impl_->bodies[require_sensor(id, "set_sensor_pose")].pose = pose;
}

Index World::require_sensor(BodyId id, const char* function) const {
  if (!impl_->bodies.any_entry(id, function).sensor)
    throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) + " is no sensor");
  return static_cast<Index>(id.index);
}

std::span<const SensorEvent> World::sensor_events() const { return impl_->probes.sensors.events(); }
void World::list_inside(BodyId sensor, std::vector<BodyId>& bodies) const {
  impl_->probes.sensors.list(require_sensor(sensor, "list_inside"), bodies);
}

BodyId World::add_static(std::shared_ptr<const Shape> shape, const RigidTransform& pose, const CollisionFilter& filter,
                         std::optional<double> friction) {
  if (!shape) throw InvalidArgument("World::add_static: the shape is null");
  validate(*shape);
  require_pose(pose, "add_static");
  const double mu = checked(friction, impl_->paths.solver, "add_static");
  Impl& m = *impl_;
  const BodyId id =
      m.bodies.add({.group = -1, .shape = std::move(shape), .pose = pose, .filter = filter, .friction = mu});
  const auto index = static_cast<Index>(id.index);
  m.constraints.set_body(index, {.pose = pose});
  m.sleep.add(index);
  m.paths.registry.add_body(index);
  m.probes.queries.tell_changed();
  return id;
}

void World::remove_body(BodyId id) {
  Impl& m = *impl_;
  if (!m.bodies.contains(id)) m.bodies.entry(id, "remove_body");  // tells so
  const std::vector<Index> parts = m.bodies[static_cast<Index>(id.index)].parts;
  for (const Index part : parts) m.remove(part);
  m.remove(static_cast<Index>(id.index));
}

void World::Impl::remove(Index entry) {
  sleep.remove(entry);
  probes.sensors.remove(entry);
  parts.forget(entry);
  paths.registry.remove_body(entry);
  constraints.remove_body(entry);
  paths.in_force().forget(entry);
  drawing.forget(entry);
  bodies.remove({static_cast<std::uint32_t>(entry), bodies[entry].generation});
  probes.queries.tell_changed();
}

void World::list(std::vector<BodyId>& bodies) const {
  bodies.clear();
  for (std::size_t i = 0; i < impl_->bodies.size(); ++i)
    if (const Entry& e = impl_->bodies[static_cast<Index>(i)]; e.alive && e.whole < 0)
      bodies.push_back(impl_->bodies.id(static_cast<Index>(i)));
}
BodyId World::id_of(Index body) const {
  if (body < 0 || static_cast<std::size_t>(body) >= impl_->bodies.size() || !impl_->bodies[body].alive) return {};
  return impl_->bodies.id(body);
}
void World::set_user_data(BodyId id, std::uint64_t data) {
  impl_->bodies.any_entry(id, "set_user_data");
  impl_->bodies[static_cast<Index>(id.index)].user_data = data;
}
std::uint64_t World::user_data(BodyId id) const { return impl_->bodies.any_entry(id, "user_data").user_data; }

bool World::contains(BodyId id) const { return impl_->bodies.contains(id); }
std::size_t World::body_count() const { return impl_->bodies.count(); }
const ModalModel& World::model(BodyId id) const {
  return impl_->bodies.group(impl_->bodies.entry(id, "model")).model();
}

// Time ----------------------------------------------------------------------------------------------------------------

int World::advance(double real_seconds) {
  if (!(real_seconds >= 0.0 && std::isfinite(real_seconds)))
    throw InvalidArgument("World::advance: real_seconds is " + std::to_string(real_seconds) +
                          ", expected a finite number of at least 0");
  Impl& m = *impl_;
  const int steps = m.time.take(real_seconds, m.options.step, m.options.max_steps_per_advance);
  for (int i = 0; i < steps; ++i) step();
  return steps;
}

void World::step() {
  Impl& m = *impl_;
  StageClock clock(m.last.times);
  m.last.report = {};
  m.drawing.keep_indentations(m.paths.in_force());
  if (m.paths.registry.source() != nullptr) m.last.events.begin();
  for (int part = 0; part < m.parts.count(); ++part) {
    m.bodies.set_within_step(part > 0);
    m.parts.begin(part);
    clock.lap(Stage::kBookkeeping);
    const internal::Substep substep{.index = part, .length = m.parts.length(), .gravity = m.options.gravity};
    m.paths.in_force().advance(substep, m.last.events, m.jobs, clock);
    m.add_to_report(m.paths.in_force().report());
  }
  m.parts.finish();
  m.last.breaks.find(m.constraints, m.bodies);
  for (const JointBreak& broken : m.last.breaks.events()) m.remove_joint(broken.joint.index);
  m.probes.queries.tell_changed();
  m.probes.sensors.update();
  if (m.paths.registry.source() != nullptr) m.last.events.end();
  m.last.hits.update(contact_events(), m.options.hit_speed, m.bodies);
  if (m.options.sleep.enabled) m.sleep.update(m.options.sleep, m.options.step, contact_events());
  m.time.count_step();
  clock.lap(Stage::kBookkeeping, 1);
}

void World::Impl::add_to_report(const IslandReport& substep) {
  ConstraintReport& sum = last.report;
  sum.islands = constraints.island_count();
  sum.bodies = substep.bodies;
  sum.rows = substep.rows;
  sum.energy_removed += substep.energy_removed;
  sum.statuses.add(substep.statuses);
  sum.solved = sum.statuses.worst() == IslandStatus::kSolved;
  sum.iterations = std::max(sum.iterations, substep.iterations);
  sum.newton_steps = std::max(sum.newton_steps, substep.newton_steps);
  sum.residual = std::max(sum.residual, substep.change);
  sum.attempts.add(substep.attempts);
}

void World::set_stage_times(StageTimes* times) { impl_->last.times = times; }

double World::interpolation_factor() const { return impl_->time.waiting() / impl_->options.step; }

void World::set_step(double seconds) {
  Impl& m = *impl_;
  WorldOptions options = m.options;
  options.step = seconds;
  options.validate();
  if (m.parts.impulses_wait() || m.bodies.impulses_wait())
    throw InvalidArgument("World::set_step: an impulse with a delay waits for the coming step; set the step first");
  m.time.change_step(m.options.step, seconds);
  m.options.step = seconds;
  m.parts.set_step(seconds);
  m.bodies.set_step_length(m.parts.length());
}

double World::time() const { return impl_->time.seconds(impl_->options.step); }
std::uint64_t World::step_count() const { return impl_->time.steps(); }
double World::dropped_seconds() const { return impl_->time.dropped(); }
const WorldOptions& World::options() const { return impl_->options; }

void World::set_gravity(const Vec3& gravity) {
  require_finite(gravity, "set_gravity", "gravity");
  impl_->sleep.wake_all();
  impl_->options.gravity = gravity;
}

FrameSettings World::frame_settings(BodyId id) const { return settings_of(impl_->bodies, id, "frame_settings"); }

void World::set_frame_settings(BodyId id, const FrameSettings& settings, const char* function) {
  const Entry& e = impl_->bodies.entry(id, function);
  BodyGroup& group = impl_->bodies.group(e);
  check(settings, group.frame_constants().motion, impl_->paths.solver, function);
  if (group.coupled(e.slot) && settings.alter_free_motion())
    throw InvalidArgument(std::string("World::") + function + ": the body has inertial coupling, expected one without");
  const auto body = static_cast<Index>(id.index);
  impl_->sleep.wake(body);
  group.set_frame_settings(e.slot, settings);
  impl_->constraints.disturb(body);
}

void World::set_gravity_scale(BodyId id, double scale) {
  FrameSettings settings = settings_of(impl_->bodies, id, "set_gravity_scale");
  settings.gravity_scale = scale;
  set_frame_settings(id, settings, "set_gravity_scale");
}

void World::set_damping(BodyId id, double linear, double angular) {
  FrameSettings settings = settings_of(impl_->bodies, id, "set_damping");
  settings.linear_damping = linear;
  settings.angular_damping = angular;
  set_frame_settings(id, settings, "set_damping");
}

void World::set_locks(BodyId id, const AxisLocks& locks) {
  FrameSettings settings = settings_of(impl_->bodies, id, "set_locks");
  settings.locks = locks;
  set_frame_settings(id, settings, "set_locks");
}

// Loads ---------------------------------------------------------------------------------------------------------------

void World::apply_force(BodyId id, const SurfacePoint& at, const Vec3& newtons, Axes axes) {
  const Entry& e = impl_->bodies.entry(id, "apply_force");
  BodyGroup& group = impl_->bodies.group(e);
  validate(group.model(), at);
  require_finite(newtons, "apply_force", "the force");
  const Vec3 force_W = axes == Axes::kWorld ? newtons : group.frame(e.slot).pose().q * newtons;
  impl_->sleep.wake(static_cast<Index>(id.index));
  group.apply_force(e.slot, at, force_W);
  impl_->parts.hold_force(static_cast<Index>(id.index), at, force_W);
}

void World::apply_impulse(BodyId id, const SurfacePoint& at, const Vec3& newton_seconds, Axes axes, double delay) {
  const Entry& e = impl_->bodies.entry(id, "apply_impulse");
  BodyGroup& group = impl_->bodies.group(e);
  validate(group.model(), at);
  require_finite(newton_seconds, "apply_impulse", "the impulse");
  if (!(delay >= 0.0 && delay < impl_->options.step))
    throw InvalidArgument("World::apply_impulse: delay is " + std::to_string(delay) +
                          " s, expected from 0 to less than " + std::to_string(impl_->options.step));
  const Vec3 impulse_W = axes == Axes::kWorld ? newton_seconds : group.frame(e.slot).pose().q * newton_seconds;
  const auto body = static_cast<Index>(id.index);
  impl_->sleep.wake(body);
  if (!impl_->parts.keep_impulse(body, at, impulse_W, delay)) return;
  group.apply_impulse(e.slot, at, impulse_W, delay);
  impl_->constraints.disturb(body);
}

void World::set_kinematic_frame(BodyId id, const KinematicFrame& target) {
  const Entry& e = impl_->bodies.entry(id, "set_kinematic_frame");
  BodyGroup& group = impl_->bodies.group(e);
  if (group.frame_constants().motion == FrameMotion::kFree)
    throw InvalidArgument("World::set_kinematic_frame: body " + std::to_string(id.index) + " (\"" +
                          group.model().name() +
                          "\") has no fixed nodes and moves freely; use set_pose and set_velocity");
  require_pose(target.pose, "set_kinematic_frame");
  require_finite(target.velocity, "set_kinematic_frame", "velocity");
  require_finite(target.acceleration, "set_kinematic_frame", "acceleration");
  require_finite(target.angular_velocity, "set_kinematic_frame", "angular velocity");
  require_finite(target.angular_acceleration, "set_kinematic_frame", "angular acceleration");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->parts.lead(static_cast<Index>(id.index), target);
}

}  // namespace limber
