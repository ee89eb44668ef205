#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "world_impl.h"

namespace limber::internal {
namespace {

bool finite(const Quaternion& q) { return std::isfinite(q.w + q.x + q.y + q.z); }

}  // namespace

void require_finite(const Vec3& v, const char* function, const char* what) {
  if (!v.allFinite())
    throw InvalidArgument(std::string("World::") + function + ": " + what + " is (" + std::to_string(v.x()) + ", " +
                          std::to_string(v.y()) + ", " + std::to_string(v.z()) + "), expected finite numbers");
}

void require_finite(std::span<const double> values, const char* function, const char* what) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i]))
      throw InvalidArgument(std::string("World::") + function + ": " + what + "[" + std::to_string(i) + "] is " +
                            std::to_string(values[i]) + ", expected a finite number");
}

void require_pose(const RigidTransform& X, const char* function) {
  require_finite(X.p, function, "the pose's position");
  if (!finite(X.q) || !(std::abs(X.q.norm() - 1.0) <= 1e-3))
    throw InvalidArgument(std::string("World::") + function + ": the pose's quaternion has norm " +
                          std::to_string(X.q.norm()) + ", expected 1; call normalized() on it");
}

void require_count(std::size_t seen, std::size_t expected, const char* function, const char* what) {
  if (seen != expected)
    throw InvalidArgument(std::string("World::") + function + ": " + what + " has " + std::to_string(seen) +
                          " elements, expected " + std::to_string(expected));
}

}  // namespace limber::internal

