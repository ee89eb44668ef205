// A step of an island: the parts that it is taken in and the attempts at each.
//
//   island_solver.cpp   the step, its parts, and what is told when one has been taken
//   island_attempts.cpp one part, and what is tried where its energy would rise
//
// How the impulses of one part are found is a solver's own: default_island_solver.cpp is limber's.
#pragma once

#include <vector>

#include "../tuning.h"
#include "island_energy.h"
#include "island_step.h"

namespace limber::internal {

/// Whether nothing is to come part way into the step, or at its end.
bool has_no_dates(const StepPart& part);

/// How far a step has come.
struct StepInParts {
  StepPart part;        // found and not yet taken
  IslandReport done;    // what is to be told of it
  IslandReport report;  // of the parts taken
  double left = 0.0;    // s, with the part
  double length = 0.0;  // s, of a part, where the step is divided
  double begun = 0.0;   // s, with what length that began
  bool divides = false, gives_up = false;
};

/// All of a step but how the impulses of one part are found.
class IslandParts : public IslandSolver {
 public:
  IslandReport step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                    std::span<Constraint* const> constraints, const IslandOptions& options) override;

 protected:
  /// What becomes of the members by the end of a part, all but the energy; begins with begin().
  virtual IslandReport find(const StepPart& part) = 0;
  /// What find() found last happens.
  virtual void taken() {}
  /// @param slip by row, zero
  virtual void write_slip(std::span<double>) const {}
  /// How much of what is left of a step the next part is to take, s. @param cuts of the step so far
  virtual double next_cut(const StepPart& part, int /*cuts*/) { return part.left; }

  /// Makes step_ the part at hand. @param contacts_react as IslandStep::begin()
  void begin(const StepPart& part, bool contacts_react);

  /// Of what find() found, where the energy would rise by it: none, in a free step.
  virtual void refuse_impulses(IslandReport& report);

  IslandStep step_;  // the part at hand
  IslandEnergy energy_;

 private:
  // The step in parts.
  void begin_times(bool timed);
  void find_cut();
  void find_divided();
  void find_impulses();
  void commit(const StepPart& part, const IslandReport& done, IslandReport& report);

  // A part.
  IslandReport find_guarded(const StepPart& part);
  IslandReport guard(const StepPart& part, IslandReport done);

  std::vector<double> slip_, impulses_;  // by row
  StepInParts parts_;                    // the step at hand
  StageTimes times_;                     // of the step at hand
  StageClock clock_;
};

}  // namespace limber::internal
