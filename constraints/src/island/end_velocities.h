// Velocities at a step's end as the rows allow them there. Impulses in the middle of a step reflect what velocities
// were off by, so that it would never go away.
#pragma once

#include <span>
#include <vector>

#include "equality_rows.h"

namespace limber::internal {

class EndVelocities {
 public:
  /// Brings the predicted velocities to J v = RowLaw::end_rate, of all rows that hold: by impulses that can only take
  /// energy but for what drives the rows. Springs and dampers that are stiff over the step take their part of the
  /// motion, those that are not almost nothing.
  /// @param active by row: whether it is within its bounds
  void meet_rows(IslandStep& step, std::span<const char> active);

 private:
  static double rate(const IslandStep& step, Index row);
  static void give(IslandStep& step, std::span<const double> impulses);
  bool choose(const IslandStep& step, std::size_t row, bool active);

  std::vector<double> J_, metric_, impulses_, compliance_;
  EqualityRows equalities_;
};

}  // namespace limber::internal
