#include "argument_checks.h"
#include "limber/core/error.h"
#include "world_impl.h"

namespace limber {
namespace {

using Entry = internal::BodyTable::Entry;
using internal::ConstraintStage;
using internal::IndentedSurface;
using internal::require_count;
using internal::require_finite;
using internal::require_pose;

}  // namespace

bool World::is_asleep(BodyId id) const {
  impl_->bodies.entry(id, "is_asleep");
  return impl_->sleep.asleep(static_cast<Index>(id.index));
}

void World::wake(BodyId id) {
  impl_->bodies.entry(id, "wake");
  impl_->sleep.wake(static_cast<Index>(id.index));
}

BodyView World::body(BodyId id) const {
  const Entry& e = impl_->bodies.entry(id, "body");
  const BodyGroup& group = impl_->bodies.group(e);
  const RigidFrame& frame = group.frame(e.slot);
  return {frame.pose(), frame.velocity(), group.angular_velocity(e.slot), group.amplitudes(e.slot),
          group.rates(e.slot)};
}

void World::set_pose(BodyId id, const RigidTransform& pose) {
  const Entry& e = impl_->bodies.entry(id, "set_pose");
  require_pose(pose, "set_pose");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->parts.forget_frame(static_cast<Index>(id.index));
  impl_->bodies.group(e).set_pose(e.slot, pose);
  impl_->probes.queries.tell_changed();
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

void World::set_velocity(BodyId id, const Vec3& velocity, const Vec3& angular_velocity) {
  const Entry& e = impl_->bodies.entry(id, "set_velocity");
  require_finite(velocity, "set_velocity", "velocity");
  require_finite(angular_velocity, "set_velocity", "angular velocity");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->parts.forget_frame(static_cast<Index>(id.index));
  impl_->bodies.group(e).set_velocity(e.slot, velocity, angular_velocity);
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

void World::set_amplitudes(BodyId id, std::span<const double> amplitudes, std::span<const double> rates) {
  const Entry& e = impl_->bodies.entry(id, "set_amplitudes");
  const auto modes = static_cast<std::size_t>(impl_->bodies.group(e).model().modes());
  require_count(amplitudes.size(), modes, "set_amplitudes", "amplitudes");
  require_count(rates.size(), modes, "set_amplitudes", "rates");
  require_finite(amplitudes, "set_amplitudes", "amplitudes");
  require_finite(rates, "set_amplitudes", "rates");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->bodies.group(e).set_amplitudes(e.slot, amplitudes, rates);
  impl_->probes.queries.tell_changed();
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

void World::set_node_displacements(BodyId id, std::span<const double> displacements,
                                   std::span<const double> velocities) {
  const Entry& e = impl_->bodies.entry(id, "set_node_displacements");
  const ModalModel& model = impl_->bodies.group(e).model();
  if (!model.data().volume_block)
    throw InvalidArgument("World::set_node_displacements: \"" + model.name() +
                          "\" has no volume block; bake it with --volume");
  const ModalBasis& MW = model.data().volume_block->mass_times_basis;
  const std::size_t numbers = 3 * static_cast<std::size_t>(MW.vertices());
  require_count(displacements.size(), numbers, "set_node_displacements", "displacements");
  require_count(velocities.size(), numbers, "set_node_displacements", "velocities");
  require_finite(displacements, "set_node_displacements", "displacements");
  require_finite(velocities, "set_node_displacements", "velocities");
  const auto project = [&](std::span<const double> d) {  // (MW)ᵀ d
    std::vector<double> z(static_cast<std::size_t>(model.modes()), 0.0);
    for (Index node = 0; node < MW.vertices(); ++node) {
      const Vec3 d_node = Eigen::Map<const Vec3>(d.data() + 3 * static_cast<std::size_t>(node));
      for (std::size_t i = 0; i < z.size(); ++i)
        z[i] += MW.shape(node, static_cast<Index>(i)).cast<double>().dot(d_node);
    }
    return z;
  };
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->bodies.group(e).set_amplitudes(e.slot, project(displacements), project(velocities));
  impl_->probes.queries.tell_changed();
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

BodyEnergy World::energy(BodyId id) const {
  const Entry& e = impl_->bodies.entry(id, "energy");
  BodyEnergy energy = impl_->bodies.group(e).energy(e.slot, impl_->options.gravity);
  energy.elastic += impl_->paths.in_force().stored_energy(static_cast<Index>(id.index));
  return energy;
}

Vec3 World::angular_momentum(BodyId id) const {
  const Entry& e = impl_->bodies.entry(id, "angular_momentum");
  return impl_->bodies.group(e).frame(e.slot).angular_momentum(impl_->bodies.group(e).frame_constants());
}

Vec3 World::linear_momentum(BodyId id) const {
  const Entry& e = impl_->bodies.entry(id, "linear_momentum");
  return impl_->bodies.group(e).frame(e.slot).linear_momentum(impl_->bodies.group(e).frame_constants());
}

Vec3 World::position(BodyId id, const SurfacePoint& at) const {
  const Entry& e = impl_->bodies.entry(id, "position");
  validate(impl_->bodies.group(e).model(), at);
  return impl_->bodies.group(e).position(e.slot, at);
}

Vec3 World::velocity(BodyId id, const SurfacePoint& at) const {
  const Entry& e = impl_->bodies.entry(id, "velocity");
  validate(impl_->bodies.group(e).model(), at);
  return impl_->bodies.group(e).velocity(e.slot, at);
}

Vec3 World::indentation(BodyId id, const SurfacePoint& at) const {
  const Entry& e = impl_->bodies.entry(id, "indentation");
  const BodyGroup& group = impl_->bodies.group(e);
  validate(group.model(), at);
  const IndentedSurface* indented = impl_->bodies.model_group(e).indented.get();
  if (indented == nullptr) return Vec3::Zero();
  Vec3 indentation =
      indented->displacement(impl_->paths.in_force().indentation_loads(static_cast<Index>(id.index)), at);
  if (group.skinned(e.slot)) indentation = group.shape(e.slot).turn(at) * indentation;
  return group.frame(e.slot).pose().q * indentation;
}

std::uint64_t World::state_hash() const {
  Impl& m = *impl_;
  internal::StateHash hash;
  hash.add(m.time.steps());
  hash.add(m.options.step);
  for (std::size_t i = 0; i < m.bodies.size(); ++i) {
    const auto body = static_cast<Index>(i);
    const Entry& e = m.bodies[body];
    hash.add(std::uint64_t{e.generation});
    if (!e.alive || e.group < 0) continue;
    hash.add(std::uint64_t{m.sleep.asleep(body)});
    hash.add(m.sleep.calm(body));
    const BodyGroup& group = m.bodies.group(e);
    const RigidFrame& frame = group.frame(e.slot);
    hash.add(frame.pose().q);
    hash.add(frame.pose().p);
    hash.add(frame.linear_momentum(group.frame_constants()));
    hash.add(frame.angular_momentum(group.frame_constants()));
    hash.add(group.amplitudes(e.slot));
    hash.add(group.rates(e.slot));
  }
  for (const ConstraintStage::Entry& e : m.constraints.entries()) {
    hash.add(std::uint64_t{e.generation});
    if (e.handle) hash.add(e.handle->target().position);
    for (int i = 0; e.joint && i < e.joint->coordinates(); ++i)
      hash.add(e.joint->coordinate(i, m.constraints.states()));
  }
  m.paths.in_force().add_to(hash);
  return hash.value();
}

void World::save_state(std::vector<std::byte>& state) const { impl_->snapshot().save(state); }

void World::restore_state(std::span<const std::byte> state) {
  StateReader reader = internal::Snapshot::open(state);
  internal::Snapshot snapshot = impl_->snapshot();
  for (const BodyId later : snapshot.check_structure(reader)) remove_body(later);
  snapshot.restore_motion(reader);
  impl_->last.hits.update(contact_events(), impl_->options.hit_speed, impl_->bodies);
  impl_->probes.queries.tell_changed();
}

// Drawing -------------------------------------------------------------------------------------------------------------

void World::reconstruct(std::span<const DrawTarget> targets, double interpolation, const Vec3& origin) const {
  Impl& m = *impl_;
  m.drawing.reconstruct(targets, interpolation, origin, m.paths.in_force(), m.jobs, m.last.times);
}

void World::reconstruct(BodyId id, std::span<float> positions, std::span<float> normals, double interpolation,
                        const Vec3& origin) const {
  const DrawTarget target{id, positions, normals};
  reconstruct({&target, 1}, interpolation, origin);
}

RigidTransform World::interpolated_pose(BodyId id, double interpolation) const {
  return impl_->drawing.pose(id, interpolation);
}

void World::interpolated_amplitudes(BodyId id, double interpolation, std::span<float> amplitudes) const {
  impl_->drawing.amplitudes(id, interpolation, amplitudes);
}

void World::interpolated_weights(BodyId id, double interpolation, std::span<float> weights) const {
  impl_->drawing.weights(id, interpolation, weights);
}

bool World::has_modal_skin(BodyId id) const {
  const Entry& e = impl_->bodies.entry(id, "has_modal_skin");
  return impl_->bodies.group(e).skinned(e.slot);
}

void World::interpolated_handles(BodyId id, double interpolation, std::span<float> numbers) const {
  impl_->drawing.handles(id, interpolation, numbers);
}

}  // namespace limber
