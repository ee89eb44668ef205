#include "passing_bodies.h"

#include <algorithm>
#include <tuple>

namespace limber::internal {

void PassingBodies::leave_out(std::span<const char> asleep, std::span<const ContactPoint> found) {
  const auto waiting = [&](Index body) { return waits[static_cast<std::size_t>(body)] != 0; };
  contacts.clear();
  std::ranges::copy_if(found, std::back_inserter(contacts),
                       [&](const ContactPoint& c) { return !waiting(c.a.body) && !waiting(c.b.body); });
  rests.assign(asleep.begin(), asleep.end());
  for (const Index member : members) rests[static_cast<std::size_t>(member)] = 1;
}

void PassingBodies::list_touching(std::span<const ContactPoint> in_force, double within) {
  touching.clear();
  for (const ContactPoint& c : in_force) {
    const std::pair pair(c.a.body, c.b.body);
    if (c.gap <= within || std::ranges::find(crept, pair) != crept.end()) touching.push_back(pair);
  }
  std::ranges::sort(touching);
  const auto [begin, end] = std::ranges::unique(touching);
  touching.erase(begin, end);
}

/// Half-spaces are planes for good.
void PassingBodies::drop_planes() {
  std::erase_if(touches, [&](const Impact& touch) {
    return planes[static_cast<std::size_t>(touch.a)] != 0 || planes[static_cast<std::size_t>(touch.b)] != 0;
  });
}

/// A motion that has been cut is another one: it is to stay clear of what the first came near, by half as much.
double PassingWatch::clear_until(const FreeMotions& found, double length) {
  if (passing_.frames.size() < found.members.size()) passing_.frames.resize(found.members.size());
  for (std::size_t i = 0; i < found.members.size(); ++i) {
    const auto body = static_cast<std::size_t>(found.members[i]);
    passing_.motions[body] = &found.motions[i];
    if (passing_.wears_shape[body] == 0) continue;
    passing_.frames[i] = found.motions[i];
    passing_.frames[i].set_modes({}, {}, {}, {});
    passing_.motions[body] = &passing_.frames[i];
  }
  const double until = first_turned(found, length);
  source_.find_impacts({.states = states_,
                        .motions = passing_.motions,
                        .step = until,
                        .margin = margin_,
                        .least_margin = passing_.least_margin(),
                        .bodies = found.members,
                        .except = passing_.touching},
                       passing_.touches, serial_jobs());
  for (const Index member : found.members) passing_.motions[static_cast<std::size_t>(member)] = nullptr;
  passing_.drop_planes();
  touch_ = {};
  if (passing_.touches.empty()) return until;
  touch_ = passing_.touches.front();
  if (touch_.resting) passing_.crept.emplace_back(touch_.a, touch_.b);
  margin_ *= PassingBodies::kNearer;
  return touch_.time;
}

/// When a body may have turned too far of a pair that is not looked at, as it touches.
double PassingWatch::first_turned(const FreeMotions& found, double length) const {
  double until = length;
  for (const auto& [a, b] : passing_.touching)
    for (const Index body : {a, b}) {
      const ExactMotion* motion = found.of(body);
      if (motion == nullptr || passing_.turns[static_cast<std::size_t>(body)] == 0) continue;
      const double speed = motion->path().bounds(0.0, until).angular_speed;
      if (speed * until > PassingBodies::kMostTurn) until = PassingBodies::kMostTurn / speed;
    }
  return until;
}

}  // namespace limber::internal
