#include "limber/scene/scene_player.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#if LIMBER_HAS_FCL
#include "limber/collision_fcl/fcl_contact_source.h"
#endif
#include "limber/core/error.h"
#include "limber/core/state_archive.h"
#if LIMBER_HAS_HAUSER
#include "limber/hauser/hauser_method.h"
#endif
#include "running/frame_movement.h"
#include "running/held_points.h"
#include "running/step_times.h"
#include "running/surface_place.h"

namespace limber {
namespace {

using internal::find_place;
using internal::frame_over_step;
using internal::HeldPoints;
using internal::step_at_or_after;
using internal::time_in_steps;
using internal::TimeInSteps;

struct PlannedStrike {
  TimeInSteps when;
  const Strike* strike = nullptr;
  std::size_t body = 0;
  std::size_t order = 0;  // in the report
};

struct PlannedForce {
  std::int64_t first = 0, end = 0;  // steps
  const HeldForce* force = nullptr;
  std::size_t body = 0;
  SurfacePoint at;  // found when it begins
  std::size_t order = 0;
};

struct MovedBody {
  std::size_t body = 0;
  RigidTransform start;
};

std::unique_ptr<ContactSource> make_finder(SceneFinder which, ContactSolver solver) {
  if (which == SceneFinder::kLimber && solver == ContactSolver::kGame) return std::make_unique<ManifoldFinder>();
  if (which == SceneFinder::kLimber) return std::make_unique<ContactFinder>();
#if LIMBER_HAS_FCL
  return std::make_unique<FclContactSource>();
#else
  throw InvalidArgument("ScenePlayer: finder is kFcl, and this build has no FCL, expected kLimber");
#endif
}

ContactOptions options_of(const Scene& scene) {
  ContactOptions options = scene.contacts.options.value_or(ContactOptions{});
  options.solver = scene.contacts.solver;
  options.small_steps = scene.contacts.small_steps;
  return options;
}

/// [H03]'s way for the islands of a scene that asks for it. @return the options of its contacts
ContactOptions take_rule(const Scene& scene, World& world) {
  const SceneContactRule& told = scene.contacts.rule;
  if (told.is_own()) return options_of(scene);
#if LIMBER_HAS_HAUSER
  // The same constants in the same order.
  const HauserMethod method({.method = static_cast<ContactMethod>(told.method),
                             .friction = static_cast<FrictionModel>(told.friction),
                             .guard = static_cast<ProgramGuard>(told.guard),
                             .penalty_frequency = told.penalty_frequency,
                             .penalty_damping = told.penalty_damping});
  world.set_island_solver(method.islands());
  return method.contacts(options_of(scene));
#else
  (void)world;
  throw InvalidArgument("ScenePlayer: contact_rule is one of [H03]'s, and this build has no limber::hauser");
#endif
}

}  // namespace

/// Strikes and forces of a scene, by the bodies that they act on.
struct PlannedLoads {
  std::vector<PlannedStrike> strikes{};  ///< by step
  std::vector<PlannedForce> forces{};
  std::uint64_t next_strike = 0;
  std::vector<LoadReport> strike_reports{}, force_reports{};
};

struct ScenePlayer::Impl {
  Impl(const Scene& s, const SceneModels& m, std::int64_t n, std::unique_ptr<World> owned, World& w)
      : scene(s),
        models(m),
        steps(n),
        finder(make_finder(s.contacts.finder, s.contacts.solver)),
        own(std::move(owned)),
        world(w) {
    add_bodies();
    for (std::size_t i = 0; i < scene.statics.size(); ++i) {
      const SceneStatic& standing = scene.statics[i];
      statics.push_back(world.add_static(models.shape_of_static[i], standing.pose, standing.filter, standing.friction));
      if (!standing.surface_velocity.isZero(0.0)) world.set_surface_velocity(statics.back(), standing.surface_velocity);
    }
    for (std::size_t i = 0; i < scene.sensors.size(); ++i)
      sensors.push_back(world.add_sensor(models.shape_of_sensor[i], scene.sensors[i].pose, scene.sensors[i].filter));
    add_joints();
    plan_loads();
    for (const SceneHandle& h : scene.handles)
      for_bodies_named(h.body, [&](std::size_t body) { held.plan(h, bodies[body], scene.bodies[body].name); });
    held.begin(scene.step, steps);
  }

  void add_bodies();
  void add_joints();
  void plan_loads();
  void move_frames();
  void strike();
  void push();
  BodyId body_named(const std::string& name) const {
    BodyId id;
    if (!name.empty()) for_bodies_named(name, [&](std::size_t body) { id = bodies[body]; });
    return id;
  }
  template <class F>
  void for_bodies_named(const std::string& name, F&& visit) const {
    for (std::size_t i = 0; i < scene.bodies.size(); ++i)
      if (scene.bodies[i].name == name || scene.bodies[i].group == name) visit(i);
  }

