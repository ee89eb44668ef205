#include <algorithm>
#include <cmath>
#include <string>

#include "world_impl.h"

namespace limber {

using internal::ConstraintStage;
using internal::require_finite;

HandleId World::add_handle(BodyId id, const SurfacePoint& at, const HandleOptions& options) {
  const Impl::Entry& e = impl_->entry(id, "add_handle");
  const ModalModel& model = impl_->group(e).model();
  validate(model, at);
  auto made =
      std::make_unique<Handle>(MaterialFrame(static_cast<Index>(id.index), model, at, impl_->group(e).skinned(e.slot)),
                               impl_->group(e).position(e.slot, at), options);
  const std::uint32_t index = impl_->constraints.add(std::move(made));
  impl_->wake_bodies_of(index);
  return {index, impl_->constraints.entries()[index].generation};
}

void World::remove_handle(HandleId id) {
  impl_->constraint(id, "remove_handle");
  impl_->wake_bodies_of(id.index);
  impl_->constraints.remove(id.index);
}

bool World::contains(HandleId id) const { return impl_->find(id) != nullptr; }

void World::set_handle_target(HandleId id, const HandleTarget& target) {
  const ConstraintStage::Entry& e = impl_->constraint(id, "set_handle_target");
  require_finite(target.position, "set_handle_target", "position");
  require_finite(target.velocity, "set_handle_target", "velocity");
  impl_->wake_bodies_of(id.index);
  e.handle->set_target(target);
}

HandleView World::handle(HandleId id) const {
  const Handle& h = *impl_->constraint(id, "handle").handle;
  return {.target = h.target(), .force = h.force(), .error = h.error()};
}

ManipulationResult World::manipulate(std::span<const BodyWish> wishes, std::span<const BodyForce> forces,
                                     std::span<double> impulses, ManipulationLevel level, int max_iterations) {
  const bool places = level == ManipulationLevel::kPosition || level == ManipulationLevel::kPositionImpulse;
  if (places && impl_->options.substeps > 1)
    throw InvalidArgument("World::manipulate: places are wanted in a world of " +
                          std::to_string(impl_->options.substeps) + " substeps, expected 1; use handles");
  const auto frame = [&](BodyId id, const SurfacePoint& at) -> MaterialFrame {
    const Impl::Entry& e = impl_->entry(id, "manipulate");
    const ModalModel& model = impl_->group(e).model();
    validate(model, at);
    return {static_cast<Index>(id.index), model, at, impl_->group(e).skinned(e.slot)};
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
      impl_->parts->hold_force(body, at, impulses[i] * direction);
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
  auto made = std::make_unique<JointConstraint>(impl_->joint_side(a, spec.frame, on_a),
                                                impl_->joint_side(b, spec.frame, on_b), spec);
  const std::uint32_t index = impl_->constraints.add(std::move(made));
  impl_->wake_bodies_of(index);
  const bool two = a != BodyId{} && b != BodyId{};
  if (two && !collide_connected)
    impl_->keep_apart(static_cast<Index>(std::min(a.index, b.index)), static_cast<Index>(std::max(a.index, b.index)),
                      index);
  return {index, impl_->constraints.entries()[index].generation};
}

void World::remove_joint(JointId id) {
  impl_->constraint(id, "remove_joint");
  impl_->wake_bodies_of(id.index);
  impl_->let_meet(id.index);
  impl_->constraints.remove(id.index);
}

void World::set_apart(BodyId a, BodyId b, bool apart) {
  impl_->entry(a, "set_apart"), impl_->entry(b, "set_apart");
  if (a == b) throw InvalidArgument("World::set_apart: both bodies are the same");
  const Impl::Apart pair{.a = static_cast<Index>(std::min(a.index, b.index)),
                         .b = static_cast<Index>(std::max(a.index, b.index)),
                         .joint = Impl::Apart::kNoJoint};
  const auto found = std::find(impl_->apart.begin(), impl_->apart.end(), pair);
  if (apart == (found != impl_->apart.end())) return;
  if (apart)
    impl_->keep_apart(pair.a, pair.b, pair.joint);
  else
    impl_->let_meet(found);
  impl_->sleep.wake(pair.a), impl_->sleep.wake(pair.b);
}

bool World::contains(JointId id) const { return impl_->find(id) != nullptr; }

void World::set_joint_actuation(JointId id, int coordinate, const JointActuation& actuation) {
  impl_->constraint(id, "set_joint_actuation").joint->set_actuation(coordinate, actuation);
  impl_->wake_bodies_of(id.index);
}

JointView World::joint(JointId id) const {
  const JointConstraint& j = *impl_->constraint(id, "joint").joint;
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

ConstraintReport World::constraint_report() const {
  const IslandReport r = impl_->constraints.report();
  return {.islands = impl_->constraints.island_count(),
          .bodies = r.bodies,
          .rows = r.rows,
          .iterations = impl_->iterations,
          .newton_steps = impl_->newton_steps,
          .residual = impl_->residual,
          .programs = impl_->programs,
          .attempts = impl_->attempts,
          .solved = impl_->solved,
          .energy_removed = impl_->energy_removed};
}

void World::set_contact_source(ContactSource* source, const ContactOptions& options) {
  ContactSet contacts(options);
  impl_->constraints.set_contacts({});
  impl_->contacts = std::move(contacts);
  impl_->loads_before.clear();
  impl_->contact_options = options;
  impl_->source = source;
  impl_->sleep.wake_all();
  for (std::uint32_t i = 0; i < impl_->entries.size(); ++i) impl_->tell_source(i);
  for (const Impl::Apart& pair : impl_->apart) impl_->tell_apart(pair.a, pair.b, true);
}

void World::set_contact_veto(std::function<bool(const ContactPoint&)> acts) {
  impl_->contact_acts = std::move(acts);
  impl_->sleep.wake_all();
}

std::span<const ContactEvent> World::contact_events() const { return impl_->parts->events(); }

/// The joint's frame on one part, as it stands.
MaterialFrame World::Impl::joint_side(BodyId id, const JointFrame& in_world, const JointAttachment& on) const {
  if (id == BodyId{}) return MaterialFrame(in_world);
  const Entry& e = entry(id, "add_joint");
  const ModalModel& model = group(e).model();
  const RigidTransform X_BW = group(e).frame(e.slot).pose().inverse();
  const JointFrame in_body{.origin = X_BW * in_world.origin, .axes = to_matrix(X_BW.q) * in_world.axes};
  const auto body = static_cast<Index>(id.index);
  if (model.modes() == 0) return {body, in_body};
  const bool skinned = group(e).skinned(e.slot);
  if (!on.patch.empty()) return {body, model, on.patch, in_body, skinned};
  return {body, model, patch_around(model, on.surface, in_body.origin, on.radius), in_body, skinned};
}

/// Whether the source knows a body: it has something to meet others with, and others to meet.
bool World::Impl::shows(const Entry& e) const {
  const bool meets = e.filter.self || (e.filter.layers != 0 && e.filter.mask != 0);
  return meets && (e.shape || group(e).model().data().touchable);
}

/// Registers one body with the source.
void World::Impl::tell_source(std::uint32_t index) {
  Entry& e = entries[index];
  if (source == nullptr || !e.alive || !shows(e)) return;
  BodyGeometry geometry;
  if (e.shape)
    geometry.shape = e.shape;
  else
    geometry.model = group(e).shared_model(), geometry.skin = group(e).skinned(e.slot);
  source->add_body(static_cast<Index>(index), geometry, e.filter);
  e.placed = false;
  states_of = 0;
}

void World::Impl::tell_apart(Index a, Index b, bool are_apart) {
  const auto shown = [&](Index body) { return shows(entries[static_cast<std::size_t>(body)]); };
  if (source != nullptr && shown(a) && shown(b)) source->exclude_pair(a, b, are_apart);
}

bool World::Impl::are_apart(Index a, Index b) const {
  return std::any_of(apart.begin(), apart.end(), [&](const Apart& pair) { return pair.a == a && pair.b == b; });
}

void World::Impl::keep_apart(Index a, Index b, std::uint32_t joint) {
  if (!are_apart(a, b)) tell_apart(a, b, true);
  apart.push_back({a, b, joint});
}

/// What a joint that is removed kept apart.
void World::Impl::let_meet(std::uint32_t joint) {
  const auto found = std::find_if(apart.begin(), apart.end(), [&](const Apart& pair) { return pair.joint == joint; });
  if (found != apart.end()) let_meet(found);
}

void World::Impl::let_meet(std::vector<Apart>::iterator found) {
  const Apart pair = *found;
  apart.erase(found);
  if (!are_apart(pair.a, pair.b)) tell_apart(pair.a, pair.b, false);
}

void World::Impl::wake_bodies_of(std::uint32_t constraint) {
  for (const Index body : constraints.entries()[constraint].constraint()->bodies())
    if (body >= 0) sleep.wake(body);
}

}  // namespace limber
