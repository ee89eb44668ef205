#include "step_events.h"

#include <algorithm>
#include <utility>

namespace limber::internal {
namespace {

/// The order of contacts.
struct ByKey {
  static auto key(const ContactEvent& event) { return std::tie(event.a, event.b, event.id); }
  template <class Merged>
  static auto key(const Merged& merged) {
    return key(merged.event);
  }
  template <class X, class Y>
  bool operator()(const X& x, const Y& y) const {
    return key(x) < key(y);
  }
};
constexpr ByKey kByKey;

}  // namespace

void StepEvents::begin() {
  merged_.clear();
  std::swap(events_, last_events_);
}

// Events come in the order of contacts, and so do those that are known: each list is gone through once.
void StepEvents::add(int substep, std::span<const ContactEvent> events) {
  const std::size_t known = merged_.size();
  std::size_t at = 0;
  auto last = last_events_.begin();
  for (const ContactEvent& event : events) {
    while (at < known && kByKey(merged_[at], event)) ++at;
    while (last != last_events_.end() && kByKey(*last, event)) ++last;
    const bool pressed_before =
        last != last_events_.end() && last->id == event.id && last->phase != ContactPhase::kEnded;
    if (at < known && merged_[at].event.id == event.id)
      add_to(merged_[at], event);
    else
      merged_.push_back(first_of(event, substep, pressed_before));
  }
  if (known > 0) std::sort(merged_.begin(), merged_.end(), kByKey);
}

StepEvents::Merged StepEvents::first_of(const ContactEvent& event, int substep, bool pressed_before) {
  Merged made{event, event.phase != ContactPhase::kEnded, event.phase == ContactPhase::kEnded};
  if (!made.pressed) return made;
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
  merged.event.approach = std::max(merged.event.approach, before.approach);
  merged.pressed = true;
}

/// Lists what pressed in any substep, and what has let go since it was last told to press.
void StepEvents::end() {
  events_.clear();
  for (const ContactEvent& event : released_)
    if (!std::binary_search(merged_.begin(), merged_.end(), event, kByKey)) {
      events_.push_back(event);
      events_.back().phase = ContactPhase::kEnded;
      events_.back().impulse = Vec3::Zero();
    }
  const bool released = !events_.empty();
  released_.clear();
  for (const Merged& merged : merged_) {
    events_.push_back(merged.event);
    if (merged.pressed && merged.let_go) released_.push_back(merged.event);
  }
  if (released) std::sort(events_.begin(), events_.end(), kByKey);
}

}  // namespace limber::internal
