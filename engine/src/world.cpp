#include "limber/engine/world.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "constraint_stage.h"
#include "limber/core/error.h"
#include "limber/dynamics/body_group.h"
#include "limber/dynamics/exact_motion.h"
#include "limber/dynamics/reconstruct.h"
#include "sleep_stage.h"
#include "step_parts.h"

namespace limber {
namespace {

// Bodies advanced as one job: about 10 µs of work, so that handing it out costs little.
constexpr Index kBodiesPerJob = 64;

bool finite(const Quaternion& q) { return std::isfinite(q.w + q.x + q.y + q.z); }

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

void require_fraction(double s, const char* function) {
  if (!(s >= 0.0 && s <= 1.0))
    throw InvalidArgument(std::string("World::") + function + ": interpolation is " + std::to_string(s) +
                          ", expected 0 to 1");
}

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

namespace {

double checked(std::optional<double> friction, const char* function) {
  constexpr double kNotGiven = -1.0;
  if (friction && !(*friction >= 0.0 && std::isfinite(*friction)))
    throw InvalidArgument(std::string("World::") + function + ": friction is " + std::to_string(*friction) +
                          ", expected a finite number of at least 0");
  return friction.value_or(kNotGiven);
}

/// Of a ball about the body origin that holds all of a shape, m.
double radius_of(const Shape& shape) {
  const auto farthest = [](const std::vector<Vec3>& points) {
    double r = 0.0;
    for (const Vec3& p : points) r = std::max(r, p.norm());
    return r;
  };
  if (const auto* ball = std::get_if<Sphere>(&shape)) return ball->radius;
  if (const auto* capsule = std::get_if<Capsule>(&shape)) return capsule->radius + capsule->half_length;
  if (const auto* box = std::get_if<Box>(&shape)) return box->half_extents.norm();
  if (const auto* hull = std::get_if<ConvexHull>(&shape)) return farthest(hull->points);
  if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) return farthest(mesh->vertices);
  const auto& field = std::get<HeightField>(shape);
  double height = 0.0;
  for (const float h : field.heights) height = std::max(height, std::abs(static_cast<double>(h)));
  return Vec3((field.columns - 1) * field.spacing_x, (field.rows - 1) * field.spacing_y, height).norm();
}

}  // namespace

struct World::Impl {
  /// What a BodyId's index names.
  struct Entry {
    std::uint32_t generation = 1;
    bool alive = false;
    Index group = 0, slot = 0;  // group −1: static
    std::shared_ptr<const Shape> shape{};
    RigidTransform pose{};  // of a static one
    CollisionFilter filter{};
    double friction = -1.0;  // negative: that of the contact options
    double radius = 0.0;     // of a shape that moves
    bool placed = false;     // of a static one: the source has seen where it stands
  };
  /// Two bodies that do not meet as long as some joint between them stands.
  struct Apart {
    Index a, b;
    std::uint32_t joint;  // its place
  };
  /// Slots [begin, end) of a group: what one job advances.
  struct Range {
    Index group, begin, end;
  };

  WorldOptions options;
  Jobs* jobs;
  std::vector<Entry> entries;
  std::vector<std::uint32_t> vacant_entries;
  std::vector<std::unique_ptr<BodyGroup>> groups;  // null where the last body of a model was removed
  std::vector<Range> ranges;                       // covers all slots of all groups
  ConstraintStage constraints;                     // bodies by their entries' indices
  SleepStage sleep{constraints};
  std::optional<StepParts> parts{};
  std::vector<Apart> apart;
  ContactSource* source = nullptr;
  ContactSet contacts;
  std::vector<ContactPoint> touching;
  std::function<bool(const ContactPoint&)> contact_acts;
  ContactOptions contact_options;
  std::vector<BodyState> states;  // by entries' indices, for the source
  std::vector<double> friction;   // the same
  std::vector<double> still;      // zeros: how far a rigid shape's points move with the modes
  double energy_removed = 0.0;    // of the step's parts before the last
  bool solved = true;
  int iterations = 0, cuts = 0;
  ProgramReport programs;
  std::vector<ExactMotion> motions;
  std::size_t alive = 0;
  std::uint64_t steps = 0;
  double accumulator = 0.0, dropped = 0.0;
  // Scratch of drawing, kept so that it is not allocated again.
  struct Drawn {
    Index group;
    std::size_t target;
  };
  std::vector<Drawn> drawn;
  std::vector<double> drawn_amplitudes;
  std::vector<ReconstructionTarget> reconstruction;