  const Scene& scene;
  const SceneModels& models;
  std::int64_t steps = 0, taken = 0;
  std::unique_ptr<ContactSource> finder;  // outlives the world
  std::unique_ptr<World> own;             // none: the caller's
  World& world;
  std::vector<BodyId> bodies, statics, sensors;
  std::vector<JointId> joints;
  HeldPoints held;
  PlannedLoads loads;
  std::vector<MovedBody> moved;
};

void ScenePlayer::Impl::add_bodies() {
  world.set_contact_source(scene.contacts.options ? finder.get() : nullptr, take_rule(scene, world));
  if (models.of_body.size() != scene.bodies.size())
    throw InvalidArgument("ScenePlayer: there are " + std::to_string(models.of_body.size()) +
                          " models, expected one per body, " + std::to_string(scene.bodies.size()));
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const SceneBody& body = scene.bodies[i];
    BodyPlacement placement = start_of(body);
    if (i < models.shape_of_body.size()) placement.shape = models.shape_of_body[i];
    const bool is_free = models.of_body[i]->data().motion == FrameMotion::kFree;
    if (!is_free && (placement.frame.linear_damping > 0.0 || placement.frame.locks.any()))
      throw InputError(body.where + ": the body \"" + body.name +
                       "\" has fixed nodes, expected no \"locks\" and no linear \"damping\"");
    bodies.push_back(world.add_body(models.of_body[i], placement));
    if (!body.surface_velocity.isZero(0.0)) world.set_surface_velocity(bodies.back(), body.surface_velocity);
    if (std::holds_alternative<std::monostate>(body.movement)) continue;
    if (is_free)
      throw InputError(body.where + ".motion: the body \"" + body.name +
                       "\" has no fixed nodes, expected none or an asset baked with --fix");
    moved.push_back({i, start_of(body).pose});
  }
}

void ScenePlayer::Impl::add_joints() {
  for (const SceneJoint& j : scene.joints) {
    const JointAttachment patch{.radius = j.patch_radius};
    joints.push_back(world.add_joint(body_named(j.a), body_named(j.b), j.spec, patch, patch, j.collide));
    for (std::size_t c = 0; c < j.coordinates.size(); ++c)
      world.set_joint_actuation(joints.back(), static_cast<int>(c), j.coordinates[c]);
  }
  for (const auto& [a, b] : scene.contacts.apart) world.ignore_collision(body_named(a), body_named(b), true);
}

void ScenePlayer::Impl::plan_loads() {
  for (const Strike& s : scene.strikes)
    for_bodies_named(s.body, [&](std::size_t body) {
      loads.strikes.push_back({.when = time_in_steps(s.time, scene.step), .strike = &s, .body = body});
    });
  for (const HeldForce& f : scene.forces)
    for_bodies_named(f.body, [&](std::size_t body) {
      loads.forces.push_back({.first = step_at_or_after(f.start, scene.step),
                              .end = step_at_or_after(f.start + f.duration, scene.step),
                              .force = &f,
                              .body = body,
                              .at = {}});
    });
  std::erase_if(loads.strikes, [&](const PlannedStrike& s) { return s.when.step >= steps; });
  std::erase_if(loads.forces, [&](const PlannedForce& f) { return f.first >= steps; });
  loads.strike_reports.resize(loads.strikes.size());
  loads.force_reports.resize(loads.forces.size());
  for (std::size_t i = 0; i < loads.strikes.size(); ++i) loads.strikes[i].order = i;
  for (std::size_t i = 0; i < loads.forces.size(); ++i) loads.forces[i].order = i;
  std::stable_sort(loads.strikes.begin(), loads.strikes.end(),
                   [](const auto& a, const auto& b) { return a.when.step < b.when.step; });
}

void ScenePlayer::Impl::move_frames() {
  const double t = static_cast<double>(taken) * scene.step;
  for (const MovedBody& m : moved)
    world.set_kinematic_frame(bodies[m.body], frame_over_step(scene.bodies[m.body].movement, m.start, t, scene.step));
}

void ScenePlayer::Impl::strike() {
  for (; loads.next_strike < loads.strikes.size() && loads.strikes[loads.next_strike].when.step == taken;
       ++loads.next_strike) {
    const PlannedStrike& p = loads.strikes[loads.next_strike];
    const BodyId id = bodies[p.body];
    const SurfacePoint at = find_place(p.strike->at, world, id, p.strike->where);
    world.apply_impulse(id, at, p.strike->impulse, p.strike->axes, p.when.delay);
    loads.strike_reports[p.order] = {scene.bodies[p.body].name,
                                     taken,
                                     p.when.delay,
                                     world.position(id, at),
                                     static_cast<std::size_t>(p.strike - scene.strikes.data()),
                                     p.body};
  }
}

