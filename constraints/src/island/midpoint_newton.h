// Islands of joints, limits, handles and what else has an interval: rows whose impulses act in the middle of the step.
// Newton's method on where the bodies end, how they turn, what their modes bear, and the impulses together, from where
// the last step's forces would take them, or from free flight. What rests under these forces costs a look at the
// equations; what moves, one matrix a step, by which steps are repeated, with what these tell of it.
#pragma once

#include <vector>

#include "midpoint_change.h"
#include "midpoint_problem.h"
#include "row_answer.h"
#include "velocity_projection.h"

namespace limber::internal {

class MidpointNewton {
 public:
  /// Finds step.f and predicts the step under it. Where that is not found nothing is predicted that could be taken.
  /// @param bends whether modes move in this step
  SolveStatus solve(IslandStep& step, IslandReport& report, bool bends);
  /// Nothing moves but what is slower for it: for the part of a step whose motion was not found.
  void stay(IslandStep& step) { motion_.stay(step); }
  /// Of contacts that press, where the next step is to begin with it, in their normal rows. @param slip by row
  void write_slip(const IslandStep& step, std::span<double> slip) const;

 private:
  SolveStatus iterate(IslandStep& step, IslandReport& report);
  void begin(IslandStep& step);
  void forget_matrix();
  void forget_forces(const IslandStep& step);
  bool free_is_nearer() const;
  bool improve(const IslandStep& step);
  bool repeat(const IslandStep& step);
  void take(const IslandStep& step);
  double size() const;
  void move(const IslandStep& step);
  void finish(IslandStep& step);

  MidpointMotion motion_;
  MidpointProblem problem_;
  RowAnswer answer_;
  VelocityProjection velocities_;
  std::vector<double> impulses_;
  std::vector<char> within_;  // by row: whether its impulse is within its bounds
  Vector free_, guess_;       // where bodies would be in free flight, and under the last step's forces
  MidpointChange change_;
  MidpointSecants secants_;  // of the steps by one matrix
  bool bends_ = true;
  bool linear_ = false, repeated_ = false;  // there is a matrix; the last step was by that of an earlier place
};

}  // namespace limber::internal
