// A step of an island: the parts that it is taken in and the attempts at each.
//
//   island_solver.cpp   the step, its parts, and what is told when one has been taken
//   island_attempts.cpp one part, and what is tried where its energy would rise
//   island_release.cpp  where within a part an impact lets go
#pragma once

#include <vector>

#include "convex_rounds.h"
#include "held_reaction.h"
#include "island_energy.h"
#include "island_step.h"
#include "mean_newton.h"
#include "row_newton.h"
#include "touch_program.h"

namespace limber {

/// Whether a step is to be cut at a time within what is left of it: parts are never shorter than a thousandth of it.
inline bool is_part(double time, double left, double whole_step) {
  constexpr double kShortest = 1e-3;
  return time > kShortest * whole_step && left - time > kShortest * whole_step;
}

/// How far a step has come.
struct StepInParts {
  internal::StepPart part;  // foreseen and not yet taken
  IslandReport done;        // what is to be told of it
  IslandReport report;      // of the parts taken
  double left = 0.0;        // s, with the part
  double length = 0.0;      // s, of a part, where the step is divided
  bool may_cut = false, cuts = false, divides = false, gives_up = false;
};

struct IslandSolver::Impl {
  internal::IslandStep step;  // the part at hand
  internal::HeldReaction reaction;
  internal::TouchProgram touch;
  internal::ConvexRounds rounds;
  internal::RowNewton newton;
  internal::MeanNewton mean;
  internal::IslandEnergy energy;
  std::vector<ExactMotion> motions;    // of the members, where a step may be cut or is watched
  std::vector<double> slip, impulses;  // by row
  StepInParts parts;                   // the step at hand
  StageTimes times;                    // of the step at hand
  StageClock clock;

  // The step in parts.
  void take_watched(internal::StepPart part, IslandReport& report);
  void begin_times(bool timed);
  void foresee_next();
  void foresee_cut();
  void end_cut();
  void foresee_divided();
  double next_cut(const internal::StepPart& part);
  void find_impulses();
  void tell_foreseen();
  void commit(const internal::StepPart& part, const IslandReport& done, IslandReport& report);

  // A part.
  IslandReport foresee(const internal::StepPart& part);
  bool foresee_middle(IslandReport& done);
  IslandReport foresee_guarded(const internal::StepPart& part);
  IslandReport refine(const internal::StepPart& part, IslandReport done);
  IslandReport guard(internal::StepPart part, IslandReport done);
  void foresee_mean(IslandReport& done);
  void act_at_end();
  void refuse_impulses(IslandReport& report);

  // Where it ends, if an impact lets go within it.
  void end_at_release(internal::StepPart& part, IslandReport& done);
  double longest_impact() const;
  double last_impact_force() const;
  double impact_impulse(double length) const;
  double find_release(internal::StepPart part);
};

}  // namespace limber