  const Entry& entry(BodyId id, const char* function) const {
    if (!contains(id))
      throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) + " (generation " +
                            std::to_string(id.generation) +
                            ") does not exist; it was removed or belongs to another world");
    if (entries[id.index].group < 0)
      throw InvalidArgument(std::string("World::") + function + ": body " + std::to_string(id.index) +
                            " is a static shape; it has no motion");
    return entries[id.index];
  }
  bool contains(BodyId id) const {
    return id.index < entries.size() && entries[id.index].alive && entries[id.index].generation == id.generation;
  }
  BodyGroup& group(const Entry& e) const { return *groups[static_cast<std::size_t>(e.group)]; }

  /// The constraint that an id names, if it is of the kind asked for.
  template <class Id>
  const ConstraintStage::Entry* find(Id id) const {
    if (id.index >= constraints.entries().size()) return nullptr;
    const ConstraintStage::Entry& e = constraints.entries()[id.index];
    const bool kind = std::is_same_v<Id, HandleId> ? e.handle != nullptr : e.joint != nullptr;
    return kind && e.generation == id.generation ? &e : nullptr;
  }
  template <class Id>
  const ConstraintStage::Entry& constraint(Id id, const char* function) const {
    if (const ConstraintStage::Entry* found = find(id)) return *found;
    throw InvalidArgument(std::string("World::") + function + ": " +
                          (std::is_same_v<Id, HandleId> ? "handle " : "joint ") + std::to_string(id.index) +
                          " (generation " + std::to_string(id.generation) +
                          ") does not exist; it was removed, with its body or by itself, or belongs to another world");
  }
  MaterialFrame joint_side(BodyId id, const JointFrame& in_world, const JointAttachment& on) const;

  BodyId place(Entry&& made);
  void tell_source(std::uint32_t index);
  bool are_apart(Index a, Index b) const;
  void keep_apart(Index a, Index b, std::uint32_t joint);
  void let_meet(std::uint32_t joint);
  void wake_bodies_of(std::uint32_t constraint);
  void write_states();
  void find_contacts();
  bool wake_what_is_touched();
  Index group_of(std::shared_ptr<const ModalModel> model);
  void make_ranges();
  void advance_part(int part);
  template <class Real>
  void interpolate(BodyId id, double s, Real* amplitudes) const;
  void prepare_drawing(std::span<const DrawTarget> targets);
};

/// The group of a model's instances, a new one if it has none.
Index World::Impl::group_of(std::shared_ptr<const ModalModel> model) {
  const auto same = [&](const auto& g) { return g && &g->model() == model.get(); };
  auto found = std::find_if(groups.begin(), groups.end(), same);
  if (found == groups.end()) {
    auto made = std::make_unique<BodyGroup>(std::move(model), parts->length());
    found = std::find(groups.begin(), groups.end(), nullptr);
    if (found == groups.end()) found = groups.insert(groups.end(), nullptr);
    *found = std::move(made);
  }
  return static_cast<Index>(found - groups.begin());
}

void World::Impl::make_ranges() {
  ranges.clear();
  for (std::size_t g = 0; g < groups.size(); ++g)
    for (Index begin = 0; groups[g] && begin < groups[g]->slots(); begin += kBodiesPerJob)
      ranges.push_back({static_cast<Index>(g), begin, std::min(begin + kBodiesPerJob, groups[g]->slots())});
}

/// The joint's frame on one part, as it stands.
MaterialFrame World::Impl::joint_side(BodyId id, const JointFrame& in_world, const JointAttachment& on) const {
  if (id == BodyId{}) return MaterialFrame(in_world);
  const Entry& e = entry(id, "add_joint");
  const ModalModel& model = group(e).model();
  const RigidTransform X_BW = group(e).frame(e.slot).pose().inverse();
  const JointFrame in_body{.origin = X_BW * in_world.origin, .axes = to_matrix(X_BW.q) * in_world.axes};
  const auto body = static_cast<Index>(id.index);
  if (model.modes() == 0) return {body, in_body};
  if (!on.patch.empty()) return {body, model, on.patch, in_body};
  return {body, model, patch_around(model, on.surface, in_body.origin, on.radius), in_body};
}

