#include "motion_forecast.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace limber::internal {

void MotionForecast::begin(double length, const Vec3& gravity) {
  length_ = length;
  gravity_ = gravity;
  expected_.resize(bodies_->size());
  for (const Index body : sleep_->awake()) expected_[static_cast<std::size_t>(body)].foreseen = false;
}

bool MotionForecast::write_states() {
  if (told_.changes != sleep_->changes()) told_.left = 2;
  told_.changes = sleep_->changes();
  if (told_.left > 0) {
    --told_.left;
    write_all_states();
    return true;
  }
  for (const Index body : sleep_->awake())
    if (bodies_->shows((*bodies_)[body])) {
      write_state(body, length_);
      expect(body);
    }
  return false;
}

void MotionForecast::write_all_states() {
  states_.resize(bodies_->size());
  motions_.resize(bodies_->size());
  for (std::size_t i = 0; i < bodies_->size(); ++i) {
    const auto body = static_cast<Index>(i);
    BodyTable::Entry& e = (*bodies_)[body];
    if (!e.alive) continue;
    if (e.group < 0) {
      states_[i] = {.pose = e.pose, .asleep = std::exchange(e.placed, true)};
      expect_to_stay(states_[i]);
      continue;
    }
    if (!bodies_->shows(e)) {
      states_[i] = {};
      continue;
    }
    write_state(body, length_);
    expect(body);
  }
}

void MotionForecast::expect_to_stay(BodyState& state) {
  state.doubt = 0.0;
  state.end_pose = state.pose;
  state.end_amplitudes = state.amplitudes;
}

void MotionForecast::write_state(Index body, double length) {
  const auto i = static_cast<std::size_t>(body);
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyGroup& bodies = bodies_->group(e);
  const RigidFrame& frame = bodies.frame(e.slot);
  states_[i] = {.pose = frame.pose(), .asleep = sleep_->asleep(body)};
  if (!e.shape) states_[i].amplitudes = bodies.amplitudes(e.slot);
  if (states_[i].asleep) {
    expect_to_stay(states_[i]);
    return;
  }
  bodies.predict_motion(e.slot, gravity_, length, motions_[i]);
  if (e.shape) motions_[i].set_modes({}, {}, {}, {});
  // Without gravity: what lies on something does not fall, and what falls has a velocity.
  states_[i].displacement = length * frame.velocity();
  states_[i].rotation = length * frame.angular_velocity(bodies.frame_constants());
  states_[i].reach = free_reach(body, states_[i].displacement);
  if (!looks_farther(body) && can_wait(body)) states_[i].look_ahead = e.extent.thickness;
}

/// How far any point of a body may come by itself beside a displacement, m.
double MotionForecast::free_reach(Index body, const Vec3& displacement) const {
  const auto i = static_cast<std::size_t>(body);
  const BodyTable::Entry& e = (*bodies_)[body];
  if (e.shape) return motions_[i].reach(e.extent.radius, {}, displacement);
  const BodyGroup& bodies = bodies_->group(e);
  const SurfaceExtent& extent = bodies.model().collision_extent();
  if (!bodies.skinned(e.slot)) return motions_[i].reach(extent.radius, extent.shape, displacement);
  return bodies_->model_group(e).skin->reach(bodies.shape(e.slot), motions_[i], displacement);
}

bool MotionForecast::can_wait(Index body) const {
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyGroup& bodies = bodies_->group(e);
  return bodies.frame_constants().motion == FrameMotion::kFree && !bodies.has_delayed_impulse(e.slot);
}

void MotionForecast::look_farther(std::span<const Index> bodies) {
  farther_.resize(bodies_->size());
  for (const Index body : bodies) farther_[static_cast<std::size_t>(body)] = 1;
}

/// Before anything is known of the step: a body that nothing held in the last step goes on by itself. Others
/// are held on for the most part: a squeezed body does not spring open. So they are expected to go on with their
/// velocities, and modes no farther than they would swing by these.
void MotionForecast::expect_unconstrained(Index body) {
  const auto i = static_cast<std::size_t>(body);
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyState& state = states_[i];
  const BodyGroup& bodies = bodies_->group(e);
  ExpectedEnd& end = expected_[i];
  const std::span<const double> z = bodies.amplitudes(e.slot), rates = bodies.rates(e.slot),
                                lambda = bodies.model().data().eigenvalues;
  end.amplitudes.resize(e.shape ? 0 : z.size());
  end.doubt = fall();
  if (!e.held) {
    motions_[i].at(length_, end.pose, end.amplitudes);
    return;
  }
  end.pose = {quaternion_from_rotation_vector(state.rotation) * state.pose.q, state.pose.p + state.displacement};
  for (std::size_t k = 0; k < end.amplitudes.size(); ++k)
    end.amplitudes[k] = z[k] + rates[k] * std::min(length_, 1.0 / std::sqrt(lambda[k]));
}

