#include "sleep_stage.h"

#include <algorithm>
#include <utility>

#include "limber/dynamics/body_group.h"

namespace limber::internal {

void SleepStage::add(Index body) {
  const auto i = static_cast<std::size_t>(body);
  if (i >= rest_.size()) {
    rest_.resize(i + 1);
    asleep_.resize(i + 1);
  }
  rest_[i] = {};
  asleep_[i] = 0;
  ++changes_;
  awake_.reserve(rest_.capacity());
}

std::span<const Index> SleepStage::awake() {
  if (listed_ == changes_) return awake_;
  listed_ = changes_;
  awake_.clear();
  for (std::size_t i = 0; i < rest_.size(); ++i)
    if (asleep_[i] == 0 && constraints_->moves(static_cast<Index>(i))) awake_.push_back(static_cast<Index>(i));
  return awake_;
}

void SleepStage::remove(Index body) {
  wake(body);
  ++changes_, ++wakings_;
  for (std::size_t i = 0; i < supports_.size();) {
    if (supports_[i].what == body)
      wake(supports_[i].sleeper);  // and with it this support is forgotten
    else
      ++i;
  }
}

void SleepStage::wake(Index body) {
  rest_[static_cast<std::size_t>(body)].calm = 0.0;
  if (!asleep(body)) return;
  ++changes_, ++wakings_;
  while (asleep(body)) {  // once round
    Rest& r = rest_[static_cast<std::size_t>(body)];
    asleep_[static_cast<std::size_t>(body)] = 0;
    constraints_->set_asleep(body, false);
    r.calm = 0.0;
    body = std::exchange(r.next, -1);
  }
  std::erase_if(supports_, [&](const Support& s) { return !asleep(s.sleeper); });
}

void SleepStage::wake_all() {
  for (std::size_t i = 0; i < rest_.size(); ++i) wake(static_cast<Index>(i));
}

void SleepStage::update(const SleepOptions& options, double h, std::span<const ContactEvent> events) {
  const std::span<const Index> active = awake();  // as they were before any of them falls asleep here
  for (const Index body : active) {
    Rest& r = rest_[static_cast<std::size_t>(body)];
    r.pushed = r.push;
    r.push = Vec3::Zero();
  }
  for (const ContactEvent& e : events) {
    if (constraints_->moves(e.a)) rest_[static_cast<std::size_t>(e.a)].push += e.impulse;
    if (constraints_->moves(e.b)) rest_[static_cast<std::size_t>(e.b)].push -= e.impulse;
  }
  for (const Index body : active) {
    double& calm = rest_[static_cast<std::size_t>(body)].calm;
    calm = at_rest(body, options) ? calm + h : 0.0;
  }
  for (const ConstraintStage::Entry& entry : constraints_->entries())  // hands that go on by themselves
    if (entry.handle && !entry.handle->target().velocity.isZero(0.0))
      rest_[static_cast<std::size_t>(entry.handle->bodies()[0])].calm = 0.0;
  const auto ready = [&](Index body) { return calm(body) >= options.time; };
  for (int island = 0; island < constraints_->island_count(); ++island) {
    const std::span<const Index> members = constraints_->members(island);
    if (std::all_of(members.begin(), members.end(), ready)) put_to_sleep(members);
  }
  for (const Index body : active)
    if (!asleep(body) && !constraints_->constrained(body) && ready(body)) put_to_sleep({&body, 1});
  for (const ContactEvent& e : events) {
    if (e.phase == ContactPhase::kEnded) continue;
    if (asleep(e.a) && !constraints_->moves(e.b)) supports_.push_back({e.b, e.a});
    if (asleep(e.b) && !constraints_->moves(e.a)) supports_.push_back({e.a, e.b});
  }
}

bool SleepStage::at_rest(Index body, const SleepOptions& options) const {
  const ConstrainedBody& at = constraints_->states().body(body);
  const BodyGroup& group = *at.group;
  const RigidFrame& frame = group.frame(at.slot);
  const ModalModelData& data = group.model().data();
  const double radius = group.model().collision_extent().radius;
  const double speed = frame.velocity().norm() + radius * group.angular_velocity(at.slot).norm();
  if (!(speed <= options.speed)) return false;
  if (!(group.modal_motion(at.slot) <= data.mass * options.speed * options.speed)) return false;
  const Rest& r = rest_[static_cast<std::size_t>(body)];
  return (r.push - r.pushed).norm() <= data.mass * options.speed;
}

void SleepStage::save_state(std::size_t bodies, StateWriter& state) const {
  for (std::size_t i = 0; i < bodies; ++i) state(asleep_[i], rest_[i]);
  state(supports_);
}

void SleepStage::restore_state(std::size_t bodies, StateReader& state) {
  for (std::size_t i = 0; i < bodies; ++i) state(asleep_[i], rest_[i]);
  state(supports_);
  ++changes_, ++wakings_;
}

void SleepStage::put_to_sleep(std::span<const Index> members) {
  ++changes_;
  for (std::size_t m = 0; m < members.size(); ++m) {
    Rest& r = rest_[static_cast<std::size_t>(members[m])];
    r.push = r.pushed = Vec3::Zero();
    asleep_[static_cast<std::size_t>(members[m])] = 1;
    r.next = members[(m + 1) % members.size()];
    constraints_->set_asleep(members[m], true);
  }
}

}  // namespace limber::internal
