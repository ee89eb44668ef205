#include "motion_forecast.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "tuning.h"

namespace limber::internal {
namespace {

void expect_to_stay(BodyState& state) {
  state.doubt = 0.0;
  state.end_pose = state.pose;
  state.end_amplitudes = state.amplitudes;
}

}  // namespace

bool MotionForecast::write_states(double length, int substeps, const Vec3& gravity) {
  length_ = length;
  gravity_ = gravity;
  // Velocities change at each substep's start: Σ k g h² over n of them, h = T/n.
  fall_ = 0.5 * (1.0 + 1.0 / substeps) * length * length * gravity;
  if (told_.changes != sleep_->changes()) told_ = {sleep_->changes(), 2};
  if (told_.left > 0) {
    --told_.left;
    write_all();
    return true;
  }
  awake_.clear();
  for (const Index body : sleep_->awake()) {
    const BodyTable::Entry& e = (*bodies_)[body];
    if (bodies_->shows(e) || !e.parts.empty()) write_awake(body);
    if (!bodies_->has_parts()) continue;
    awake_.push_back(body);
    awake_.insert(awake_.end(), e.parts.begin(), e.parts.end());
  }
  std::ranges::sort(awake_);
  return false;
}

void MotionForecast::write_all() {
  states_.resize(bodies_->size());
  end_amplitudes_.resize(bodies_->size());
  thickness_.assign(bodies_->size(), std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < bodies_->size(); ++i) {
    const auto body = static_cast<Index>(i);
    BodyTable::Entry& e = (*bodies_)[body];
    if (e.alive && e.whole >= 0) continue;  // with its whole
    states_[i] = {};
    if (!e.alive) continue;
    if (e.group < 0) {
      states_[i] = {.pose = e.pose, .asleep = std::exchange(e.placed, true)};
      expect_to_stay(states_[i]);
      continue;
    }
    thickness_[i] = e.extent.thickness;
    if (!bodies_->shows(e) && e.parts.empty()) continue;
    if (!sleep_->asleep(body)) {
      write_awake(body);
      continue;
    }
    const BodyGroup& group = bodies_->group(e);
    states_[i] = {.pose = group.frame(e.slot).pose(), .asleep = true};
    if (!e.shape) states_[i].amplitudes = group.amplitudes(e.slot);
    expect_to_stay(states_[i]);
    write_parts(body);
  }
}

/// They go as their whole goes, no point of which comes farther than its reach.
void MotionForecast::write_parts(Index body) {
  const BodyState& whole = states_[static_cast<std::size_t>(body)];
  for (const Index part : (*bodies_)[body].parts) {
    const RigidTransform& in_whole = (*bodies_)[part].pose;
    BodyState& state = states_[static_cast<std::size_t>(part)];
    state = whole;
    state.amplitudes = state.end_amplitudes = {};
    state.pose = whole.pose * in_whole;
    state.end_pose = whole.end_pose * in_whole;
  }
}

void MotionForecast::write_awake(Index body) {
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyGroup& group = bodies_->group(e);
  BodyState& state = states_[static_cast<std::size_t>(body)];
  state = {.pose = group.frame(e.slot).pose()};
  if (!e.shape) state.amplitudes = group.amplitudes(e.slot);
  state.doubt = kEngineTuning.speculative_margin * e.extent.thickness;
  const bool steady = group.frame_constants().motion == FrameMotion::kFree && (e.shape || !group.skinned(e.slot));
  if (steady)
    expect_steady(body, state);
  else
    expect_exact(body, state);
  state.end_amplitudes = end_amplitudes_[static_cast<std::size_t>(body)];
  state.reach += state.doubt + std::abs(group.frame(e.slot).settings().gravity_scale) * fall_.norm();
  write_parts(body);
}

/// A free body goes on with its velocities, by which damping brings it less far; its modes no farther than they would
/// swing by these: what lies on something does not fall.
void MotionForecast::expect_steady(Index body, BodyState& state) {
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyGroup& group = bodies_->group(e);
  const RigidFrame& frame = group.frame(e.slot);
  const double goes = Decay(frame.settings().linear_damping * length_).first,
               turns = Decay(frame.settings().angular_damping * length_).first;
  state.displacement = length_ * goes * frame.velocity();
  state.rotation = length_ * turns * frame.angular_velocity(group.frame_constants());
  state.end_pose = {quaternion_from_rotation_vector(state.rotation) * state.pose.q, state.pose.p + state.displacement};
  std::vector<double>& end = end_amplitudes_[static_cast<std::size_t>(body)];
  end.resize(state.amplitudes.size());
  const std::span<const double> rates = group.rates(e.slot), resting = group.resting_rates(e.slot);
  const std::span<const double> lambda = group.model().data().eigenvalues;
  const std::span<const double> shape = group.model().collision_extent().shape;
  double arm = e.extent.radius, bends = 0.0;
  for (std::size_t i = 0; i < end.size(); ++i) {
    const double change = (rates[i] - resting[i]) * std::min(length_, 1.0 / std::sqrt(lambda[i]));
    end[i] = state.amplitudes[i] + change;
    arm += shape[i] * std::abs(state.amplitudes[i]);
    bends += shape[i] * std::abs(change);
  }
  state.reach = 2.0 * std::sin(0.5 * std::min(state.rotation.norm(), std::numbers::pi)) * arm + bends +
                (1.0 - goes) * length_ * frame.velocity().norm();
}

/// One that is led, hangs, or bends by its skin: by itself, as far as it comes.
void MotionForecast::expect_exact(Index body, BodyState& state) {
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyGroup& group = bodies_->group(e);
  group.predict_motion(e.slot, group.own_gravity(e.slot, gravity_), length_, motion_);
  if (e.shape) motion_.set_modes({}, {}, {}, {});
  std::vector<double>& end = end_amplitudes_[static_cast<std::size_t>(body)];
  end.resize(state.amplitudes.size());
  motion_.at(length_, state.end_pose, end);
  state.displacement = length_ * group.frame(e.slot).velocity();
  state.rotation = rotation_vector(state.end_pose.q * state.pose.q.conjugate());
  const SurfaceExtent& extent = group.model().collision_extent();
  if (e.shape)
    state.reach = motion_.reach(e.extent.radius, {}, state.displacement);
  else if (!group.skinned(e.slot))
    state.reach = motion_.reach(extent.radius, extent.shape, state.displacement);
  else
    state.reach = bodies_->model_group(e).skin->reach(group.shape(e.slot), motion_, state.displacement);
}

}  // namespace limber::internal
