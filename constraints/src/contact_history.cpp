#include "contact_history.h"

namespace limber {
namespace {

/// ½ give F² of each, to the body that yields.
void find_energy(std::span<const ContactMemory> of, std::vector<double>& energy) {
  std::ranges::fill(energy, 0.0);
  for (const ContactMemory& m : of)
    if (m.give > 0.0) energy[static_cast<std::size_t>(m.yielding)] += 0.5 * m.give * m.force.squaredNorm();
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
  for (const PreparedContact& contact : contacts)
    if (!contact.impulse.isZero(0.0)) take(contact);
  std::ranges::sort(pressed_, kById);
  const std::size_t rested = resting_.size();
  for (const ContactMemory& last : memory_) {
    if (rests(asleep, last.a, last.b))
      resting_.push_back(last);
    else
      end(last);
  }
  if (some_woke || resting_.size() > rested) {
    std::erase_if(resting_, [&](const ContactMemory& last) {
      const bool wakes = !rests(asleep, last.a, last.b);
      if (wakes) end(last);
      return wakes;
    });
    std::ranges::sort(resting_, kById);
    find_energy(resting_, resting_energy_);
  }
  std::swap(memory_, pressed_);
  find_energy(memory_, energy_);
  std::ranges::sort(events_, kById);
}

void ContactHistory::take(const PreparedContact& contact) {
  pressed_.push_back({.id = contact.id,
                      .a = contact.a.body,
                      .b = contact.b.body,
                      .force = contact.last_force,
                      .give = contact.give,
                      .slip = contact.slip,
                      .yielding = contact.yielding,
                      .position = contact.start_position,
                      .normal = contact.axes.col(0)});
  events_.push_back({.id = contact.id,
                     .a = contact.a.body,
                     .b = contact.b.body,
                     .phase = find(contact.id) != nullptr ? ContactPhase::kLasting : ContactPhase::kBegun,
                     .position = contact.start_position,
                     .normal = contact.axes.col(0),
                     .impulse = contact.impulse});
}

void ContactHistory::end(const ContactMemory& last) {
  if (find_in(pressed_, last.id) != nullptr) return;
  events_.push_back({last.id, last.a, last.b, ContactPhase::kEnded, last.position, last.normal, Vec3::Zero()});
}

void ContactHistory::find_energies(std::size_t bodies) {
  reserve(bodies);
  find_energy(memory_, energy_);
  find_energy(resting_, resting_energy_);
}

void ContactHistory::clear() { *this = {}; }

const ContactMemory* ContactHistory::find(std::uint64_t id) const {
  const ContactMemory* known = find_in(memory_, id);
  return known != nullptr ? known : find_in(resting_, id);
}

double ContactHistory::energy(Index body) const {
  const auto i = static_cast<std::size_t>(body);
  return i < energy_.size() ? energy_[i] + resting_energy_[i] : 0.0;
}

}  // namespace limber
