#include "limber/dynamics/exact_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/core/error.h"

namespace limber {

void ExactMotion::set_frame(const RigidMotion& motion, double step) {
  const Quaternion& q = motion.pose.q;
  const bool finite = motion.pose.p.allFinite() && std::isfinite(q.norm()) && q.norm() > 0.0 &&
                      motion.velocity.allFinite() && motion.acceleration.allFinite() &&
                      motion.angular_velocity.allFinite();
  if (!finite) throw InvalidArgument("ExactMotion::set_frame: motion is not finite, expected finite numbers");
  if (!(step >= 0.0 && std::isfinite(step)))
    throw InvalidArgument("ExactMotion::set_frame: step is " + std::to_string(step) + " s, expected 0 or more");
  path_.set(motion, step);
  set_modes({}, {}, {}, {});
}

void ExactMotion::set_modes(std::span<const double> lambda, std::span<const double> decay, std::span<const double> z,
                            std::span<const double> rates) {
  lambda_ = lambda;
  decay_ = decay;
  z_.assign(z.begin(), z.end());
  rates_.assign(rates.begin(), rates.end());
  force_.assign(z.size(), 0.0);
  released_.clear();
  impulse_times_.clear();
  impulses_.clear();
}

void ExactMotion::release(std::span<const double> part) {
  released_.assign(part.begin(), part.end());
  for (std::size_t i = 0; i < part.size(); ++i) z_[i] -= part[i];
}

std::span<double> ExactMotion::add_impulse(double time) {
  impulse_times_.push_back(time);
  impulses_.resize(impulses_.size() + z_.size(), 0.0);
  return {impulses_.data() + impulses_.size() - z_.size(), z_.size()};
}

ModeState ExactMotion::mode_at(std::size_t i, double t) const {
  ModeState s{z_[i], rates_[i]};
  if (t > 0.0 && (s.z != 0.0 || s.zdot != 0.0 || force_[i] != 0.0)) s = advance(propagator(mode(i), t), s, force_[i]);
  for (std::size_t n = 0; n < impulse_times_.size(); ++n) {
    const double j = impulses_at(n)[i];
    if (impulse_times_[n] > t || j == 0.0) continue;
    const ModeState change = impulse_response(mode(i), t - impulse_times_[n], j);
    s.z += change.z;
    s.zdot += change.zdot;
  }
  return s;
}

void ExactMotion::at(double t, RigidTransform& pose, std::span<double> amplitudes) const {
  pose = path_.pose(t);
  for (std::size_t i = 0; i < z_.size(); ++i) amplitudes[i] = mode_at(i, t).z;
}

void ExactMotion::rates_at(double t, Vec3& velocity, Vec3& angular_velocity, std::span<double> rates) const {
  velocity = path_.velocity(t);
  angular_velocity = path_.angular_velocity(t);
  for (std::size_t i = 0; i < z_.size(); ++i) rates[i] = mode_at(i, t).zdot;
}

void ExactMotion::evaluate(double t, MotionState& state) const {
  state.time = t;
  state.pose = path_.pose(t);
  state.velocity = path_.velocity(t);
  state.angular_velocity = path_.angular_velocity(t);
  state.amplitudes.resize(z_.size());
  state.rates.resize(z_.size());
  for (std::size_t i = 0; i < z_.size(); ++i) {
    const ModeState s = mode_at(i, t);
    state.amplitudes[i] = s.z;
    state.rates[i] = s.zdot;
  }
}

double ExactMotion::smooth_until(double t) const {
  double until = path_.smooth_until(t);
  for (const double time : impulse_times_)
    if (time > t) until = std::min(until, time);
  return until;
}

/// An impulse j that acts inside adds its own motion to that without it: |ż| ≤ |j|, and |z| is at most that of the
/// mode struck at rest.
ModeBound ExactMotion::bound(std::size_t i, const ModeState& from, double t0, double t1) const {
  ModeBound b = bound_motion(mode(i), from, force_[i], t1 - t0);
  for (std::size_t n = 0; n < impulse_times_.size(); ++n) {
    const double time = impulse_times_[n], j = impulses_at(n)[i];
    if (time <= t0 || time > t1 || j == 0.0) continue;
    const ModeBound answer = bound_motion(mode(i), {.z = 0.0, .zdot = j}, 0.0, t1 - time);
    b.change += answer.change;
    b.size += answer.size;
    b.rate += answer.rate;
    if (time < t1) b.acceleration = std::numeric_limits<double>::infinity();
  }
  return b;
}

void ExactMotion::bounds(const MotionState& from, double until, MotionBounds& bounds) const {
  bounds.frame = path_.bounds(from.time, until);
  bounds.modes.resize(z_.size());
  for (std::size_t i = 0; i < z_.size(); ++i)
    bounds.modes[i] = bound(i, {from.amplitudes[i], from.rates[i]}, from.time, until);
}

double ExactMotion::reach(double distance, std::span<const double> shape, const Vec3& displacement) const {
  double arm = distance;
  for (std::size_t i = 0; i < z_.size(); ++i) arm += shape[i] * (std::abs(z_[i]) + released(i));
  return path_.travel_beside(displacement) + sway(arm, shape);
}

void ExactMotion::changes(std::span<double> change) const {
  for (std::size_t i = 0; i < z_.size(); ++i) change[i] = bound(i, mode_at(i, 0.0), 0.0, step()).change + released(i);
}

double ExactMotion::sway(double arm, std::span<const double> shape) const {
  double flexing = 0.0;
  for (std::size_t i = 0; i < z_.size(); ++i)
    flexing += shape[i] * (bound(i, mode_at(i, 0.0), 0.0, step()).change + released(i));
  return 2.0 * std::sin(0.5 * path_.bounds(0.0, step()).turn) * arm + flexing;
}

}  // namespace limber