void ScenePlayer::Impl::push() {
  for (PlannedForce& f : loads.forces) {
    if (taken < f.first || taken >= f.end) continue;
    const BodyId id = bodies[f.body];
    if (taken == f.first) {
      f.at = find_place(f.force->at, world, id, f.force->where);
      loads.force_reports[f.order] = {scene.bodies[f.body].name,
                                      taken,
                                      0.0,
                                      world.position(id, f.at),
                                      static_cast<std::size_t>(f.force - scene.forces.data()),
                                      f.body};
    }
    world.apply_force(id, f.at, f.force->force, f.force->axes);
  }
}

BodyPlacement start_of(const SceneBody& body) {
  BodyPlacement placement = body.placement;
  if (const auto* keys = std::get_if<std::vector<PoseKey>>(&body.movement); keys && keys->front().time == 0.0)
    placement.pose = keys->front().pose;
  return placement;
}

WorldOptions world_options(const Scene& scene) {
  return {.step = scene.step, .substeps = scene.substeps, .gravity = scene.gravity, .sleep = scene.sleep};
}

ScenePlayer::ScenePlayer(const Scene& scene, const SceneModels& models, std::int64_t steps, Jobs& jobs) {
  auto own = std::make_unique<World>(world_options(scene), jobs);
  World& world = *own;
  impl_ = std::make_unique<Impl>(scene, models, steps, std::move(own), world);
}
ScenePlayer::ScenePlayer(const Scene& scene, const SceneModels& models, std::int64_t steps, World& world)
    : impl_(std::make_unique<Impl>(scene, models, steps, nullptr, world)) {}
ScenePlayer::~ScenePlayer() = default;
ScenePlayer::ScenePlayer(ScenePlayer&&) noexcept = default;
ScenePlayer& ScenePlayer::operator=(ScenePlayer&&) noexcept = default;

World& ScenePlayer::world() { return impl_->world; }
const World& ScenePlayer::world() const { return impl_->world; }
std::span<const BodyId> ScenePlayer::bodies() const { return impl_->bodies; }
std::span<const BodyId> ScenePlayer::statics() const { return impl_->statics; }
std::span<const BodyId> ScenePlayer::sensors() const { return impl_->sensors; }
std::span<const JointId> ScenePlayer::joints() const { return impl_->joints; }
std::int64_t ScenePlayer::steps_taken() const { return impl_->taken; }
std::span<const LoadReport> ScenePlayer::strikes() const { return impl_->loads.strike_reports; }
std::span<const LoadReport> ScenePlayer::forces() const { return impl_->loads.force_reports; }
std::span<const HandleReport> ScenePlayer::handles() const { return impl_->held.reports(); }

void ScenePlayer::begin_step() {
  impl_->move_frames();
  impl_->strike();
  impl_->push();
  impl_->held.hold(impl_->world, impl_->taken);
}

void ScenePlayer::end_step() {
  impl_->held.note(impl_->world, impl_->taken);
  ++impl_->taken;
}

void ScenePlayer::step() {
  begin_step();
  impl_->world.step();
  end_step();
}

/// The scene's own state follows the world's; the number of the world's bytes stands at the very end.
void ScenePlayer::save_state(std::vector<std::byte>& state) const {
  impl_->world.save_state(state);
  const auto world_bytes = static_cast<std::uint64_t>(state.size());
  StateWriter writer(state);
  writer(impl_->taken, impl_->loads.next_strike);
  for (const PlannedForce& force : impl_->loads.forces) writer(force.at);
  impl_->held.save_state(writer);
  writer(world_bytes);
}

void ScenePlayer::restore_state(std::span<const std::byte> state) {
  constexpr std::size_t kLength = sizeof(std::uint64_t);
  std::uint64_t world_bytes = 0;
  if (state.size() >= kLength) StateReader(state.last(kLength))(world_bytes);
  if (state.size() < kLength || world_bytes > state.size() - kLength)
    throw InvalidArgument("ScenePlayer::restore_state: the bytes are no state of save_state()");
  impl_->world.restore_state(state.first(static_cast<std::size_t>(world_bytes)));
  StateReader reader(state.subspan(static_cast<std::size_t>(world_bytes)));
  reader(impl_->taken, impl_->loads.next_strike);
  for (PlannedForce& force : impl_->loads.forces) reader(force.at);
  impl_->held.restore_state(reader);
}

}  // namespace limber
