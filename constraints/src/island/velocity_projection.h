// Velocities at a step's end as the rows allow them there. Impulses in the middle of a step reflect what velocities
// were off by, so that it would never go away.
#pragma once

#include <span>
#include <vector>

#include "equality_rows.h"
#include "limber/solvers/row_equilibrium.h"

namespace limber::internal {

class VelocityProjection {
 public:
  /// Brings the predicted velocities to J v = RowParameters::end_rate, of all rows that hold: by impulses that can only
  /// take energy but for what drives the rows. Springs and dampers that are stiff over the step take their part of the
  /// motion, those that are not almost nothing.
  /// Impulses of the step's middle and these together stay within the bounds of hands, springs, motors and friction.
  /// Contacts take no part.
  /// @param active by row: whether it is within its bounds
  void meet_rows(IslandStep& step, std::span<const char> active);

 private:
  static double rate(const IslandStep& step, Index row);
  static void give(IslandStep& step, std::span<const double> impulses);
  static void write_row(const IslandStep& step, std::size_t row, std::span<double> J);
  double compliance_of(const IslandStep& step, std::size_t row);
  void solve(IslandStep& step);
  bool are_within_bounds(const IslandStep& step);
  void solve_within_bounds();

  std::vector<std::size_t> rows_;  // that hold at the end
  std::vector<double> off_, compliance_, J_, metric_, row_, impulses_;
  std::vector<double> found_, lower_, upper_;  // by row that holds
  EqualityRows equalities_;
  RowEquilibrium bounded_;
};

}  // namespace limber::internal