void MotionForecast::expect(Index body) {
  const auto i = static_cast<std::size_t>(body);
  BodyState& state = states_[i];
  const ExpectedEnd& end = expected_[i];
  if (state.asleep) return;
  ways_.resize(bodies_->size());
  if (!end.foreseen) expect_unconstrained(body);
  state.end_pose = end.pose;
  state.end_amplitudes = end.amplitudes;
  state.doubt = end.doubt;
  const double by_itself = state.way();
  if (end.foreseen) {
    state.displacement = end.pose.p - state.pose.p;
    state.rotation = rotation_vector(end.pose.q * state.pose.q.conjugate());
  }
  state.reach = (end.pose.p - state.pose.p - state.displacement).norm() + beside(body, end) + end.doubt;
  ways_[i] = end.foreseen || (*bodies_)[body].held ? std::min(by_itself, state.way()) : by_itself;
}

void MotionForecast::stand_still() {
  for (std::size_t i = 0; i < bodies_->size(); ++i) {
    const BodyTable::Entry& e = (*bodies_)[static_cast<Index>(i)];
    if (!e.alive || e.group < 0) continue;
    states_[i].pose = bodies_->group(e).frame(e.slot).pose();
    states_[i].reach = 0.0;
    states_[i].displacement = states_[i].rotation = Vec3::Zero();
    expect_to_stay(states_[i]);
  }
}

void MotionForecast::expect_in_part(Index body, double left, double look_ahead) {
  const auto i = static_cast<std::size_t>(body);
  write_state(body, left);
  BodyState& state = states_[i];
  ExpectedEnd& end = expected_[i];
  end.amplitudes.resize(state.amplitudes.size());
  motions_[i].at(left, end.pose, end.amplitudes);
  state.end_pose = end.pose;
  state.end_amplitudes = end.amplitudes;
  state.doubt = fall();
  state.look_ahead = look_ahead;
}

bool MotionForecast::expect_foreseen_ends() {
  bool elsewhere = false;
  for (const Index body : sleep_->awake()) {
    const auto i = static_cast<std::size_t>(body);
    if (!bodies_->shows((*bodies_)[body]) || constraints_->is_held_back(body)) continue;
    find_end(body, end_);
    ExpectedEnd& expected = expected_[i];
    const double off =
        (end_.pose.p - expected.pose.p).norm() + difference(body, expected.pose.q, expected.amplitudes, end_);
    if (!(off > expected.doubt)) continue;
    elsewhere = elsewhere || states_[i].way() < states_[i].look_ahead;
    expected.amplitudes.assign(end_.amplitudes.begin(), end_.amplitudes.end());
    expected.pose = end_.pose;
    expected.doubt = fall();
    expected.foreseen = true;
  }
  return elsewhere;
}

void MotionForecast::foreseen_end(Index body, ExpectedEnd& end) const {
  const BodyTable::Entry& e = (*bodies_)[body];
  const BodyGroup& bodies = bodies_->group(e);
  end.pose = bodies.predicted_frame(e.slot).pose();
  end.amplitudes.clear();
  if (e.shape) return;
  const std::span<const double> z = bodies.predicted_amplitudes(e.slot);
  end.amplitudes.assign(z.begin(), z.end());
}

void MotionForecast::find_end(Index body, ExpectedEnd& end) const {
  if (constraints_->constrained(body)) {
    foreseen_end(body, end);
    return;
  }
  const auto i = static_cast<std::size_t>(body);
  end.amplitudes.resize(expected_[i].amplitudes.size());
  motions_[i].at(length_, end.pose, end.amplitudes);
}

double MotionForecast::beside(Index body, const ExpectedEnd& end) const {
  const auto i = static_cast<std::size_t>(body);
  return difference(body, states_[i].pose.q, states_[i].amplitudes, end);
}

double MotionForecast::difference(Index body, const Quaternion& q, std::span<const double> z,
                                  const ExpectedEnd& end) const {
  const BodyTable::Entry& e = (*bodies_)[body];
  double arm = e.extent.radius, flexing = 0.0;
  const std::span<const double> shape = bodies_->group(e).model().collision_extent().shape;
  for (std::size_t k = 0; k < end.amplitudes.size(); ++k) {
    arm += shape[k] * std::abs(z[k]);
    flexing += shape[k] * std::abs(end.amplitudes[k] - z[k]);
  }
  return 2.0 * (end.pose.q * q.conjugate()).vector().norm() * arm + flexing;
}

}  // namespace limber::internal
