// Which bodies constraints tie together: islands, by their smallest body.
#pragma once

#include <span>
#include <vector>

#include "limber/constraints/constraint.h"
#include "limber/core/disjoint_sets.h"

namespace limber::internal {

class IslandPartition {
 public:
  /// There are no islands, and no body takes part. @param bodies how many there are
  void begin(std::size_t bodies);
  /// A body takes part: others are to constraints as what never moves.
  void let_act(Index body) { acts_[static_cast<std::size_t>(body)] = 1; }
  /// Finds them. @param constraints their order is kept within each island
  void find(std::span<Constraint* const> constraints);

  std::size_t size() const { return islands_.size(); }
  bool empty() const { return islands_.empty(); }
  /// Ascending.
  std::span<const Index> members(std::size_t island) const;
  std::span<Constraint* const> constraints(std::size_t island) const;
  /// The bodies of all islands, one after the other.
  std::span<const Index> members() const { return members_; }
  void forget_members() { members_.clear(); }
  /// Whether a body is in an island.
  bool contains(Index body) const { return !islands_.empty() && island_of_[static_cast<std::size_t>(body)] >= 0; }

 private:
  struct Island {
    std::size_t first_member = 0, members = 0, first_constraint = 0, constraints = 0;
  };
  bool acts(Index body) const { return body >= 0 && acts_[static_cast<std::size_t>(body)] != 0; }
  Index root_of(const Constraint* constraint);
  void number_islands(std::span<Constraint* const> constraints);
  void list_members();
  void list_constraints(std::span<Constraint* const> constraints);

  std::vector<char> acts_;  // by body
  DisjointSets sets_;
  std::vector<Index> island_of_;  // per root, and then per body that acts; −1: none
  std::vector<Island> islands_;
  std::vector<Index> members_;
  std::vector<Constraint*> constraints_;
};

}  // namespace limber::internal
