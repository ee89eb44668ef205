/// @file limber/posing/posing_options.h
/// How poses are found, and what is told of one that was.
#pragma once

#include <string_view>

#include "limber/core/types.h"

namespace limber {

/// Weights of the strain energy Σ w |T_a x − T_b x|² between neighbouring cells.
enum class StrainWeights {
  /// Points of the shared face, w = area / distance of the centres: shared volume over squared distance. Stretching,
  /// bending and twisting are as stiff for few cells as for many, and what octree levels meet is no softer or stiffer.
  kVolume,
  /// [X09]: the eight corners of each of the two cells, w = 1. Finer cells make a softer or stiffer body.
  kUnweighted,
};

struct PosingOptions {
  StrainWeights strain = StrainWeights::kVolume;
  double handle_stiffness = 10.0;  ///< of a handle, in units of material stiffness times the model's diagonal; > 0
  double tolerance = 1e-8;         ///< of the diagonal: converged when a step moves no point further; > 0
  double energy_tolerance = 1e-7;  ///< of the energy: or when it promises to lower it by no more; ≥ 0
  int max_iterations = 200;        ///< of one solve(); ≥ 1
  /// Poses to begin from anew where a handle is not met although nothing is strained, in max_iterations more at most;
  /// ≥ 0. 0 follows a drag in small steps, which should not jump to another branch.
  int starts = 16;
  void validate() const;  ///< @throws InvalidArgument naming the field and its value
};

struct PoseResult {
  enum class Status {
    kConverged,     ///< a minimum: one of the two tolerances was met
    kLocalMinimum,  ///< a minimum, and a handle is further off than the tolerance although nothing is strained: out of
                    ///< reach, or met by a pose that no steady decrease leads to from here or from the starts tried
    kIterationLimit,  ///< max_iterations were done; the pose is feasible, and better than the one before
    kStalled,         ///< no step lowers the energy any further: round-off, or a kink where a limit begins
    kInfeasible,      ///< joints, limits and pins contradict each other: the pose is the one before
  } status = Status::kConverged;
  int iterations = 0;
  double energy = 0.0;           ///< strain and handles; stiffness · length³
  double initial_energy = 0.0;   ///< of the pose before, with the handles as they are now
  double joint_error = 0.0;      ///< largest of all joints: of the diagonal, or rad
  double limit_violation = 0.0;  ///< largest: of the diagonal, or rad
  double handle_error = 0.0;     ///< largest distance of a handle's point from its target
  double last_step = 0.0;        ///< how far the last step moved a point at most; of the diagonal
};

/// "converged", "local minimum", "iteration limit", "stalled", "infeasible".
std::string_view to_string(PoseResult::Status status);

}  // namespace limber
