#include <bit>

#include "world_impl.h"

namespace limber {
namespace {

using internal::ConstraintStage;
using internal::DentedSurface;
using internal::require_count;
using internal::require_finite;
using internal::require_pose;

/// FNV-1a over the bits of doubles.
class Hash {
 public:
  void add(double x) { add(std::bit_cast<std::uint64_t>(x)); }
  void add(std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte) value_ = (value_ ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3ull;
  }
  void add(const Vec3& v) { add(v.x()), add(v.y()), add(v.z()); }
  void add(const Quaternion& q) { add(q.w), add(q.x), add(q.y), add(q.z); }
  void add(std::span<const double> values) {
    for (const double x : values) add(x);
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ull;
};

}  // namespace

bool World::is_asleep(BodyId id) const {
  impl_->entry(id, "is_asleep");
  return impl_->sleep.asleep(static_cast<Index>(id.index));
}

void World::wake(BodyId id) {
  impl_->entry(id, "wake");
  impl_->sleep.wake(static_cast<Index>(id.index));
}

BodyView World::body(BodyId id) const {
  const Impl::Entry& e = impl_->entry(id, "body");
  const BodyGroup& group = impl_->group(e);
  const RigidFrame& frame = group.frame(e.slot);
  return {frame.pose(), frame.velocity(), frame.angular_velocity(group.frame_constants()), group.amplitudes(e.slot),
          group.rates(e.slot)};
}

void World::set_pose(BodyId id, const RigidTransform& pose) {
  const Impl::Entry& e = impl_->entry(id, "set_pose");
  require_pose(pose, "set_pose");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->parts->forget_frame(static_cast<Index>(id.index));
  impl_->group(e).set_pose(e.slot, pose);
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

void World::set_velocity(BodyId id, const Vec3& velocity, const Vec3& angular_velocity) {
  const Impl::Entry& e = impl_->entry(id, "set_velocity");
  require_finite(velocity, "set_velocity", "velocity");
  require_finite(angular_velocity, "set_velocity", "angular velocity");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->parts->forget_frame(static_cast<Index>(id.index));
  impl_->group(e).set_velocity(e.slot, velocity, angular_velocity);
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

void World::set_amplitudes(BodyId id, std::span<const double> amplitudes, std::span<const double> rates) {
  const Impl::Entry& e = impl_->entry(id, "set_amplitudes");
  const auto modes = static_cast<std::size_t>(impl_->group(e).model().modes());
  require_count(amplitudes.size(), modes, "set_amplitudes", "amplitudes");
  require_count(rates.size(), modes, "set_amplitudes", "rates");
  require_finite(amplitudes, "set_amplitudes", "amplitudes");
  require_finite(rates, "set_amplitudes", "rates");
  impl_->sleep.wake(static_cast<Index>(id.index));
  impl_->group(e).set_amplitudes(e.slot, amplitudes, rates);
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

void World::set_node_displacements(BodyId id, std::span<const double> displacements,
                                   std::span<const double> velocities) {
  const Impl::Entry& e = impl_->entry(id, "set_node_displacements");
  const ModalModel& model = impl_->group(e).model();
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
  impl_->group(e).set_amplitudes(e.slot, project(displacements), project(velocities));
  impl_->constraints.disturb(static_cast<Index>(id.index));
}

BodyEnergy World::energy(BodyId id) const {
  const Impl::Entry& e = impl_->entry(id, "energy");
  BodyEnergy energy = impl_->group(e).energy(e.slot, impl_->options.gravity);
  energy.elastic += impl_->contacts.dent_energy(impl_->constraints.states(), static_cast<Index>(id.index));
  return energy;
}

Vec3 World::angular_momentum(BodyId id) const {
  const Impl::Entry& e = impl_->entry(id, "angular_momentum");
  return impl_->group(e).frame(e.slot).angular_momentum(impl_->group(e).frame_constants());
}

Vec3 World::linear_momentum(BodyId id) const {
  const Impl::Entry& e = impl_->entry(id, "linear_momentum");
  return impl_->group(e).frame(e.slot).linear_momentum(impl_->group(e).frame_constants());
}

Vec3 World::position(BodyId id, const SurfacePoint& at) const {
  const Impl::Entry& e = impl_->entry(id, "position");
  validate(impl_->group(e).model(), at);
  return impl_->group(e).position(e.slot, at);
}

Vec3 World::velocity(BodyId id, const SurfacePoint& at) const {
  const Impl::Entry& e = impl_->entry(id, "velocity");
  validate(impl_->group(e).model(), at);
  return impl_->group(e).velocity(e.slot, at);
}

Vec3 World::dent(BodyId id, const SurfacePoint& at) const {
  const Impl::Entry& e = impl_->entry(id, "dent");
  const BodyGroup& group = impl_->group(e);
  validate(group.model(), at);
  const DentedSurface* dented = impl_->dented[static_cast<std::size_t>(e.group)].get();
  if (dented == nullptr) return Vec3::Zero();
  Vec3 dent = dented->displacement(impl_->contacts.dent_loads(static_cast<Index>(id.index)), at);
  if (group.skinned(e.slot)) dent = group.shape(e.slot).turn(at) * dent;
  return group.frame(e.slot).pose().q * dent;
}

std::uint64_t World::state_hash() const {
  Hash hash;
  hash.add(impl_->steps);
  hash.add(impl_->options.step);
  for (const Impl::Entry& e : impl_->entries) {
    hash.add(std::uint64_t{e.generation});
    if (!e.alive || e.group < 0) continue;
    const auto body = static_cast<Index>(&e - impl_->entries.data());
    hash.add(std::uint64_t{impl_->sleep.asleep(body)});
    hash.add(impl_->sleep.calm(body));
    const BodyGroup& group = impl_->group(e);
    const RigidFrame& frame = group.frame(e.slot);
    hash.add(frame.pose().q);
    hash.add(frame.pose().p);
    hash.add(frame.linear_momentum(group.frame_constants()));
    hash.add(frame.angular_momentum(group.frame_constants()));
    hash.add(group.amplitudes(e.slot));
    hash.add(group.rates(e.slot));
  }
  for (const ConstraintStage::Entry& e : impl_->constraints.entries()) {
    hash.add(std::uint64_t{e.generation});
    if (e.handle) hash.add(e.handle->target().position);
    for (int i = 0; e.joint && i < e.joint->coordinates(); ++i)
      hash.add(e.joint->coordinate(i, impl_->constraints.states()));
  }
  for (const std::span<const ContactMemory> known : {impl_->contacts.memory(), impl_->contacts.resting()})
    for (const ContactMemory& contact : known) {
      hash.add(contact.id);
      hash.add(contact.force);
      hash.add(contact.give);
      hash.add(contact.slip);
    }
  for (const RollingMemory& rolling : impl_->contacts.rolling()) hash.add(rolling.moment);
  for (const StrikeMemory& strike : impl_->contacts.strikes()) hash.add(strike.since);
  for (std::size_t body = 0; body < impl_->entries.size(); ++body)
    for (const DentLoad& load : impl_->contacts.dent_loads(static_cast<Index>(body))) hash.add(load.force);
  return hash.value();
}

}  // namespace limber
