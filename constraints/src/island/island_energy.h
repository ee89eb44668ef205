// The energy of an island over one step, and what is done where it rises (docs/derivations/constraints.md).
#pragma once

#include <span>
#include <vector>

#include "island_step.h"

namespace limber::internal {

/// The motion that the whole island has at the step's end: a rigid one if nothing holds it, else none.
struct CommonMotion {
  Vec3 center = Vec3::Zero(), velocity = Vec3::Zero(), angular_velocity = Vec3::Zero();
};

class IslandEnergy {
 public:
  /// Books the energy before the step, the scale of all that the bodies then have to trade, and that of coming
  /// together.
  void begin(const IslandStep& step);
  /// Slows the predicted relative motion until the energy is at most that before, and the work done on the island;
  /// where rows that can neither give nor take energy have lost some to the method, that is given back.
  /// @return J, that standing still could not take out
  double close(const IslandStep& step, IslandReport& report);

 private:
  struct Change {
    double removed = 0.0;  // J, taken out; negative: given back
    double left = 0.0;     // J, that standing still could not take out
    double surplus = 0.0;  // J, above what is allowed, for the next step
  };
  Change guard(const IslandStep& step, bool give_back);
  CommonMotion common_motion(const IslandStep& step) const;
  double remove_relative_energy(const IslandBodies& bodies, const CommonMotion& common, double excess,
                                double largest_part);

  double before_ = 0.0, scale_ = 0.0, recovery_ = 0.0;
  bool driven_ = false;
  std::vector<double> modal_;
};

}  // namespace limber::internal
