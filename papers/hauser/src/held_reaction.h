// What rows that hold answer to gravity and other held forces, so that what rests has no velocity.
#pragma once

#include <span>
#include <vector>

#include "island/island_step.h"
#include "limber/solvers/least_squares.h"
#include "limber/solvers/row_equilibrium.h"

namespace limber::internal {

/// The generalised acceleration of a frame under what is held over the step, without constraints: linear in the loads,
/// so that the rows' answer balances them exactly where nothing moves.
struct FrameAcceleration {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};

class HeldReaction {
 public:
  /// To step.reaction by the rows at the start, to step.end_reaction by those at the end, N.
  void find(IslandStep& step, StepTime when);

  /// Of all bodies, for motion_of().
  void find_accelerations(const IslandStep& step, StepTime when);
  struct Motion {
    double acceleration = 0.0, speed = 0.0;
    double speed_of_a_step = 0.0;  ///< that rest could get of the accelerations in a step, whatever other rows do
  };
  /// The row's part of what the bodies' frames do under held forces alone.
  Motion motion_of(const IslandStep& step, StepTime when, Index row) const;

 private:
  bool bound_rows(const IslandStep& step, StepTime when);
  void weigh_frames(const IslandStep& step, const ConstraintRows& rows);
  void answer(std::span<double> forces);

  std::vector<FrameAcceleration> accelerations_;  // by body
  std::vector<double> b_, lower_, upper_;         // by row: acceleration and bounds of the force
  std::vector<double> G_, metric_, one_row_;      // J M^−½ of the frames; M⁻¹
  std::vector<std::size_t> columns_;              // by body, where its frame's begin
  bool equalities_ = true;                        // among the rows that answer
  LeastSquaresSolver least_squares_;
  RowEquilibrium bounded_;
};

}  // namespace limber::internal
