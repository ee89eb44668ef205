#include "island_partition.h"

#include <utility>

namespace limber::internal {

void IslandPartition::begin(std::size_t bodies) {
  islands_.clear();
  constraints_.clear();
  members_.clear();
  acts_.assign(bodies, 0);
}

void IslandPartition::find(std::span<Constraint* const> constraints) {
  sets_.reset(acts_.size());
  island_of_.assign(acts_.size(), -1);
  for (const Constraint* constraint : constraints) {
    const auto [a, b] = constraint->bodies();
    if (acts(a) && acts(b)) sets_.join(a, b);
  }
  number_islands(constraints);
  list_members();
  list_constraints(constraints);
}

std::span<const Index> IslandPartition::members(std::size_t island) const {
  return std::span(members_).subspan(islands_[island].first_member, islands_[island].members);
}

std::span<Constraint* const> IslandPartition::constraints(std::size_t island) const {
  return std::span(constraints_).subspan(islands_[island].first_constraint, islands_[island].constraints);
}

/// The root of the island that a constraint acts in; −1: it touches nothing that moves.
Index IslandPartition::root_of(const Constraint* constraint) {
  const auto [a, b] = constraint->bodies();
  return acts(a) ? sets_.root(a) : acts(b) ? sets_.root(b) : Index{-1};
}

/// Roots that a constraint touches, in ascending order; an island's root is its first body.
void IslandPartition::number_islands(std::span<Constraint* const> constraints) {
  constexpr Index kTouched = 0;
  for (const Constraint* constraint : constraints)
    if (const Index root = root_of(constraint); root >= 0) island_of_[static_cast<std::size_t>(root)] = kTouched;
  Index count = 0;
  for (Index& island : island_of_)
    if (island == kTouched) island = count++;
  islands_.assign(static_cast<std::size_t>(count), {});
}

/// Members of every island, ascending, one island after the other: counted, then filled in.
void IslandPartition::list_members() {
  for (std::size_t body = 0; body < acts_.size(); ++body) {
    if (acts_[body] == 0) continue;
    const Index root = sets_.root(static_cast<Index>(body));
    const Index island = island_of_[static_cast<std::size_t>(root)];  // a root comes before the others
    island_of_[body] = island;
    if (island >= 0) ++islands_[static_cast<std::size_t>(island)].members;
  }
  std::size_t count = 0;
  for (Island& island : islands_) {
    island.first_member = count;
    count += std::exchange(island.members, 0);
  }
  members_.resize(count);
  for (std::size_t body = 0; body < acts_.size(); ++body) {
    if (acts_[body] == 0 || island_of_[body] < 0) continue;
    Island& island = islands_[static_cast<std::size_t>(island_of_[body])];
    members_[island.first_member + island.members++] = static_cast<Index>(body);
  }
}

/// The same for the constraints, each island's in their own order.
void IslandPartition::list_constraints(std::span<Constraint* const> constraints) {
  const auto island_with = [&](const Constraint* constraint) -> Island* {
    const Index root = root_of(constraint);
    if (root < 0) return nullptr;
    return &islands_[static_cast<std::size_t>(island_of_[static_cast<std::size_t>(root)])];
  };
  for (const Constraint* constraint : constraints)
    if (Island* island = island_with(constraint)) ++island->constraints;
  std::size_t count = 0;
  for (Island& island : islands_) {
    island.first_constraint = count;
    count += std::exchange(island.constraints, 0);
  }
  constraints_.resize(count);
  for (Constraint* constraint : constraints)
    if (Island* island = island_with(constraint))
      constraints_[island->first_constraint + island->constraints++] = constraint;
}

}  // namespace limber::internal
