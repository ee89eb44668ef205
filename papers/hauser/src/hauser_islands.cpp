#include "hauser_islands.h"

#include <algorithm>

namespace limber::internal {
namespace {

constexpr double kFirstRefused = 0.01, kMostRefused = 0.5;  // parts of impulses
constexpr double kLeastKept = 4e-4;                         // of impulses; less is none
constexpr int kMostCuts = 4;                                // of a step. Bounds the work
constexpr double kShortestPart = 1e-3;                      // of the step: no cut makes a part that is shorter

/// Whether a step may be cut where bodies touch: free ones that nothing but contacts acts on.
bool allows_cuts(const StepPart& part) {
  return std::ranges::all_of(part.constraints, [](const Constraint* c) { return c->is_contact(); }) &&
         std::ranges::all_of(part.members,
                             [&](Index member) {
                               const ConstrainedBody& body = part.table[static_cast<std::size_t>(member)];
                               return body.group->frame_constants().motion == FrameMotion::kFree;
                             }) &&
         has_no_dates(part);
}

/// The frames' second half of what holds them, and of what strikes them, by the rows at the end.
void load_end(IslandStep& step) {
  step.loads.clear(step.bodies);
  step.loads.add(step.bodies, step.end_rows, step.end_reaction, 0.5 * step.length(), 0.0);
  if (step.theta < 1.0) step.loads.add(step.bodies, step.end_rows, step.f, 1.0 - step.theta, 0.0);
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const ConstrainedBody& body = step.bodies.body(local);
    const ConstraintLoad& load = step.loads.frames[static_cast<std::size_t>(local)];
    body.group->adjust_prediction(body.slot, load.impulse, load.moment, {});
  }
}

}  // namespace

IslandReport ProgramIslands::find(const StepPart& part) {
  const bool by_velocities = rule_.method == ContactMethod::kVelocityProgram;
  begin(part, true);
  IslandReport done;
  found_ = {};
  if (by_velocities) touch_.solve(step_, reaction_, rule_, found_);
  reaction_.find(step_, StepTime::kStart);
  done.accepted = newton_.solve(step_, rule_, done, found_) == SolveStatus::kSolved;
  step_.bodies.place(StepTime::kEnd);
  step_.linearise(StepTime::kEnd, step_.end_rows);
  if (by_velocities) touch_.hold_forces(step_.end_rows, step_.length());
  reaction_.find(step_, StepTime::kEnd);
  load_end(step_);
  return done;
}

/// As little less as will do, each time twice as much less, in the end none: programs often give a little energy, and
/// half of what holds a pile would be half a fall.
void ProgramIslands::refuse_impulses(IslandReport& report) {
  for (double refused = step_.contacts_alone ? kFirstRefused : kMostRefused, kept = 1.0; kept > kLeastKept;
       refused = std::min(2.0 * refused, kMostRefused)) {
    kept *= 1.0 - refused;
    for (double& f : step_.f) f *= 1.0 - refused;
    for (double& f : step_.reaction) f *= 1.0 - refused;
    step_.predict();
    if (energy_.close(step_, report) > 0.0) continue;
    report.accepted = false;
    report.attempts[StepAttempt::kRefused] = 1;
    return;
  }
  IslandParts::refuse_impulses(report);
}

/// The velocity program acts at the touch.
double ProgramIslands::next_cut(const StepPart& part, int cuts) {
  if (rule_.method != ContactMethod::kVelocityProgram || cuts >= kMostCuts || !allows_cuts(part)) return part.left;
  double time = part.left;
  motions_.resize(std::max(motions_.size(), part.members.size()));
  for (std::size_t i = 0; i < part.members.size(); ++i) {
    const ConstrainedBody& body = part.table[static_cast<std::size_t>(part.members[i])];
    body.group->predict_motion(body.slot, part.options.gravity, time, motions_[i]);
  }
  const FreeMotions free{part.members, std::span(motions_).first(part.members.size())};
  for (const Constraint* constraint : part.constraints)
    if (const auto* contacts = dynamic_cast<const PairContacts*>(constraint))
      time = times_.next(*contacts, BodyStates(part.table), free, time);
  const bool is_part = std::min(time, part.left - time) > kShortestPart * part.whole_step;
  return is_part ? time : part.left;
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
