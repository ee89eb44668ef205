/// @file contact_history.h
/// What a scene's contacts remember of a step, and what they tell of it. Private to the constraints module.
#pragma once

#include <algorithm>
#include <span>
#include <tuple>
#include <vector>

#include "limber/constraints/contact_constraint.h"
#include "prepared_contact.h"

namespace limber {

inline constexpr auto kById = [](const auto& x, const auto& y) { return x.id < y.id; };
inline constexpr auto kByPair = [](const auto& x, const auto& y) { return x.a != y.a ? x.a < y.a : x.b < y.b; };

/// What `known`, ordered so, has of the same; null: nothing.
template <class T, class Order>
const T* find_in(const std::vector<T>& known, const T& sought, const Order& order) {
  const auto found = std::lower_bound(known.begin(), known.end(), sought, order);
  return found != known.end() && !order(sought, *found) ? &*found : nullptr;
}
inline const ContactMemory* find_in(const std::vector<ContactMemory>& known, std::uint64_t id) {
  return find_in(known, ContactMemory{.id = id}, kById);
}

/// Whether one of two bodies sleeps. @param asleep by body
bool rests(std::span<const char> asleep, Index a, Index b);

class ContactHistory {
 public:
  /// Room for the bodies of a table.
  void reserve(std::size_t bodies);
  /// After a step: its forces, those under which bodies fell asleep, and the events of both.
  void finish(std::span<const PreparedContact> contacts, std::span<const char> asleep, bool some_woke);
  /// After the state was restored. @param bodies at least those remembered
  void find_energies(std::size_t bodies);
  void clear();

  /// A contact that pressed in the last step, or under which its bodies sleep; null: neither.
  const ContactMemory* find(std::uint64_t id) const;
  std::span<const ContactMemory> memory() const { return memory_; }    ///< by id, those that pressed in the last step
  std::span<const ContactMemory> resting() const { return resting_; }  ///< by id, those of bodies that sleep
  std::span<const ContactEvent> events() const { return events_; }     ///< by id
  /// In a body's contact compliance, J.
  double energy(Index body) const;

 private:
  friend struct StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.memory_, s.resting_, s.events_);
  }

  /// A contact that presses, by its number.
  struct Pressing {
    std::uint64_t id = 0;
    std::size_t number = 0;
  };
  void take(const PreparedContact& contact, bool lasts);
  void end(const ContactMemory& last);
  void renew_resting(std::span<const char> asleep);
  void list_ids();

  std::vector<ContactMemory> memory_, resting_;
  std::vector<ContactEvent> events_;
  std::vector<double> energy_, resting_energy_;  // by body: of memory_ and of resting_
  std::vector<std::uint64_t> ids_;               // of memory_
  // Scratch of finish().
  std::vector<ContactMemory> pressed_;
  std::vector<Pressing> order_;
};

}  // namespace limber
