// The linear system of the rows of a substep that hold:
//
//   (J W Jᵀ + C) Δf = r      J, W: game_rows.h, C: compliance of springs and dampers
//
// by JointFactor, whose nodes are the groups, and where that has left something out by conjugate gradients, conditioned
// by it.
#pragma once

#include <array>

#include "game_rows.h"
#include "joint_factor.h"
#include "limber/core/disjoint_sets.h"

namespace limber::internal {

class RowSystem {
 public:
  /// Which rows of which group meet at which bodies. The same groups come until it is called again.
  void find_graph(const GameBodies& bodies, const GameRows& rows);
  /// Of the rows that hold. @param closing whether places are to be closed: what a hand of limited force asks for may
  /// contradict them
  void factor(const GameRows& rows, bool closing);

  std::size_t size() const { return factor_.size(); }
  /// Where the numbers of a group's rows that hold begin among all.
  std::size_t first(std::size_t group) const { return factor_.first(group); }
  /// Those rows, by number in their group.
  std::span<const std::int32_t> met(std::size_t group) const {
    return {met_.data() + first_met_[group], static_cast<std::size_t>(sizes_[group])};
  }
  /// Calls visit(row, its number among those that hold) of all that hold.
  template <class Visit>
  void for_met(const GameRows& rows, const Visit& visit) const {
    const std::span<const GameGroup> groups = rows.groups();
    for (std::size_t g = 0; g < groups.size(); ++g) {
      std::size_t k = first(g);
      for (const std::int32_t i : met(g)) visit(groups[g].first + static_cast<std::size_t>(i), k++);
    }
  }
  /// What rows act on, ascending.
  std::span<const RowBody> bodies() const { return bodies_; }
  std::size_t components() const { return components_; }
  /// The number of the bodies that rows join a group's to.
  std::size_t component(std::size_t group) const { return static_cast<std::size_t>(of_group_[group]); }

  /// Overwrites right-hand sides. @param x size() rows of `columns` numbers
  template <std::size_t columns>
  void solve(std::span<double> x) const {
    factor_.solve<columns>(x);
  }
  /// The same for one column; where the factor is not complete, from a first guess. @param x right-hand sides
  void solve_fully(const GameRows& rows, std::span<const double> guess, std::vector<double>& x);

 private:
  void number_components(const GameBodies& bodies, std::span<const GameGroup> groups);
  void list_met(const GameRows& rows, bool closing);
  void multiply(const GameRows& rows, std::span<const double> x, std::span<double> product);

  JointFactor factor_;
  std::vector<JointFactor::Pair> graph_;
  std::vector<std::array<std::int32_t, 2>> incident_;  // (frame, group)
  std::vector<RowBody> bodies_;
  std::vector<std::int32_t> of_group_, of_frame_;  // components; of_frame_ of the first frame of each
  std::size_t components_ = 0;
  DisjointSets joined_;                          // frames
  std::vector<std::int32_t> met_;                // rows that hold, by group
  std::vector<std::int32_t> first_met_, sizes_;  // by group: in met_
  bool all_met_ = false;                         // of the graph at hand
  struct Gradients {
    std::vector<double> residual, direction, product, conditioned, forces;
    std::vector<Double8> moved;
  } gradients_;
};

}  // namespace limber::internal
