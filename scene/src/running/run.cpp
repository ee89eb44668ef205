#include "limber/scene/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "limber/collision/contact_finder.h"
#include "limber/core/error.h"
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

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

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

class Run {
 public:
  Run(const Scene& scene, const SceneModels& models, const RunOptions& options)
      : scene_(scene),
        models_(models),
        options_(options),
        world_({.step = scene.step, .substeps = scene.substeps, .gravity = scene.gravity, .sleep = scene.sleep},
               options.jobs ? *options.jobs : serial_jobs()),
        steps_(options.steps < 0 ? scene.steps : options.steps) {
    add_bodies();
    add_statics();
    add_joints();
    plan_loads();
    plan_handles();
    start_tracks();
  }

  RunResult play() {
    keep_key(0);
    for (std::int64_t n = 0; n < steps_; ++n) {
      move_frames(n);
      strike(n);
      push(n);
      held_.hold(world_, n);
      const auto began = Clock::now();
      world_.step();
      result_.seconds_advance += seconds_since(began);
      held_.note(world_, n);
      note_joints();
      note_contacts(n);
      if ((n + 1) % stride_ == 0 || n + 1 == steps_) keep_key(n + 1);
    }
    return finish();
  }

 private:
  void add_bodies() {
    if (scene_.contact) world_.set_contact_source(&finder_, *scene_.contact);
    if (models_.of_body.size() != scene_.bodies.size())
      throw InvalidArgument("run_scene: there are " + std::to_string(models_.of_body.size()) +
                            " models, expected one per body, " + std::to_string(scene_.bodies.size()));
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i) {
      const SceneBody& body = scene_.bodies[i];
      BodyPlacement placement = start_of(body);
      if (i < models_.shape_of_body.size()) placement.shape = models_.shape_of_body[i];
      ids_.push_back(world_.add_body(models_.of_body[i], placement));
      number(ids_.back(), i);
      if (std::holds_alternative<std::monostate>(body.movement)) continue;
      if (models_.of_body[i]->data().motion == FrameMotion::kFree)
        throw InputError(body.where + ".motion: the body \"" + body.name +
                         "\" has no fixed nodes, expected none or an asset baked with --fix");
      moved_.push_back({i, start_of(body).pose});
    }
  }

  /// Contacts tell bodies by the indices of their ids.
  void number(BodyId id, std::size_t in_trajectory) {
    number_of_.resize(std::max<std::size_t>(number_of_.size(), id.index + 1));
    number_of_[id.index] = in_trajectory;
  }

  void add_statics() {
    for (std::size_t i = 0; i < scene_.statics.size(); ++i) {
      const SceneStatic& s = scene_.statics[i];
      const auto& shape = models_.shape_of_static[i];
      number(world_.add_static(shape, s.pose, s.filter, s.friction), scene_.bodies.size() + i);
      result_.trajectory.statics.push_back({s.name, shape, s.pose});
    }
  }

  BodyId body_named(const std::string& name) const {
    BodyId id;
    if (!name.empty()) for_bodies_named(name, [&](std::size_t body) { id = ids_[body]; });
    return id;
  }

  void add_joints() {
    for (const SceneJoint& j : scene_.joints) {
      const JointAttachment patch{.radius = j.patch_radius};
      joints_.push_back(world_.add_joint(body_named(j.a), body_named(j.b), j.spec, patch, patch, j.collide));
      for (std::size_t c = 0; c < j.coordinates.size(); ++c)
        world_.set_joint_actuation(joints_.back(), static_cast<int>(c), j.coordinates[c]);
      result_.joints.push_back({.a = j.a, .b = j.b, .view = {}});
    }
  }

  void plan_handles() {
    for (const SceneHandle& h : scene_.handles)
      for_bodies_named(h.body, [&](std::size_t body) { held_.plan(h, ids_[body], scene_.bodies[body].name); });
    held_.begin(scene_.step, steps_);
  }

  /// A first pose key at time 0 is where the body starts.
  static BodyPlacement start_of(const SceneBody& body) {
    BodyPlacement placement = body.placement;
    if (const auto* keys = std::get_if<std::vector<PoseKey>>(&body.movement); keys && keys->front().time == 0.0)
      placement.pose = keys->front().pose;
    return placement;
  }

  template <class F>
  void for_bodies_named(const std::string& name, F&& visit) const {
    for (std::size_t i = 0; i < scene_.bodies.size(); ++i)
      if (scene_.bodies[i].name == name || scene_.bodies[i].group == name) visit(i);
  }

  void plan_loads() {
    for (const Strike& s : scene_.strikes)
      for_bodies_named(s.body, [&](std::size_t body) {
        strikes_.push_back({.when = time_in_steps(s.time, scene_.step), .strike = &s, .body = body});
      });
    for (const HeldForce& f : scene_.forces)
      for_bodies_named(f.body, [&](std::size_t body) {
        forces_.push_back({.first = step_at_or_after(f.start, scene_.step),
                           .end = step_at_or_after(f.start + f.duration, scene_.step),
                           .force = &f,
                           .body = body,
                           .at = {}});
      });
    std::erase_if(strikes_, [&](const PlannedStrike& s) { return s.when.step >= steps_; });
    std::erase_if(forces_, [&](const PlannedForce& f) { return f.first >= steps_; });
    result_.strikes.resize(strikes_.size());
    result_.forces.resize(forces_.size());
    for (std::size_t i = 0; i < strikes_.size(); ++i) strikes_[i].order = i;
    for (std::size_t i = 0; i < forces_.size(); ++i) forces_[i].order = i;
    std::stable_sort(strikes_.begin(), strikes_.end(),
                     [](const auto& a, const auto& b) { return a.when.step < b.when.step; });
  }

  void start_tracks() {
    constexpr double kMostBytes = 4.0 * (1ull << 30);
    stride_ = std::max<std::int64_t>(steps_, 1);
    if (options_.key_rate > 0.0) {
      const double wanted = std::round(1.0 / (options_.key_rate * scene_.step));
      stride_ = static_cast<std::int64_t>(std::clamp(wanted, 1.0, static_cast<double>(stride_)));
    }
    const double keys = std::ceil(static_cast<double>(steps_) / static_cast<double>(stride_)) + 1.0;
    double bytes = 0.0;
    Trajectory& t = result_.trajectory;
    t.scene = scene_.name;
    t.step = scene_.step;
    t.key_interval = scene_.step * static_cast<double>(stride_);
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      BodyTrack track;
      track.name = scene_.bodies[i].name;
      track.model = models_.of_body[i];
      bytes += keys * (sizeof(RigidTransform) + sizeof(Vec3) + sizeof(BodyEnergy) + 16.0 * track.model->modes());
      t.bodies.push_back(std::move(track));
    }
    if (bytes > kMostBytes)
      throw InvalidArgument("key rate: is " + std::to_string(options_.key_rate) + " Hz, which would keep " +
                            std::to_string(static_cast<std::int64_t>(bytes / (1 << 30))) +
                            " GiB of states, expected at most 4 GiB");
  }

  void move_frames(std::int64_t n) {
    const double t = static_cast<double>(n) * scene_.step;
    for (const MovedBody& m : moved_)
      world_.set_kinematic_frame(ids_[m.body],
                                 frame_over_step(scene_.bodies[m.body].movement, m.start, t, scene_.step));
  }

  void strike(std::int64_t n) {
    for (; next_strike_ < strikes_.size() && strikes_[next_strike_].when.step == n; ++next_strike_) {
      const PlannedStrike& p = strikes_[next_strike_];
      const BodyId id = ids_[p.body];
      const SurfacePoint at = find_place(p.strike->at, world_, id, p.strike->where);
      world_.apply_impulse(id, at, p.strike->impulse, p.strike->axes, p.when.delay);
      result_.strikes[p.order] = {scene_.bodies[p.body].name, n, p.when.delay, world_.position(id, at)};
    }
  }

  void push(std::int64_t n) {
    for (PlannedForce& f : forces_) {
      if (n < f.first || n >= f.end) continue;
      const BodyId id = ids_[f.body];
      if (n == f.first) {
        f.at = find_place(f.force->at, world_, id, f.force->where);
        result_.forces[f.order] = {scene_.bodies[f.body].name, n, 0.0, world_.position(id, f.at)};
      }
      world_.apply_force(id, f.at, f.force->force, f.force->axes);
    }
  }

  void note_joints() {
    for (std::size_t i = 0; i < joints_.size(); ++i) {
      JointReport& report = result_.joints[i];
      report.view = world_.joint(joints_[i]);
      report.largest_distance_error = std::max(report.largest_distance_error, report.view.distance_error);
      report.largest_angle_error = std::max(report.largest_angle_error, report.view.angle_error);
    }
  }

  void note_contacts(std::int64_t n) {
    ConstraintSummary& sum = result_.constraints;
    const ConstraintReport report = world_.constraint_report();
    if (!report.solved) ++sum.unsettled;
    sum.energy_removed += report.energy_removed;
    for (const ContactEvent& e : world_.contact_events()) {
      if (e.phase == ContactPhase::kBegun) ++sum.begun;
      if (e.phase == ContactPhase::kEnded) ++sum.ended;
      sum.largest_impulse = std::max(sum.largest_impulse, e.impulse.norm());
      if (options_.keep_contacts)
        result_.trajectory.contacts.push_back({.time = static_cast<double>(n + 1) * scene_.step,
                                               .a = number_of_[static_cast<std::size_t>(e.a)],
                                               .b = number_of_[static_cast<std::size_t>(e.b)],
                                               .phase = e.phase,
                                               .position = e.position,
                                               .normal = e.normal,
                                               .impulse = e.impulse});
    }
  }

  void keep_key(std::int64_t n) {
    result_.trajectory.times.push_back(static_cast<double>(n) * scene_.step);
    for (std::size_t i = 0; i < ids_.size(); ++i) {
      BodyTrack& track = result_.trajectory.bodies[i];
      const BodyView view = world_.body(ids_[i]);
      track.poses.push_back(view.pose);
      track.angular_velocities.push_back(view.angular_velocity);
      track.amplitudes.insert(track.amplitudes.end(), view.amplitudes.begin(), view.amplitudes.end());
      track.rates.insert(track.rates.end(), view.rates.begin(), view.rates.end());
      track.energies.push_back(world_.energy(ids_[i]));
      if (!std::isfinite(track.energies.back().total()))
        throw ComputationError(scene_.bodies[i].where + ": the body's energy is not finite after " + std::to_string(n) +
                               " steps, its place, its velocity, gravity or a load is too large");
    }
    if (options_.reconstruct) reconstruct_all();
    if (options_.progress && steps_ > 0) options_.progress(static_cast<double>(n) / static_cast<double>(steps_));
  }

  void reconstruct_all() {
    for (const BodyId id : ids_) {
      const auto vertices = static_cast<std::size_t>(world_.model(id).render().vertices());
      positions_.resize(std::max(positions_.size(), 3 * vertices));
      normals_.resize(positions_.size());
      const auto began = Clock::now();
      world_.reconstruct(id, std::span(positions_).first(3 * vertices), std::span(normals_).first(3 * vertices));
      result_.seconds_reconstruct += seconds_since(began);
      result_.reconstructed_vertices += static_cast<std::int64_t>(vertices);
    }
  }

  RunResult finish() {
    result_.steps = steps_;
    result_.state_hash = world_.state_hash();
    result_.handles = held_.reports();
    result_.asleep = std::count_if(ids_.begin(), ids_.end(), [&](BodyId id) { return world_.is_asleep(id); });
    for (const BodyTrack& track : result_.trajectory.bodies) {
      result_.energy_before += track.energies.front().total();
      result_.energy_after += track.energies.back().total();
    }
    return std::move(result_);
  }

  const Scene& scene_;
  const SceneModels& models_;
  const RunOptions& options_;
  ContactFinder finder_;  // outlives the world
  World world_;
  std::int64_t steps_ = 0, stride_ = 1;
  std::vector<BodyId> ids_;
  std::vector<std::size_t> number_of_;  // in the trajectory, by BodyId::index
  std::vector<JointId> joints_;
  HeldPoints held_;
  std::vector<PlannedStrike> strikes_;
  std::vector<PlannedForce> forces_;
  std::size_t next_strike_ = 0;
  std::vector<MovedBody> moved_;
  std::vector<float> positions_, normals_;
  RunResult result_;
};

}  // namespace

void RunOptions::validate() const {
  if (steps < -1) throw InvalidArgument("RunOptions.steps: is " + std::to_string(steps) + ", expected >= 0, or -1");
  if (!(key_rate >= 0.0) || !std::isfinite(key_rate))
    throw InvalidArgument("RunOptions.key_rate: is " + std::to_string(key_rate) + ", expected a finite number >= 0");
}

RunResult run_scene(const Scene& scene, const SceneModels& models, const RunOptions& options) {
  options.validate();
  return Run(scene, models, options).play();
}

}  // namespace limber
