#include "limber/dynamics/exact_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "limber/core/error.h"
#include "mode_flow_kernels.h"

namespace limber {
namespace {

constexpr std::size_t kChunk = 64;  // modes whose other half of the state is let go at once

}  // namespace

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

void ExactMotion::modes_at(double t, std::size_t first, std::size_t count, double* z, double* rates) const {
  const internal::Oscillators modes{lambda_.data() + first, decay_.data() + first, count};
  internal::flow_modes(modes, t, z_.data() + first, rates_.data() + first, force_.data() + first, z, rates);
  for (std::size_t n = 0; n < impulse_times_.size(); ++n)
    if (impulse_times_[n] <= t)
      internal::add_impulse_flow(modes, t - impulse_times_[n], impulses_at(n).data() + first, z, rates);
}

double ExactMotion::amplitude(Index mode, double t) const {
  double z = 0.0, rate = 0.0;
  modes_at(t, static_cast<std::size_t>(mode), 1, &z, &rate);
  return z;
}

void ExactMotion::at(double t, RigidTransform& pose, std::span<double> amplitudes) const {
  pose = path_.pose(t);
  std::array<double, kChunk> unused;
  for (std::size_t i = 0; i < z_.size(); i += kChunk)
    modes_at(t, i, std::min(kChunk, z_.size() - i), amplitudes.data() + i, unused.data());
}

void ExactMotion::evaluate(double t, MotionState& state) const {
  state.time = t;
  state.pose = path_.pose(t);
  state.velocity = path_.velocity(t);
  state.angular_velocity = path_.angular_velocity(t);
  state.amplitudes.resize(z_.size());
  state.rates.resize(z_.size());
  modes_at(t, 0, z_.size(), state.amplitudes.data(), state.rates.data());
}

/// An impulse j that acts inside adds to the motion without it that of the mode struck at rest.
double ExactMotion::change(std::size_t i) const {
  ModeState start{z_[i], rates_[i]};
  for (std::size_t n = 0; n < impulse_times_.size(); ++n)
    if (impulse_times_[n] <= 0.0) start.zdot += impulses_at(n)[i];
  double most = largest_change(mode(i), start, force_[i], step()) + released(i);
  for (std::size_t n = 0; n < impulse_times_.size(); ++n)
    if (const double time = impulse_times_[n], j = impulses_at(n)[i]; time > 0.0 && j != 0.0)
      most += largest_change(mode(i), {.z = 0.0, .zdot = j}, 0.0, step() - time);
  return most;
}

double ExactMotion::reach(double distance, std::span<const double> shape, const Vec3& displacement) const {
  double arm = distance;
  for (std::size_t i = 0; i < z_.size(); ++i) arm += shape[i] * (std::abs(z_[i]) + released(i));
  return path_.travel_beside(displacement) + sway(arm, shape);
}

void ExactMotion::changes(std::span<double> changes) const {
  for (std::size_t i = 0; i < z_.size(); ++i) changes[i] = change(i);
}

double ExactMotion::sway(double arm, std::span<const double> shape) const {
  double flexing = 0.0;
  for (std::size_t i = 0; i < z_.size(); ++i) flexing += shape[i] * change(i);
  return 2.0 * std::sin(0.5 * path_.turn()) * arm + flexing;
}

}  // namespace limber
