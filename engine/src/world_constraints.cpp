#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "argument_checks.h"
#include "limber/core/error.h"
#include "world_impl.h"

namespace limber {
namespace {

using internal::BodyTable;
using internal::ConstraintStage;
using internal::require_finite;
using internal::SleepStage;
using Entry = BodyTable::Entry;

/// The constraint that an id names, if it is of the kind asked for.
template <class Id>
const ConstraintStage::Entry* find(const ConstraintStage& constraints, Id id) {
  if (id.index >= constraints.entries().size()) return nullptr;
  const ConstraintStage::Entry& e = constraints.entries()[id.index];
  const bool kind = std::is_same_v<Id, HandleId> ? e.handle != nullptr : e.joint != nullptr;
  return kind && e.generation == id.generation ? &e : nullptr;
}

template <class Id>
const ConstraintStage::Entry& named(const ConstraintStage& constraints, Id id, const char* function) {
  if (const ConstraintStage::Entry* found = find(constraints, id)) return *found;
  throw InvalidArgument(std::string("World::") + function + ": " +
                        (std::is_same_v<Id, HandleId> ? "handle " : "joint ") + std::to_string(id.index) +
                        " (generation " + std::to_string(id.generation) +
                        ") does not exist; it was removed, with its body or by itself, or belongs to another world");
}

template <class Id>
void list_of(const ConstraintStage& constraints, std::vector<Id>& ids) {
  ids.clear();
  for (std::size_t i = 0; i < constraints.entries().size(); ++i) {
    const Id id{static_cast<std::uint32_t>(i), constraints.entries()[i].generation};
    if (find(constraints, id) != nullptr) ids.push_back(id);
  }
}

/// The joint's frame on one part, as it stands.
MaterialFrame joint_side(const BodyTable& bodies, BodyId id, const JointFrame& in_world, const JointAttachment& on) {
  if (id == BodyId{}) return MaterialFrame(in_world);
  const Entry& e = bodies.entry(id, "add_joint");
  const BodyGroup& group = bodies.group(e);
  const ModalModel& model = group.model();
  const RigidTransform X_BW = group.frame(e.slot).pose().inverse();
  const JointFrame in_body{.origin = X_BW * in_world.origin, .axes = to_matrix(X_BW.q) * in_world.axes};
  const auto body = static_cast<Index>(id.index);
  if (model.modes() == 0) return {body, in_body};
  const bool skinned = group.skinned(e.slot);
  if (!on.patch.empty()) return {body, model, on.patch, in_body, skinned};
  return {body, model, patch_around(model, on.surface, in_body.origin, on.radius), in_body, skinned};
}

void require_uncoupled(const internal::BodyTable& bodies, const Entry& e, const char* function) {
  if (bodies.coupled(e))
    throw InvalidArgument(std::string("World::") + function + ": a body of \"" + bodies.group(e).model().name() +
                          "\" has inertial coupling, expected one without: such bodies fly freely");
}

void wake_bodies_of(const Constraint& constraint, SleepStage& sleep) {
  for (const Index body : constraint.bodies())
    if (body >= 0) sleep.wake(body);
}

}  // namespace

HandleId World::add_handle(BodyId id, const SurfacePoint& at, const HandleOptions& options) {
  const Entry& e = impl_->bodies.entry(id, "add_handle");
  const ModalModel& model = impl_->bodies.group(e).model();
  validate(model, at);
  require_uncoupled(impl_->bodies, e, "add_handle");
  auto made = std::make_unique<Handle>(
      MaterialFrame(static_cast<Index>(id.index), model, at, impl_->bodies.group(e).skinned(e.slot)),
      impl_->bodies.group(e).position(e.slot, at), options);
  const std::uint32_t index = impl_->constraints.add(std::move(made));
  wake_bodies_of(*impl_->constraints.entries()[index].constraint(), impl_->sleep);
  return {index, impl_->constraints.entries()[index].generation};
}

void World::remove_handle(HandleId id) {
  named(impl_->constraints, id, "remove_handle");
  wake_bodies_of(*impl_->constraints.entries()[id.index].constraint(), impl_->sleep);
  impl_->constraints.remove(id.index);
}

void World::set_user_data(HandleId id, std::uint64_t data) {
  named(impl_->constraints, id, "set_user_data");
  impl_->constraints.set_user_data(id.index, data);
}
void World::set_user_data(JointId id, std::uint64_t data) {
  named(impl_->constraints, id, "set_user_data");
  impl_->constraints.set_user_data(id.index, data);
}
std::uint64_t World::user_data(HandleId id) const { return named(impl_->constraints, id, "user_data").user_data; }
std::uint64_t World::user_data(JointId id) const { return named(impl_->constraints, id, "user_data").user_data; }
void World::list(std::vector<HandleId>& handles) const { list_of(impl_->constraints, handles); }
void World::list(std::vector<JointId>& joints) const { list_of(impl_->constraints, joints); }

bool World::contains(HandleId id) const { return find(impl_->constraints, id) != nullptr; }

void World::set_handle_target(HandleId id, const HandleTarget& target) {
  const ConstraintStage::Entry& e = named(impl_->constraints, id, "set_handle_target");
  require_finite(target.position, "set_handle_target", "position");
  require_finite(target.velocity, "set_handle_target", "velocity");
  wake_bodies_of(*impl_->constraints.entries()[id.index].constraint(), impl_->sleep);
  e.handle->set_target(target);
}

void World::set_island_solver(IslandSolverFactory make) {
  impl_->constraints.set_island_solver(make ? std::move(make) : make_island_solver);
}

HandleView World::handle(HandleId id) const {
  const Handle& h = *named(impl_->constraints, id, "handle").handle;
  return {.target = h.target(), .force = h.force(), .work = h.work(), .error = h.error(impl_->constraints.states())};
}

ManipulationResult World::manipulate(std::span<const BodyWish> wishes, std::span<const BodyForce> forces,
                                     std::span<double> impulses, ManipulationLevel level, int max_iterations) {
  const bool places = level == ManipulationLevel::kPosition || level == ManipulationLevel::kPositionImpulse;
  if (places && impl_->options.substeps > 1)
    throw InvalidArgument("World::manipulate: places are wanted in a world of " +
                          std::to_string(impl_->options.substeps) + " substeps, expected 1; use handles");
  const auto frame = [&](BodyId id, const SurfacePoint& at) -> MaterialFrame {
    const Entry& e = impl_->bodies.entry(id, "manipulate");
    const ModalModel& model = impl_->bodies.group(e).model();
    validate(model, at);
    require_uncoupled(impl_->bodies, e, "manipulate");
    return {static_cast<Index>(id.index), model, at, impl_->bodies.group(e).skinned(e.slot)};
  };
  std::vector<PointWish> wanted;
  for (const BodyWish& wish : wishes) wanted.push_back({frame(wish.body, wish.at), wish.direction, wish.wanted});
  std::vector<PointForce> acting;
  for (const BodyForce& force : forces) acting.push_back({frame(force.body, force.at), force.direction});
  const ManipulationResult result =
      limber::manipulate(impl_->constraints.table(), wanted, acting, impulses,
                         {.level = level, .gravity = impl_->options.gravity, .max_iterations = max_iterations});
  const auto act = [&](std::size_t i, BodyId id, const SurfacePoint& at, const Vec3& direction) {
    const auto body = static_cast<Index>(id.index);
    impl_->sleep.wake(body);
    if (level == ManipulationLevel::kAcceleration)
      impl_->parts.hold_force(body, at, impulses[i] * direction);
    else if (level != ManipulationLevel::kPosition)
      impl_->constraints.disturb(body);
  };
  for (std::size_t i = 0; i < forces.size(); ++i) act(i, forces[i].body, forces[i].at, forces[i].direction);
  for (std::size_t i = 0; forces.empty() && i < wishes.size(); ++i)
    act(i, wishes[i].body, wishes[i].at, wishes[i].direction);
  return result;
}

JointId World::add_joint(BodyId a, BodyId b, const JointSpec& spec, const JointAttachment& on_a,
                         const JointAttachment& on_b, bool collide_connected) {
  spec.validate();
  if (a == b) throw InvalidArgument("World::add_joint: both parts are the same");
  for (const JointAttachment* on : {&on_a, &on_b})
    if (!(on->radius >= 0.0 && std::isfinite(on->radius)))
      throw InvalidArgument("World::add_joint: the attachment's radius is " + std::to_string(on->radius) +
                            " m, expected a finite number of at least 0");
  for (const BodyId id : {a, b})
    if (id != BodyId{}) require_uncoupled(impl_->bodies, impl_->bodies.any_entry(id, "add_joint"), "add_joint");
  auto made = std::make_unique<JointConstraint>(joint_side(impl_->bodies, a, spec.frame, on_a),
                                                joint_side(impl_->bodies, b, spec.frame, on_b), spec);
  const std::uint32_t index = impl_->constraints.add(std::move(made));
  wake_bodies_of(*impl_->constraints.entries()[index].constraint(), impl_->sleep);
  const bool two = a != BodyId{} && b != BodyId{};
  if (two && !collide_connected)
    impl_->paths.registry.exclude_for_joint(static_cast<Index>(std::min(a.index, b.index)),
                                            static_cast<Index>(std::max(a.index, b.index)), index);
  return {index, impl_->constraints.entries()[index].generation};
}

void World::remove_joint(JointId id) {
  named(impl_->constraints, id, "remove_joint");
  impl_->remove_joint(id.index);
}

void World::Impl::remove_joint(std::uint32_t place) {
  wake_bodies_of(*constraints.entries()[place].constraint(), sleep);
  paths.registry.include_after_joint(place);
  constraints.remove(place);
}

void World::set_joint_strength(JointId id, double newtons) {
  named(impl_->constraints, id, "set_joint_strength");
  if (!(newtons > 0.0))
    throw InvalidArgument("World::set_joint_strength: the strength is " + std::to_string(newtons) +
                          " N, expected more than 0");
  impl_->constraints.set_strength(id.index, newtons);
}
double World::joint_strength(JointId id) const { return named(impl_->constraints, id, "joint_strength").strength; }
std::span<const JointBreak> World::joint_breaks() const { return impl_->last.breaks.events(); }

void World::ignore_collision(BodyId a, BodyId b, bool ignore) {
  Impl& m = *impl_;
  m.bodies.entry(a, "ignore_collision"), m.bodies.entry(b, "ignore_collision");
  if (a == b) throw InvalidArgument("World::ignore_collision: both bodies are the same");
  const auto [first, second] = std::minmax({static_cast<Index>(a.index), static_cast<Index>(b.index)});
  if (!m.paths.registry.set_excluded(first, second, ignore)) return;
  m.sleep.wake(first), m.sleep.wake(second);
}

bool World::contains(JointId id) const { return find(impl_->constraints, id) != nullptr; }

void World::set_joint_actuation(JointId id, int coordinate, const JointActuation& actuation) {
  named(impl_->constraints, id, "set_joint_actuation").joint->set_actuation(coordinate, actuation);
  wake_bodies_of(*impl_->constraints.entries()[id.index].constraint(), impl_->sleep);
}

JointView World::joint(JointId id) const {
  const JointConstraint& j = *named(impl_->constraints, id, "joint").joint;
  const BodyStates states = impl_->constraints.states();
  const JointConstraint::Error error = j.error(states);
  JointView view{.coordinates = j.coordinates(),
                 .lock_force = j.force(),
                 .distance_error = error.distance,
                 .angle_error = error.angle};
  for (int i = 0; i < j.coordinates(); ++i) {
    view.position[static_cast<std::size_t>(i)] = j.coordinate(i, states);
    view.force[static_cast<std::size_t>(i)] = j.coordinate_force(i);
  }
  return view;
}

ConstraintReport World::constraint_report() const { return impl_->last.report; }

void World::set_contact_source(ContactSource* source, const ContactOptions& options) {
  Impl& m = *impl_;
  const auto sticks = [](const Entry& e) { return e.alive && std::isinf(e.friction); };
  if (options.solver == ContactSolver::kExact && std::ranges::any_of(std::as_const(m.bodies).entries(), sticks))
    throw InvalidArgument("World::set_contact_source: a body has infinite friction, expected ContactSolver::kGame");
  const auto is_for_games = [&](const Entry& e) {
    const bool moves = e.alive && e.group >= 0;
    return (moves && m.bodies.group(e).frame(e.slot).settings().alter_free_motion()) ||
           (e.alive && !e.surface_velocity.isZero(0.0));
  };
  if (options.solver == ContactSolver::kExact && std::ranges::any_of(std::as_const(m.bodies).entries(), is_for_games))
    throw InvalidArgument(
        "World::set_contact_source: a body has damping, locked axes or a surface velocity, expected "
        "ContactSolver::kGame");
  const auto rebounds = [](const Entry& e) { return e.alive && e.restitution > 0.0; };
  if (options.solver == ContactSolver::kExact && std::ranges::any_of(std::as_const(m.bodies).entries(), rebounds))
    throw InvalidArgument("World::set_contact_source: a body has restitution, expected ContactSolver::kGame");
  for (const Entry& e : std::as_const(m.bodies).entries())
    if (source != nullptr && e.alive && m.bodies.shows(e)) require_uncoupled(m.bodies, e, "set_contact_source");
  m.paths.reset(options);
  m.drawing.forget_all();
  m.sleep.wake_all();
  m.paths.registry.set_source(source);
}

void World::set_contact_veto(std::function<bool(const ContactPoint&)> acts) {
  impl_->paths.registry.set_veto(std::move(acts));
  impl_->sleep.wake_all();
}

std::span<const ContactEvent> World::contact_events() const { return impl_->last.events.events(); }
std::span<const HitEvent> World::hit_events() const { return impl_->last.hits.events(); }

Vec3 World::contact_impulse(BodyId a, BodyId b) const {
  for (const BodyId id : {a, b}) impl_->bodies.any_entry(id, "contact_impulse");
  if (a == b) throw InvalidArgument("World::contact_impulse: a and b are the same body, expected two");
  const auto [first, second] = std::minmax(a.index, b.index);
  Vec3 sum = Vec3::Zero();
  for (const ContactEvent& contact : contact_events())
    if (contact.a == static_cast<Index>(first) && contact.b == static_cast<Index>(second)) sum += contact.impulse;
  return a.index == first ? sum : Vec3(-sum);
}

void World::set_surface_velocity(BodyId id, const Vec3& velocity) {
  Impl& m = *impl_;
  m.bodies.any_entry(id, "set_surface_velocity");
  require_finite(velocity, "set_surface_velocity", "velocity");
  if (m.paths.solver == ContactSolver::kExact)
    throw InvalidArgument("World::set_surface_velocity: the contact solver is kExact, expected ContactSolver::kGame");
  m.bodies[static_cast<Index>(id.index)].surface_velocity = velocity;
  m.paths.in_force().tell_surfaces();
  m.sleep.wake_all();
}

Vec3 World::surface_velocity(BodyId id) const {
  return impl_->bodies.any_entry(id, "surface_velocity").surface_velocity;
}

}  // namespace limber