/// Registers one body with the source.
void World::Impl::tell_source(std::uint32_t index) {
  Entry& e = entries[index];
  if (source == nullptr || !e.alive) return;
  BodyGeometry geometry;
  if (e.shape)
    geometry.shape = e.shape;
  else
    geometry.model = group(e).shared_model();
  source->add_body(static_cast<Index>(index), geometry, e.filter);
  e.placed = false;
}

bool World::Impl::are_apart(Index a, Index b) const {
  return std::any_of(apart.begin(), apart.end(), [&](const Apart& pair) { return pair.a == a && pair.b == b; });
}

void World::Impl::keep_apart(Index a, Index b, std::uint32_t joint) {
  if (source != nullptr && !are_apart(a, b)) source->exclude_pair(a, b, true);
  apart.push_back({a, b, joint});
}

/// What a joint that is removed kept apart.
void World::Impl::let_meet(std::uint32_t joint) {
  const auto found = std::find_if(apart.begin(), apart.end(), [&](const Apart& pair) { return pair.joint == joint; });
  if (found == apart.end()) return;
  const Apart pair = *found;
  apart.erase(found);
  if (source != nullptr && !are_apart(pair.a, pair.b)) source->exclude_pair(pair.a, pair.b, false);
}

void World::Impl::wake_bodies_of(std::uint32_t constraint) {
  for (const Index body : constraints.entries()[constraint].constraint()->bodies())
    if (body >= 0) sleep.wake(body);
}

/// For the source: where bodies are, and how far they may come within the step.
void World::Impl::write_states() {
  states.resize(entries.size());
  motions.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i) {
    Entry& e = entries[i];
    if (!e.alive) continue;
    if (e.group < 0) {
      states[i] = {.pose = e.pose, .asleep = std::exchange(e.placed, true)};
      continue;
    }
    const BodyGroup& bodies = group(e);
    states[i] = {.pose = bodies.frame(e.slot).pose(), .asleep = sleep.asleep(static_cast<Index>(i))};
    if (!e.shape) states[i].amplitudes = bodies.amplitudes(e.slot);
    if (states[i].asleep) continue;
    bodies.predict_motion(e.slot, options.gravity, motions[i]);
    const RigidFrame& frame = bodies.frame(e.slot);
    // Without gravity: what lies on something does not fall, and what falls has a velocity.
    states[i].displacement = parts->length() * frame.velocity();
    states[i].rotation = parts->length() * frame.angular_velocity(bodies.frame_constants());
    const SurfaceExtent& extent = bodies.model().collision_extent();
    if (e.shape && still.size() < extent.shape.size()) still.resize(extent.shape.size(), 0.0);
    states[i].reach = e.shape ? motions[i].reach(e.radius, std::span(still).first(extent.shape.size()))
                              : motions[i].reach(extent.radius, extent.shape);
  }
}

/// What touches, or may within the step, as rows for the islands.
void World::Impl::find_contacts() {
  if (source == nullptr) return;
  do {
    write_states();
    source->find_contacts({.states = states}, touching, *jobs);
    if (contact_acts) std::erase_if(touching, [this](const ContactPoint& contact) { return !contact_acts(contact); });
  } while (wake_what_is_touched());
  friction.resize(entries.size());
  for (std::size_t i = 0; i < entries.size(); ++i)
    friction[i] = entries[i].friction >= 0.0 ? entries[i].friction : contact_options.friction;
  contacts.update(constraints.states(), touching, Vec3::Zero(), friction);
  constraints.set_contacts(contacts.constraints());
}

/// Bodies that sleep are not tested with each other, so those that wake are to be looked at again.
bool World::Impl::wake_what_is_touched() {
  bool woke = false;
  for (const ContactPoint& contact : touching)
    for (const Index body : {contact.a.body, contact.b.body})
      if (sleep.asleep(body)) {
        sleep.wake(body);
        woke = true;
      }
  return woke;
}

void World::Impl::advance_part(int part) {
  for (const auto& group : groups)
    if (group) group->set_within_step(part > 0);
  parts->begin(part);
  find_contacts();
  constraints.find_islands();
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  jobs->parallel_for(ranges.size(), 1, [this](std::size_t begin, std::size_t end) {
    for (std::size_t r = begin; r < end; ++r)
      groups[static_cast<std::size_t>(ranges[r].group)]->advance(ranges[r].begin, ranges[r].end, options.gravity);
  });
  constraints.step(*jobs, {.step = parts->length(), .gravity = options.gravity, .contact = contacts.options().rule});
  if (source != nullptr) {
    contacts.finish(sleep.asleep());
    parts->add_events(part, contacts.events());
  }
}

