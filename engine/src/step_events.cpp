#include "step_events.h"

#include <algorithm>
#include <utility>

namespace limber::internal {
namespace {

struct ById {
  static std::uint64_t id(const ContactEvent& event) { return event.id; }
  template <class Merged>
  static std::uint64_t id(const Merged& merged) {
    return merged.event.id;
  }
  template <class X, class Y>
  bool operator()(const X& x, const Y& y) const {
    return id(x) < id(y);
  }
};
constexpr ById kById;

}  // namespace

void StepEvents::begin() {
  merged_.clear();
  std::swap(events_, last_events_);
}

void StepEvents::add(int substep, std::span<const ContactEvent> events) {
  const std::size_t known = merged_.size();
  for (const ContactEvent& event : events) {
    const auto end = merged_.begin() + static_cast<std::ptrdiff_t>(known);
    const auto found = std::lower_bound(merged_.begin(), end, event, kById);
    if (found != end && found->event.id == event.id)
      add_to(*found, event);
    else
      merged_.push_back(first_of(event, substep));
  }
  std::sort(merged_.begin(), merged_.end(), kById);
}

StepEvents::Merged StepEvents::first_of(const ContactEvent& event, int substep) const {
  Merged made{event, event.phase != ContactPhase::kEnded, event.phase == ContactPhase::kEnded};
  if (!made.pressed) return made;
  const auto last = std::lower_bound(last_events_.begin(), last_events_.end(), event, kById);
  const bool pressed_before = last != last_events_.end() && last->id == event.id && last->phase != ContactPhase::kEnded;
  const bool lasting = pressed_before || (substep == 0 && event.phase == ContactPhase::kLasting);
  made.event.phase = lasting ? ContactPhase::kLasting : ContactPhase::kBegun;
  return made;
}

void StepEvents::add_to(Merged& merged, const ContactEvent& event) {
  merged.let_go = event.phase == ContactPhase::kEnded;
  if (merged.let_go) return;
  const ContactEvent before = merged.event;
  merged.event = event;
  merged.event.impulse += before.impulse;
  merged.event.phase = merged.pressed ? before.phase : ContactPhase::kLasting;
  merged.pressed = true;
}

/// Lists what pressed in any substep, and what has let go since it was last told to press.
void StepEvents::end() {
  events_.clear();
  for (const ContactEvent& event : released_)
    if (!std::binary_search(merged_.begin(), merged_.end(), event, kById)) {
      events_.push_back(event);
      events_.back().phase = ContactPhase::kEnded;
      events_.back().impulse = Vec3::Zero();
    }
  released_.clear();
  for (const Merged& merged : merged_) {
    events_.push_back(merged.event);
    if (merged.pressed && merged.let_go) released_.push_back(merged.event);
  }
  std::sort(events_.begin(), events_.end(), kById);
}

}  // namespace limber::internal
