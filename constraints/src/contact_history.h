/// @file contact_history.h
/// What a scene's contacts remember of a step, and what they tell of it. Private to the constraints module.
///
/// All lists are in the order in which a ContactSource tells contacts, by bodies and id: they are gone through side by
/// side, and nothing is sorted or searched for.
#pragma once

#include <algorithm>
#include <span>
#include <tuple>
#include <vector>

#include "limber/constraints/contact_constraint.h"
#include "prepared_contact.h"

namespace limber {

inline constexpr auto kByPair = [](const auto& x, const auto& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; };

/// The order of contacts.
struct ContactKey {
  Index a = -1, b = -1;
  std::uint64_t id = 0;
  friend auto operator<=>(const ContactKey&, const ContactKey&) = default;
};
inline ContactKey key_of(const ContactPoint& c) { return {c.a.body, c.b.body, c.id}; }
inline ContactKey key_of(const PreparedContact& c) { return {c.a.body, c.b.body, c.id}; }
inline ContactKey key_of(const ContactMemory& c) { return {c.a, c.b, c.id}; }
inline ContactKey key_of(const ContactEvent& c) { return {c.a, c.b, c.id}; }
inline constexpr auto kByKey = [](const auto& x, const auto& y) { return key_of(x) < key_of(y); };

/// What `known`, ordered so, has of the same; null: nothing.
template <class T, class Sought, class Order>
const T* find_in(const std::vector<T>& known, const Sought& sought, const Order& order) {
  const auto found = std::lower_bound(known.begin(), known.end(), sought, order);
  return found != known.end() && !order(sought, *found) ? &*found : nullptr;
}

/// Whether one of two bodies sleeps. @param asleep by body
bool rests(std::span<const char> asleep, Index a, Index b);

class ContactHistory {
 public:
  /// Room for the bodies of a table.
  void reserve(std::size_t bodies);
  /// Finds what each contact, in order, did in the last step, or under what its bodies sleep; null: neither. It stands
  /// until finish().
  void find(std::span<const ContactPoint* const> contacts, std::vector<const ContactMemory*>& known) const;
  /// After a step: its forces, those under which bodies fell asleep, and the events of both. @param contacts in order
  void finish(std::span<const PreparedContact> contacts, std::span<const char> asleep, bool some_woke);
  /// After the state was restored. @param bodies at least those remembered
  void find_energies(std::size_t bodies);
  void clear();

  std::span<const ContactMemory> memory() const { return memory_; }    ///< those that pressed in the last step
  std::span<const ContactMemory> resting() const { return resting_; }  ///< those of bodies that sleep
  std::span<const ContactEvent> events() const { return events_; }
  /// In a body's contact compliance, J.
  double energy(Index body) const;

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.memory_, s.resting_, s.events_);
  }

  void take(const PreparedContact& contact, bool lasts);
  void end(const ContactMemory& last);
  void renew_resting(std::span<const char> asleep);

  std::vector<ContactMemory> memory_, resting_;
  std::vector<ContactEvent> events_;
  std::vector<double> energy_, resting_energy_;  // by body: of memory_ and of resting_
  std::vector<ContactMemory> pressed_;           // scratch of finish()
};

}  // namespace limber