/// Amplitudes between the last two states.
template <class Real>
void World::Impl::interpolate(BodyId id, double s, Real* amplitudes) const {
  const Entry& e = entries[id.index];
  const std::span<const double> newest = group(e).amplitudes(e.slot), previous = group(e).previous_amplitudes(e.slot);
  for (std::size_t i = 0; i < newest.size(); ++i)
    amplitudes[i] = static_cast<Real>(s == 1.0 ? newest[i] : previous[i] + s * (newest[i] - previous[i]));
}

/// Checks what is to be drawn and orders it by model.
void World::Impl::prepare_drawing(std::span<const DrawTarget> targets) {
  drawn.clear();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const Entry& e = entry(targets[i].id, "reconstruct");
    const std::size_t numbers = 3 * static_cast<std::size_t>(group(e).model().render().vertices());
    require_count(targets[i].positions.size(), numbers, "reconstruct", "positions");
    if (!targets[i].normals.empty()) require_count(targets[i].normals.size(), numbers, "reconstruct", "normals");
    drawn.push_back({e.group, i});
  }
  std::sort(drawn.begin(), drawn.end(), [](const Drawn& a, const Drawn& b) {
    return a.group != b.group ? a.group < b.group : a.target < b.target;
  });
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
  const Index group = impl_->group_of(std::move(model));
  const Index slot = impl_->groups[static_cast<std::size_t>(group)]->add(placement.pose, placement.velocity,
                                                                         placement.angular_velocity);
  const BodyId id = impl_->place({.group = group,
                                  .slot = slot,
                                  .shape = placement.shape,
                                  .filter = placement.filter,
                                  .friction = friction,
                                  .radius = placement.shape ? radius_of(*placement.shape) : 0.0});
  impl_->constraints.set_body(static_cast<Index>(id.index),
                              {.group = &impl_->group(impl_->entries[id.index]), .slot = slot});
  impl_->sleep.add(static_cast<Index>(id.index));
  impl_->tell_source(id.index);
  impl_->make_ranges();
  return id;
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
  if (impl_->source != nullptr) impl_->source->remove_body(index);
  impl_->constraints.remove_body(index);
  if (known.group >= 0) {
    BodyGroup& group = impl_->group(known);
    group.remove(known.slot);
    if (group.count() == 0) {  // lets go of the model
      impl_->groups[static_cast<std::size_t>(known.group)].reset();
      impl_->make_ranges();
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

void World::step() {
  Impl& m = *impl_;
  m.energy_removed = 0.0, m.solved = true, m.iterations = m.cuts = 0;
  m.programs = {};
  for (int part = 0; part < m.parts->count(); ++part) {
    m.advance_part(part);
    const IslandReport report = m.constraints.report();
    m.energy_removed += report.energy_removed;
    m.solved = m.solved && report.status == SolveStatus::kSolved;
    m.iterations = std::max(m.iterations, report.iterations);
    m.cuts += report.cuts;
    m.programs.add(report.programs);
  }
  m.parts->finish();
  if (m.options.sleep.enabled) m.sleep.update(m.options.sleep, m.options.step, contact_events());
  ++m.steps;
}

double World::interpolation_factor() const { return impl_->accumulator / impl_->options.step; }
double World::time() const { return static_cast<double>(impl_->steps) * impl_->options.step; }
std::uint64_t World::step_count() const { return impl_->steps; }
double World::dropped_seconds() const { return impl_->dropped; }
const WorldOptions& World::options() const { return impl_->options; }

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

// Constraints ---------------------------------------------------------------------------------------------------------

HandleId World::add_handle(BodyId id, const SurfacePoint& at, const HandleOptions& options) {
  const Impl::Entry& e = impl_->entry(id, "add_handle");
  const ModalModel& model = impl_->group(e).model();
  validate(model, at);
  auto made = std::make_unique<Handle>(MaterialFrame(static_cast<Index>(id.index), model, at),
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
          .programs = impl_->programs,
          .cuts = impl_->cuts,
          .solved = impl_->solved,
          .energy_removed = impl_->energy_removed};
}

void World::set_contact_source(ContactSource* source, const ContactOptions& options) {
  ContactSet contacts(options);
  impl_->constraints.set_contacts({});
  impl_->contacts = std::move(contacts);
  impl_->contact_options = options;
  impl_->source = source;
  impl_->sleep.wake_all();
  for (std::uint32_t i = 0; i < impl_->entries.size(); ++i) impl_->tell_source(i);
  if (source == nullptr) return;
  for (const Impl::Apart& pair : impl_->apart) source->exclude_pair(pair.a, pair.b, true);
}

void World::set_contact_veto(std::function<bool(const ContactPoint&)> acts) {
  impl_->contact_acts = std::move(acts);
  impl_->sleep.wake_all();
}

std::span<const ContactEvent> World::contact_events() const { return impl_->parts->events(); }

// State ---------------------------------------------------------------------------------------------------------------

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
  return impl_->group(e).energy(e.slot, impl_->options.gravity);
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

// Drawing -------------------------------------------------------------------------------------------------------------

void World::reconstruct(std::span<const DrawTarget> targets, double interpolation, const Vec3& origin) const {
  require_fraction(interpolation, "reconstruct");
  require_finite(origin, "reconstruct", "origin");
  impl_->prepare_drawing(targets);
  std::size_t numbers = 0;
  for (const Impl::Drawn& d : impl_->drawn)
    numbers += static_cast<std::size_t>(impl_->groups[static_cast<std::size_t>(d.group)]->model().modes());
  if (impl_->drawn_amplitudes.size() < numbers) impl_->drawn_amplitudes.resize(numbers);

  impl_->reconstruction.clear();
  double* amplitudes = impl_->drawn_amplitudes.data();
  for (const Impl::Drawn& d : impl_->drawn) {
    const DrawTarget& target = targets[d.target];
    RigidTransform X_OB = interpolated_pose(target.id, interpolation);
    X_OB.p -= origin;
    impl_->interpolate(target.id, interpolation, amplitudes);
    impl_->reconstruction.push_back(
        {X_OB, amplitudes, target.positions.data(), target.normals.empty() ? nullptr : target.normals.data()});
    amplitudes += model(target.id).modes();
  }
  const auto& drawn = impl_->drawn;
  for (std::size_t begin = 0, end = 0; begin < drawn.size(); begin = end) {
    while (end < drawn.size() && drawn[end].group == drawn[begin].group) ++end;
    limber::reconstruct(impl_->groups[static_cast<std::size_t>(drawn[begin].group)]->model().render(),
                        std::span(impl_->reconstruction).subspan(begin, end - begin), *impl_->jobs);
  }
}

void World::reconstruct(BodyId id, std::span<float> positions, std::span<float> normals, double interpolation,
                        const Vec3& origin) const {
  const DrawTarget target{id, positions, normals};
  reconstruct({&target, 1}, interpolation, origin);
}

RigidTransform World::interpolated_pose(BodyId id, double interpolation) const {
  const Impl::Entry& e = impl_->entry(id, "interpolated_pose");
  require_fraction(interpolation, "interpolated_pose");
  const RigidTransform& newest = impl_->group(e).frame(e.slot).pose();
  if (interpolation == 1.0) return newest;
  const RigidTransform& previous = impl_->group(e).previous_pose(e.slot);
  return {slerp(previous.q, newest.q, interpolation), previous.p + interpolation * (newest.p - previous.p)};
}

void World::interpolated_amplitudes(BodyId id, double interpolation, std::span<float> amplitudes) const {
  const Impl::Entry& e = impl_->entry(id, "interpolated_amplitudes");
  require_fraction(interpolation, "interpolated_amplitudes");
  require_count(amplitudes.size(), static_cast<std::size_t>(impl_->group(e).model().modes()), "interpolated_amplitudes",
                "amplitudes");
  impl_->interpolate(id, interpolation, amplitudes.data());
}

std::uint64_t World::state_hash() const {
  Hash hash;
  hash.add(impl_->steps);
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
  for (const ContactMemory& contact : impl_->contacts.memory()) {
    hash.add(contact.id);
    hash.add(contact.force);
  }
  for (const StrikeMemory& strike : impl_->contacts.strikes()) hash.add(strike.since);
  return hash.value();
}

}  // namespace limber
