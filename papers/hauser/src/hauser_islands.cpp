#include "hauser_islands.h"

#include <algorithm>

namespace limber::internal {

IslandReport ProgramIslands::find(const StepPart& part) {
  const bool by_velocities = rule_.method == ContactMethod::kVelocityProgram;
  begin(part, true);
  IslandReport done;
  found_ = {};
  if (by_velocities) touch_.solve(step_, reaction_, rule_, found_);
  reaction_.find(step_, StepTime::kStart);
  done.accepted = newton_.solve(step_, rule_, done, found_) == SolveStatus::kSolved;
  step_.linearise_end();
  if (by_velocities) touch_.hold_forces(step_.end_rows, step_.length());
  reaction_.find(step_, StepTime::kEnd);
  step_.load_end();
  return done;
}

/// The velocity program acts at the touch.
double ProgramIslands::wanted_cut(Constraint& constraint, const BodyStates& states, const FreeMotions& free,
                                  double within) {
  return rule_.method == ContactMethod::kVelocityProgram ? constraint.next_touch(states, free, within) : within;
}

IslandReport HauserIslands::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                 std::span<Constraint* const> constraints, const IslandOptions& options) {
  const std::span<Constraint* const> chosen = choose(constraints);
  return at_->step(table, members, chosen, adapted(options));
}

/// The solver of the step, and the constraints as it is to see them.
std::span<Constraint* const> HauserIslands::choose(std::span<Constraint* const> constraints) {
  const bool touches = std::ranges::any_of(constraints, [](const Constraint* c) { return c->is_contact(); });
  at_ = touches && !rule_.has_cone() ? &by_programs_ : own_.get();
  if (rule_.method != ContactMethod::kPenalty) return constraints;
  constraints_.assign(constraints.begin(), constraints.end());
  std::size_t used = 0;
  for (Constraint*& constraint : constraints_) {
    if (!constraint->is_contact()) continue;
    if (used == springs_.size()) springs_.push_back(std::make_unique<PenaltyContact>());
    springs_[used]->set(*constraint, rule_.penalty_frequency, rule_.penalty_damping);
    constraint = springs_[used++].get();
  }
  return constraints_;
}

IslandOptions HauserIslands::adapted(IslandOptions options) const {
  if (rule_.is_program() && rule_.guard == ProgramGuard::kNone) options.guard_energy = false;
  return options;
}

}  // namespace limber::internal
