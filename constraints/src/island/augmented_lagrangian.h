// Islands with contacts: all rows as one convex problem, linear about the motion under the impulses at hand, again and
// again until these meet the rows' law at the true gaps. It is the method of multipliers (Hestenes; Powell 1969;
// Rockafellar 1973), in which a row's spring yields from what it exerted in the round before.
#pragma once

#include <span>
#include <vector>

#include "../residual_factor.h"
#include "island_step.h"
#include "limber/solvers/convex_contact_solver.h"
#include "limber/solvers/secant_iteration.h"

namespace limber::internal {

class AugmentedLagrangian {
 public:
  /// Finds step.f, with the step predicted and measured under it; how far that is from the law, and whether the step
  /// is to go on from it (IslandReport::change, accepted).
  void solve(IslandStep& step, IslandReport& report);
  /// What was found last, after something else has been tried in the step. @pre its loads are as they were
  void take_again(IslandStep& step);
  /// Of contacts that press, where the next step is to begin with it, in their normal rows. @param slip by row
  void write_slip(const IslandStep& step, std::span<double> slip) const;

 private:
  struct Unit {  // a row, or the rows of one contact or vector
    std::size_t first = 0, rows = 1;
    Vec3 impulse = Vec3::Zero();  // whole, that of the round
    Vec3 anchor = Vec3::Zero();   // from where its spring yields
    Vec3 moved = Vec3::Zero();    // what all of them make of its gap, to first order
    Vec3 end = Vec3::Zero();      // its gap, less what it asks for
    double response = 0.0, shift = 0.0, changed = 0.0;
  };
  struct Distance {
    double from_law = 0.0, moved = 0.0;  // by tolerance
  };

  void iterate(IslandStep& step, IslandReport& report);
  void place_units(const IslandStep& step);
  void fill_units(const IslandStep& step);
  void fill_rows(const IslandStep& step);
  template <class Write>
  void fill_values(const IslandStep& step, Write&& write);
  void begin_units(const IslandStep& step);
  void take_impulses(IslandStep& step);
  static double distance_from_law(const Unit& unit, const RowParameters& law, const ContactPotential& potential,
                                  Vec3 gap);
  Distance find_starts(const IslandStep& step, bool first_round);
  double largest_distance(const IslandStep& step);
  Vec3 open_gap(const IslandStep& step, const Unit& unit);
  double indentation_of(const IslandStep& step, std::size_t row);
  void stiffen(const IslandStep& step);
  void advance_units(const IslandStep& step);
  void take_whole(std::span<const double> impulses);
  void end_at_limit(IslandStep& step, IslandReport& report);
  void take_best(IslandStep& step, IslandReport& report);
  void take_motion(IslandStep& step);

  ConvexContactSolver contacts_;
  std::vector<Unit> units_;
  std::vector<std::size_t> nodes_;  // of the bodies
  ResidualFactor residual_;         // of what bodies yield beyond their modes
  std::vector<double> root_;        // D^½, by degree of freedom
  std::vector<double> one_row_;
  bool begun_ = false;                      // there is a motion to go on from
  SecantIteration secants_;                 // beside joints
  std::vector<double> at_, next_, change_;  // their numbers, by row
};

}  // namespace limber::internal
