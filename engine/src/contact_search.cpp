#include "contact_search.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace limber::internal {

/// Bodies that sleep are not tested with each other, so those that wake are to be looked at again.
void ContactSearch::find(const Substep& substep, int parts, ContactRows& rows, Jobs& jobs, StageClock& clock) {
  do {
    const bool told_all = forecast_.write_states(substep.length, parts, substep.gravity);
    if (told_all || rows.stale) rows.note_surfaces(*bodies_);
    clock.lap(Stage::kLookAhead, std::ssize(sleep_->awake()));
    StageTimes theirs;
    registry_->source()->find_contacts({.states = forecast_.states(),
                                        .fall = forecast_.fall(),
                                        .awake = told_all ? std::span<const Index>() : forecast_.awake(),
                                        .times = clock.runs() ? &theirs : nullptr},
                                       found_, jobs);
    if (bodies_->has_parts()) give_to_wholes();
    if (registry_->has_veto())
      std::erase_if(found_, [this](const ContactPoint& contact) { return !registry_->acts(contact); });
    clock.lap(theirs, Stage::kNarrowPhase);
  } while (wake_touched());
}

/// Contacts of compounds' parts become those of the bodies.
void ContactSearch::give_to_wholes() {
  const auto give = [this](ContactSide& side) {
    const BodyTable::Entry& e = (*bodies_)[side.body];
    if (e.whole < 0) return;
    side.body = e.whole;
    side.point_B = e.pose * side.point_B;
  };
  for (ContactPoint& contact : found_) {
    give(contact.a), give(contact.b);
    if (contact.a.body <= contact.b.body) continue;
    std::swap(contact.a, contact.b);
    contact.normal = -contact.normal;
  }
  std::sort(found_.begin(), found_.end(), [](const ContactPoint& x, const ContactPoint& y) {
    return std::tie(x.a.body, x.b.body, x.id) < std::tie(y.a.body, y.b.body, y.id);
  });
}

bool ContactSearch::wake_touched() {
  bool woke = false;
  for (const ContactPoint& contact : found_)
    for (const Index body : {contact.a.body, contact.b.body})
      if (sleep_->asleep(body)) {
        sleep_->wake(body);
        woke = true;
      }
  return woke;
}

}  // namespace limber::internal
