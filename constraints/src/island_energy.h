// The energy of an island over one step, and what is done where it rises (docs/derivations/constraints.md).
#pragma once

#include <span>
#include <vector>

#include "limber/constraints/island_solver.h"

namespace limber {

/// The frame before the step, or as predicted for its end.
inline const RigidFrame& frame_at(const BodyGroup& group, Index slot, StepTime when) {
  return when == StepTime::kStart ? group.frame(slot) : group.predicted_frame(slot);
}

/// The motion that the whole island has: a rigid one if nothing holds it, else none.
struct CommonMotion {
  Vec3 center = Vec3::Zero(), velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
};

/// Of a body's frame, as its impulses are.
struct FrameMomentum {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};

class IslandEnergy {
 public:
  /// Books the energy before the step, the scale of all that the bodies then have to trade, and that of coming
  /// together.
  void begin(const IslandBodies& bodies, const Vec3& gravity);
  struct Change {
    double removed = 0.0;  ///< J, taken out; negative: given back
    double left = 0.0;     ///< J, that standing still could not take out
    double surplus = 0.0;  ///< J, above what is allowed, for the next step
  };
  /// Slows the predicted relative motion until the energy is at most that before, and the work done on the island.
  /// @param give_back whether what is missing, beyond the modes' damping, is the method's doing: then it is made up for
  /// @param impulses by row, whole: rows that exert nothing hold nothing
  Change guard(const IslandBodies& bodies, const ConstraintRows& rows, std::span<const double> impulses,
               double agent_work, bool give_back, const IslandOptions& options);
  /// What the frames have beside the common motion at the step's start. @return its energy, J
  static double start_motion(const IslandBodies& bodies, const ConstraintRows& rows, std::span<const double> impulses,
                             std::vector<FrameMomentum>& momenta);

 private:
  static bool is_free(const IslandBodies& bodies, const ConstraintRows& rows, std::span<const double> impulses);
  static CommonMotion common_motion(const IslandBodies& bodies, StepTime when);
  static double load_work(const IslandBodies& bodies, double step);
  double remove_relative_energy(const IslandBodies& bodies, const CommonMotion& common, double excess,
                                double largest_part);

  double before_ = 0.0, scale_ = 0.0, recovery_ = 0.0;
  bool driven_ = false;
  std::vector<double> modal_;
};

}  // namespace limber
