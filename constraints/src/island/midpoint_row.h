// A row as Newton's method on the bodies' motion takes it: what it measures at the step's end, and how its impulse acts
// in the middle, by the numbers (d, τ) of its bodies and by their modes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "limber/core/types.h"

namespace limber::internal {

using Vector6 = Eigen::Matrix<double, 6, 1>;

struct MidpointRow {
  struct Side {
    Index body = -1;  // of the island; −1: none
    Vector6 force = Vector6::Zero(), gap = Vector6::Zero();
    std::span<const double> modal_force{}, modal_gap{};
  };
  std::array<Side, 2> sides;

  /// act(side) for those that move.
  template <class Action>
  void for_sides(Action&& act) const {
    for (const Side& side : sides)
      if (side.body >= 0) act(side);
  }
};

}  // namespace limber::internal
