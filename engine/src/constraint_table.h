// Handles and joints of a world, by place.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "limber/constraints/handle.h"
#include "limber/constraints/joint_constraint.h"

namespace limber::internal {

class ConstraintTable {
 public:
  /// One constraint with its owner's bookkeeping; `constraint` is null where a place is vacant.
  struct Entry {
    std::uint32_t generation = 1;
    std::unique_ptr<Handle> handle;
    std::unique_ptr<JointConstraint> joint;
    std::uint64_t user_data = 0;
    double strength = std::numeric_limits<double>::infinity();  // N, of a joint
    Constraint* constraint() const {
      return handle ? static_cast<Constraint*>(handle.get()) : static_cast<Constraint*>(joint.get());
    }
  };

  /// @return the place of a constraint with a new id
  std::uint32_t add(Entry&& entry);
  void remove(std::uint32_t place);
  const std::vector<Entry>& entries() const { return entries_; }
  void set_user_data(std::uint32_t place, std::uint64_t data) { entries_[place].user_data = data; }

  void set_strength(std::uint32_t place, double newtons) { entries_[place].strength = newtons; }

  void save_state(StateWriter& state) const;
  /// Constraints made since are removed, those removed since made again.
  void restore_state(StateReader& state);

 private:
  enum class Kind : std::uint8_t { kVacant, kHandle, kJoint };
  static Kind kind_of(const Entry& entry);

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> vacant_;
};

}  // namespace limber::internal
