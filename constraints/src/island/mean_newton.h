// Islands of joints, limits, handles and what else has an interval: rows whose impulses act in the middle of the step.
// Newton's method on where the bodies end, how they turn, what their modes bear, and the impulses together. Matrices
// are dense.
#pragma once

#include <vector>

#include "end_velocities.h"
#include "limber/solvers/damped_least_squares.h"
#include "limber/solvers/unsymmetric_factor.h"
#include "mean_motion.h"

namespace limber::internal {

class MeanNewton {
 public:
  /// Finds step.f and predicts the step under it. Where that is not found nothing is predicted that could be taken.
  /// @param bends whether modes move in this step
  SolveStatus solve(IslandStep& step, IslandReport& report, bool bends);
  /// Nothing moves but what is slower for it: for the part of a step whose motion was not found.
  void stay(IslandStep& step) { motion_.stay(step); }

 private:
  double improve(const IslandStep& step);
  void linearise(const IslandStep& step);
  void stiffen(const IslandStep& step);
  void reduce(const IslandStep& step);
  void find_damping(const IslandStep& step);
  void answer(const IslandStep& step);
  bool find_active(const IslandStep& step, bool one);
  void meet_active(const IslandStep& step, double yields);

  MeanMotion motion_;
  std::vector<double> impulses_;
  // Of Newton's step: residuals of the bodies and their modes, their derivatives, and those of the gaps.
  struct {
    Vector bodies, modes;
    Matrix by_motion, by_impulse, modes_by_impulse;  // of these
    Matrix gap_by_motion, gap_by_amplitude, gap_through_modes;
  } at_;
  Vector stiffness_, scale_;  // γ, and the impulse that moves a row's gap by as much
  // What is left of it for the impulses alone: gaps without further impulses, and what these make of them.
  Matrix weighted_, free_gap_, moved_, A_, reduced_;
  Vector stopped_, open_, then_, motion_change_, load_change_, impulse_change_, right_;
  std::vector<char> active_;
  double damping_ = 0.0;
  UnsymmetricFactor factor_;
  DampedLeastSquares rows_;
  EndVelocities velocities_;
};

}  // namespace limber::internal
