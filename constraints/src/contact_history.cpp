#include "contact_history.h"

namespace limber {
namespace {

/// ½ c F² of each, to the body that yields.
void find_energy(std::span<const ContactMemory> of, std::vector<double>& energy) {
  std::ranges::fill(energy, 0.0);
  for (const ContactMemory& m : of)
    if (m.compliance > 0.0) energy[static_cast<std::size_t>(m.yielding)] += 0.5 * m.compliance * m.force.squaredNorm();
}

}  // namespace

bool rests(std::span<const char> asleep, Index a, Index b) {
  const auto sleeps = [&](Index body) {
    return static_cast<std::size_t>(body) < asleep.size() && asleep[static_cast<std::size_t>(body)] != 0;
  };
  return sleeps(a) || sleeps(b);
}

void ContactHistory::reserve(std::size_t bodies) {
  if (energy_.size() < bodies) energy_.resize(bodies), resting_energy_.resize(bodies);
}

void ContactHistory::finish(std::span<const PreparedContact> contacts, std::span<const char> asleep, bool some_woke) {
  events_.clear(), pressed_.clear();
  const std::size_t rested = resting_.size();
  auto last = memory_.begin();
  const auto leave = [&](const ContactMemory& memory, bool presses) {
    if (rests(asleep, memory.a, memory.b))
      resting_.push_back(memory);
    else if (!presses)
      end(memory);
  };
  for (const PreparedContact& contact : contacts) {
    if (contact.impulse.isZero(0.0)) continue;
    while (last != memory_.end() && kByKey(*last, contact)) leave(*last++, false);
    const bool known = last != memory_.end() && key_of(*last) == key_of(contact);
    take(contact, known || find_in(resting_, contact, kByKey) != nullptr);
    if (known) leave(*last++, true);
  }
  while (last != memory_.end()) leave(*last++, false);
  if (some_woke || resting_.size() > rested) renew_resting(asleep);
  std::swap(memory_, pressed_);
  find_energy(memory_, energy_);
}

/// Those that wake press, or have ended.
void ContactHistory::renew_resting(std::span<const char> asleep) {
  const std::size_t told = events_.size();
  std::erase_if(resting_, [&](const ContactMemory& last) {
    const bool wakes = !rests(asleep, last.a, last.b);
    if (wakes && find_in(pressed_, last, kByKey) == nullptr) end(last);
    return wakes;
  });
  std::ranges::sort(resting_, kByKey);
  find_energy(resting_, resting_energy_);
  if (events_.size() > told) std::ranges::sort(events_, kByKey);
}

void ContactHistory::take(const PreparedContact& contact, bool lasts) {
  pressed_.push_back({.id = contact.id,
                      .a = contact.a.body,
                      .b = contact.b.body,
                      .force = contact.last_force,
                      .compliance = contact.compliance,
                      .slip = contact.slip,
                      .yielding = contact.yielding,
                      .position = contact.start_position,
                      .normal = contact.axes.col(0)});
  events_.push_back({.id = contact.id,
                     .a = contact.a.body,
                     .b = contact.b.body,
                     .phase = lasts ? ContactPhase::kLasting : ContactPhase::kBegun,
                     .position = contact.start_position,
                     .normal = contact.axes.col(0),
                     .impulse = contact.impulse,
                     .approach = lasts ? 0.0 : contact.approach});
}

void ContactHistory::end(const ContactMemory& last) {
  events_.push_back({.id = last.id,
                     .a = last.a,
                     .b = last.b,
                     .phase = ContactPhase::kEnded,
                     .position = last.position,
                     .normal = last.normal});
}

void ContactHistory::find_energies(std::size_t bodies) {
  reserve(bodies);
  find_energy(memory_, energy_);
  find_energy(resting_, resting_energy_);
}

void ContactHistory::clear() { *this = {}; }

void ContactHistory::find(std::span<const ContactPoint* const> contacts,
                          std::vector<const ContactMemory*>& known) const {
  known.clear();
  auto last = memory_.begin();
  for (const ContactPoint* contact : contacts) {
    while (last != memory_.end() && kByKey(*last, *contact)) ++last;
    const bool pressed = last != memory_.end() && key_of(*last) == key_of(*contact);
    known.push_back(pressed ? &*last : find_in(resting_, *contact, kByKey));
  }
}

double ContactHistory::energy(Index body) const {
  const auto i = static_cast<std::size_t>(body);
  return i < energy_.size() ? energy_[i] + resting_energy_[i] : 0.0;
}

}  // namespace limber