namespace limber {
namespace {

using internal::DentedSurface;
using internal::extent_of;
using internal::require_count;
using internal::require_finite;
using internal::require_pose;

// Bodies advanced as one job: about 10 µs of work, so that handing it out costs little.
constexpr Index kBodiesPerJob = 64;

double checked(std::optional<double> friction, const char* function) {
  constexpr double kNotGiven = -1.0;
  if (friction && !(*friction >= 0.0 && std::isfinite(*friction)))
    throw InvalidArgument(std::string("World::") + function + ": friction is " + std::to_string(*friction) +
                          ", expected a finite number of at least 0");
  return friction.value_or(kNotGiven);
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
  sleep.validate();
}

World::World(const WorldOptions& options, Jobs& jobs) : impl_(std::make_unique<Impl>()) {
  options.validate();
  impl_->options = options;
  impl_->jobs = &jobs;
  impl_->parts.emplace(impl_->constraints, options.substeps, options.step);
}
World::~World() = default;
World::World(World&&) noexcept = default;
World& World::operator=(World&&) noexcept = default;

// Bodies --------------------------------------------------------------------------------------------------------------

BodyId World::add_body(std::shared_ptr<const ModalModel> model, const BodyPlacement& placement) {
  if (!model) throw InvalidArgument("World::add_body: the model is null");
  require_pose(placement.pose, "add_body");
  require_finite(placement.velocity, "add_body", "velocity");
  require_finite(placement.angular_velocity, "add_body", "angular velocity");
  const double friction = checked(placement.friction, "add_body");
  if (placement.shape) {
    validate(*placement.shape);
    if (std::holds_alternative<HalfSpace>(*placement.shape))
      throw InvalidArgument("World::add_body: the shape is a half-space, expected one that ends");
  }
  const internal::ShapeExtent extent = placement.shape ? extent_of(*placement.shape) : extent_of(*model);
  const bool skinned = placement.modal_skin && model->data().skin.has_value();
  const Index group = impl_->group_of(std::move(model));
  const Index slot = impl_->groups[static_cast<std::size_t>(group)]->add(placement.pose, placement.velocity,
                                                                         placement.angular_velocity, skinned);
  const BodyId id = impl_->place({.group = group,
                                  .slot = slot,
                                  .shape = placement.shape,
                                  .filter = placement.filter,
                                  .friction = friction,
                                  .extent = extent});
  impl_->constraints.set_body(static_cast<Index>(id.index),
                              {.group = &impl_->group(impl_->entries[id.index]), .slot = slot});
  impl_->sleep.add(static_cast<Index>(id.index));
  impl_->tell_source(id.index);
  impl_->ranges.reserve(impl_->entries.capacity());
  impl_->awake_slots.reserve(impl_->entries.capacity());
  return id;
}

/// The group of a model's instances, a new one if it has none.
Index World::Impl::group_of(std::shared_ptr<const ModalModel> model) {
  const auto same = [&](const auto& g) { return g && &g->model() == model.get(); };
  auto found = std::find_if(groups.begin(), groups.end(), same);
  if (found == groups.end()) {
    auto made = std::make_unique<BodyGroup>(std::move(model), parts->length());
    found = std::find(groups.begin(), groups.end(), nullptr);
    if (found == groups.end()) found = groups.insert(groups.end(), nullptr);
    *found = std::move(made);
    dented.resize(groups.size());
    if ((*found)->model().data().residual_compliance)
      dented[static_cast<std::size_t>(found - groups.begin())] = std::make_unique<DentedSurface>((*found)->model());
    skins.resize(groups.size());
    const ModalModel& known = (*found)->model();
    skins[static_cast<std::size_t>(found - groups.begin())] =
        known.data().skin ? std::make_unique<internal::GroupSkin>(known) : nullptr;
    halves.resize(groups.size());
    const bool is_halved = options.half_precision && !known.data().skin;
    halves[static_cast<std::size_t>(found - groups.begin())] =
        is_halved ? std::make_unique<const HalfBasis>(known.render().basis) : nullptr;
  }
  return static_cast<Index>(found - groups.begin());
}

/// Runs of slots whose bodies are awake.
void World::Impl::make_ranges() {
  if (ranges_of == sleep.changes()) return;
  ranges_of = sleep.changes();
  awake_slots.clear();
  for (const Index body : sleep.awake()) {
    const Entry& e = entries[static_cast<std::size_t>(body)];
    awake_slots.emplace_back(e.group, e.slot);
  }
  std::sort(awake_slots.begin(), awake_slots.end());
  ranges.clear();
  for (const auto& [group, slot] : awake_slots) {
    Range* last = ranges.empty() ? nullptr : &ranges.back();
    if (last != nullptr && last->group == group && last->end == slot && slot - last->begin < kBodiesPerJob)
      ++last->end;
    else
      ranges.push_back({group, slot, slot + 1});
  }
}

/// Gives a body an id.
BodyId World::Impl::place(Entry&& made) {
  if (vacant_entries.empty()) {
    entries.emplace_back();
    vacant_entries.reserve(entries.size());  // so that remove_body() cannot fail
    vacant_entries.push_back(static_cast<std::uint32_t>(entries.size() - 1));
  }
  const std::uint32_t index = vacant_entries.back();
  vacant_entries.pop_back();
  made.generation = entries[index].generation;
  made.alive = true;
  entries[index] = std::move(made);
  ++alive;
  return {index, entries[index].generation};
}

BodyId World::add_static(std::shared_ptr<const Shape> shape, const RigidTransform& pose, const CollisionFilter& filter,
                         std::optional<double> friction) {
  if (!shape) throw InvalidArgument("World::add_static: the shape is null");
  validate(*shape);
  require_pose(pose, "add_static");
  const double mu = checked(friction, "add_static");
  const BodyId id =
      impl_->place({.group = -1, .shape = std::move(shape), .pose = pose, .filter = filter, .friction = mu});
  impl_->constraints.set_body(static_cast<Index>(id.index), {.pose = pose});
  impl_->sleep.add(static_cast<Index>(id.index));
  impl_->tell_source(id.index);
  return id;
}

void World::remove_body(BodyId id) {
  if (!impl_->contains(id)) impl_->entry(id, "remove_body");  // tells so
  const Impl::Entry& known = impl_->entries[id.index];
  const auto index = static_cast<Index>(id.index);
  impl_->sleep.remove(index);
  impl_->parts->forget(index);
  std::erase_if(impl_->apart, [&](const Impl::Apart& pair) { return pair.a == index || pair.b == index; });
  if (impl_->source != nullptr && impl_->shows(known)) impl_->source->remove_body(index);
  impl_->constraints.remove_body(index);
  impl_->contacts.forget(index);
  if (id.index < impl_->loads_before.size()) impl_->loads_before[id.index].clear();
  if (known.group >= 0) {
    BodyGroup& group = impl_->group(known);
    group.remove(known.slot);
    if (group.count() == 0) {  // lets go of the model
      impl_->dented[static_cast<std::size_t>(known.group)].reset();
      impl_->skins[static_cast<std::size_t>(known.group)].reset();
      impl_->halves[static_cast<std::size_t>(known.group)].reset();
      impl_->groups[static_cast<std::size_t>(known.group)].reset();
    }
  }
  Impl::Entry& entry = impl_->entries[id.index];
  entry.alive = false;
  --impl_->alive;
  // An index whose generations are used up is never given again.
  if (++entry.generation != 0) impl_->vacant_entries.push_back(id.index);
}

bool World::contains(BodyId id) const { return impl_->contains(id); }
std::size_t World::body_count() const { return impl_->alive; }
const ModalModel& World::model(BodyId id) const { return impl_->group(impl_->entry(id, "model")).model(); }

// Time ----------------------------------------------------------------------------------------------------------------

int World::advance(double real_seconds) {
  if (!(real_seconds >= 0.0 && std::isfinite(real_seconds)))
    throw InvalidArgument("World::advance: real_seconds is " + std::to_string(real_seconds) +
                          ", expected a finite number of at least 0");
  const double h = impl_->options.step;
  impl_->accumulator += real_seconds;
  const double wanted = std::floor(impl_->accumulator / h);
  const double taken = std::min(wanted, static_cast<double>(impl_->options.max_steps_per_advance));
  impl_->accumulator = std::clamp(std::fmod(impl_->accumulator, h), 0.0, std::nextafter(h, 0.0));
  impl_->dropped += (wanted - taken) * h;
  for (int i = 0; i < static_cast<int>(taken); ++i) step();
  return static_cast<int>(taken);
}

double World::interpolation_factor() const { return impl_->accumulator / impl_->options.step; }

void World::set_step(double seconds) {
  Impl& m = *impl_;
  WorldOptions options = m.options;
  options.step = seconds;
  options.validate();
  const auto waits = [&](const Impl::Entry& e) {
    return e.alive && e.group >= 0 && m.group(e).has_delayed_impulse(e.slot);
  };
  if (m.parts->impulses_wait() || std::any_of(m.entries.begin(), m.entries.end(), waits))
    throw InvalidArgument("World::set_step: an impulse with a delay waits for the coming step; set the step first");
  m.accumulator = std::min(m.accumulator / m.options.step * seconds, std::nextafter(seconds, 0.0));
  m.time_before = time();
  m.steps_before = m.steps;
  m.set_length(seconds);
}

void World::Impl::set_length(double step) {
  for (const auto& group : groups)
    if (group) group->set_step_length(step / options.substeps);
  parts->set_step(step);
  options.step = step;
}

double World::time() const {
  return impl_->time_before + static_cast<double>(impl_->steps - impl_->steps_before) * impl_->options.step;
}
std::uint64_t World::step_count() const { return impl_->steps; }
double World::dropped_seconds() const { return impl_->dropped; }
const WorldOptions& World::options() const { return impl_->options; }

void World::set_gravity(const Vec3& gravity) {
  require_finite(gravity, "set_gravity", "gravity");
  impl_->sleep.wake_all();
  impl_->options.gravity = gravity;
}

// Loads ---------------------------------------------------------------------------------------------------------------

void World::apply_force(BodyId id, const SurfacePoint& at, const Vec3& newtons, Axes axes) {
  const Impl::Entry& e = impl_->entry(id, "apply_force");
  BodyGroup& group = impl_->group(e);
  validate(group.model(), at);
  require_finite(newtons, "apply_force", "the force");
  const Vec3 force_W = axes == Axes::kWorld ? newtons : group.frame(e.slot).pose().q * newtons;
  impl_->sleep.wake(static_cast<Index>(id.index));
  group.apply_force(e.slot, at, force_W);
  impl_->parts->hold_force(static_cast<Index>(id.index), at, force_W);
}

void World::apply_impulse(BodyId id, const SurfacePoint& at, const Vec3& newton_seconds, Axes axes, double delay) {
  const Impl::Entry& e = impl_->entry(id, "apply_impulse");
  BodyGroup& group = impl_->group(e);
  validate(group.model(), at);
  require_finite(newton_seconds, "apply_impulse", "the impulse");
  if (!(delay >= 0.0 && delay < impl_->options.step))
    throw InvalidArgument("World::apply_impulse: delay is " + std::to_string(delay) +
                          " s, expected from 0 to less than " + std::to_string(impl_->options.step));
  const Vec3 impulse_W = axes == Axes::kWorld ? newton_seconds : group.frame(e.slot).pose().q * newton_seconds;
  const auto body = static_cast<Index>(id.index);
  impl_->sleep.wake(body);
  if (!impl_->parts->keep_impulse(body, at, impulse_W, delay)) return;
  group.apply_impulse(e.slot, at, impulse_W, delay);
  impl_->constraints.disturb(body);
}

void World::set_kinematic_frame(BodyId id, const KinematicFrame& target) {
  const Impl::Entry& e = impl_->entry(id, "set_kinematic_frame");
  BodyGroup& group = impl_->group(e);
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
  impl_->parts->lead(static_cast<Index>(id.index), target);
}

}  // namespace limber
