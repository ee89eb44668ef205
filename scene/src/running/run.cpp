#include "limber/scene/run.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <tuple>

#include "limber/core/error.h"

namespace limber {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

double beyond(const Interval& range, double x) { return std::max({range.low - x, x - range.high, 0.0}); }

/// @param q coordinates as in joint_constraint.h
double limit_excess(const JointSpec& joint, const std::array<double, 3>& q) {
  const JointLimits& limits = joint.limits;
  switch (joint.type) {
    case JointType::kRevolute:
      return beyond(limits.rotation, q[0]);
    case JointType::kCylindrical:
      return std::max(beyond(limits.rotation, q[0]), beyond(limits.translation[0], q[1]));
    case JointType::kPrismatic:
      return beyond(limits.translation[0], q[0]);
    case JointType::kPlanar:
      return std::max(
          {beyond(limits.translation[0], q[0]), beyond(limits.translation[1], q[1]), beyond(limits.rotation, q[2])});
    case JointType::kBall: {
      double most = std::acos(std::clamp(std::cos(q[1]) * std::cos(q[2]), -1.0, 1.0)) - limits.cone;
      for (std::size_t i = 0; i < 3; ++i) most = std::max(most, beyond(limits.euler[i], q[i]));
      return std::max(most, 0.0);
    }
    case JointType::kFixed:
      break;
  }
  return 0.0;
}

class Run {
 public:
  Run(const Scene& scene, const SceneModels& models, const RunOptions& options)
      : scene_(scene),
        models_(models),
        options_(options),
        steps_(options.steps < 0 ? scene.steps : options.steps),
        player_(scene, models, steps_, options.jobs ? *options.jobs : serial_jobs()) {
    number_bodies();
    for (const SceneJoint& j : scene_.joints) result_.joints.push_back({.a = j.a, .b = j.b, .view = {}});
    start_tracks();
  }

  RunResult play() {
    keep_key(0);
    for (std::int64_t n = 0; n < steps_; ++n) {
      player_.begin_step();
      const auto began = Clock::now();
      world_.step();
      result_.seconds_advance += seconds_since(began);
      player_.end_step();
      note_joints();
      note_contacts(n);
      note_sensors(n);
      note_blows();
      note_sleepers();
      if (options_.reconstruct_every_step) reconstruct_all();
      if ((n + 1) % stride_ == 0 || n + 1 == steps_) keep_key(n + 1);
    }
    return finish();
  }

 private:
  void note_blows() {
    if (!options_.keep_blows) return;
    list_blows(scene_, player_, ids_, number_of_, result_.trajectory.blows);
    list_slides(scene_, player_, ids_, number_of_, result_.trajectory.blows);
  }

  /// Contacts tell bodies by the indices of their ids; sensors have numbers of their own.
  void number_bodies() {
    const auto number = [&](BodyId id, std::size_t in_trajectory) {
      number_of_.resize(std::max<std::size_t>(number_of_.size(), id.index + 1));
      number_of_[id.index] = in_trajectory;
    };
    for (std::size_t i = 0; i < ids_.size(); ++i) number(ids_[i], i);
    for (std::size_t i = 0; i < scene_.statics.size(); ++i) {
      number(player_.statics()[i], scene_.bodies.size() + i);
      result_.trajectory.statics.push_back(
          {scene_.statics[i].name, models_.shape_of_static[i], scene_.statics[i].pose});
    }
    for (std::size_t i = 0; i < scene_.sensors.size(); ++i) {
      number(player_.sensors()[i], i);
      result_.trajectory.sensors.push_back(scene_.sensors[i].name);
    }
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
      track.modal_skin = world_.has_modal_skin(ids_[i]);
      bytes += keys * (sizeof(RigidTransform) + sizeof(Vec3) + sizeof(BodyEnergy) + 16.0 * track.model->modes());
      t.bodies.push_back(std::move(track));
    }
    if (bytes > kMostBytes)
      throw InvalidArgument("key rate: is " + std::to_string(options_.key_rate) + " Hz, which would keep " +
                            std::to_string(static_cast<std::int64_t>(bytes / (1 << 30))) +
                            " GiB of states, expected at most 4 GiB");
  }

  void note_joints() {
    for (std::size_t i = 0; i < player_.joints().size(); ++i) {
      JointReport& report = result_.joints[i];
      report.view = world_.joint(player_.joints()[i]);
      report.largest_distance_error = std::max(report.largest_distance_error, report.view.distance_error);
      report.largest_angle_error = std::max(report.largest_angle_error, report.view.angle_error);
      report.largest_limit_excess =
          std::max(report.largest_limit_excess, limit_excess(scene_.joints[i].spec, report.view.position));
    }
  }

  void note_contacts(std::int64_t n) {
    ConstraintSummary& sum = result_.constraints;
    const ConstraintReport report = world_.constraint_report();
    const IslandStatus worst = report.statuses.worst();
    if (worst == IslandStatus::kLimit) ++sum.limit_steps;
    if (worst == IslandStatus::kFailed) ++sum.failed_steps;
    sum.largest_residual = std::max(sum.largest_residual, report.residual);
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

  void note_sensors(std::int64_t n) {
    for (const SensorEvent& e : world_.sensor_events())
      result_.trajectory.sensor_events.push_back({.time = static_cast<double>(n + 1) * scene_.step,
                                                  .sensor = number_of_[e.sensor.index],
                                                  .body = number_of_[e.body.index],
                                                  .began = e.began});
  }

  void note_sleepers() {
    if (!scene_.sleep.enabled) return;
    result_.asleep = std::count_if(ids_.begin(), ids_.end(), [&](BodyId id) { return world_.is_asleep(id); });
    result_.asleep_steps += result_.asleep;
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
    result_.strikes.assign(player_.strikes().begin(), player_.strikes().end());
    result_.forces.assign(player_.forces().begin(), player_.forces().end());
    result_.handles.assign(player_.handles().begin(), player_.handles().end());
    for (const BodyTrack& track : result_.trajectory.bodies) {
      result_.energy_before += track.energies.front().total();
      result_.energy_after += track.energies.back().total();
    }
    return std::move(result_);
  }

  const Scene& scene_;
  const SceneModels& models_;
  const RunOptions& options_;
  std::int64_t steps_ = 0, stride_ = 1;
  ScenePlayer player_;
  World& world_ = player_.world();
  std::span<const BodyId> ids_ = player_.bodies();
  std::vector<std::size_t> number_of_;  // in the trajectory, by BodyId::index
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
