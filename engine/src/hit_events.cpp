#include "hit_events.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace limber::internal {
namespace {

using Pair = std::pair<std::uint32_t, std::uint32_t>;

Pair pair_of(const HitEvent& hit) { return {hit.a.index, hit.b.index}; }
Pair pair_of(const ContactEvent& contact) {
  return {static_cast<std::uint32_t>(contact.a), static_cast<std::uint32_t>(contact.b)};
}

HitEvent make_hit(const ContactEvent& contact, const BodyTable& bodies) {
  const BodyTable::Entry &a = bodies[contact.a], &b = bodies[contact.b];
  return {.a = bodies.id(contact.a),
          .b = bodies.id(contact.b),
          .user_data_a = a.user_data,
          .user_data_b = b.user_data,
          .position = contact.position,
          .normal = contact.normal,
          .speed = contact.approach};
}

/// By pair, the fastest first, and of those as fast by place.
bool comes_before(const HitEvent& x, const HitEvent& y) {
  const auto key = [](const HitEvent& hit) {
    return std::tuple(hit.a.index, hit.b.index, -hit.speed, hit.position.x(), hit.position.y(), hit.position.z());
  };
  return key(x) < key(y);
}

}  // namespace

void HitEvents::update(std::span<const ContactEvent> contacts, double speed, const BodyTable& bodies) {
  events_.clear();
  for (const ContactEvent& contact : contacts)
    if (contact.phase == ContactPhase::kBegun && contact.approach >= speed)
      events_.push_back(make_hit(contact, bodies));
  std::sort(events_.begin(), events_.end(), comes_before);
  const auto same = [](const HitEvent& x, const HitEvent& y) { return pair_of(x) == pair_of(y); };
  events_.erase(std::unique(events_.begin(), events_.end(), same), events_.end());
  auto contact = contacts.begin();
  for (HitEvent& hit : events_) {
    while (contact != contacts.end() && pair_of(*contact) < pair_of(hit)) ++contact;
    for (; contact != contacts.end() && pair_of(*contact) == pair_of(hit); ++contact) hit.impulse += contact->impulse;
  }
}

}  // namespace limber::internal
