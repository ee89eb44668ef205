#include "limber/constraints/island_solver.h"

#include <algorithm>

#include "../tuning.h"
#include "island_impl.h"

namespace limber::internal {

bool has_no_dates(const StepPart& part) {
  return std::ranges::all_of(part.members, [&](Index member) {
    const auto& [group, slot, pose] = part.table[static_cast<std::size_t>(member)];
    return !group->frame(slot).has_next_parent() && !group->has_delayed_impulse(slot);
  });
}

namespace {

/// Whether a step may be taken in parts where it does not settle.
bool may_divide(const StepPart& part) {
  return std::ranges::all_of(part.constraints, [](const Constraint* c) { return c->may_be_divided(); }) &&
         has_no_dates(part);
}

/// s: the step, in halves until bodies turn little enough in one.
double length_of_parts(const StepPart& part) {
  double fastest = 0.0;
  for (const Index member : part.members) {
    const auto& [group, slot, pose] = part.table[static_cast<std::size_t>(member)];
    fastest = std::max(fastest, group->frame(slot).angular_velocity(group->frame_constants()).norm());
  }
  const PartTuning& tuning = kConstraintsTuning.parts;
  double length = part.whole_step;
  while (fastest * length > tuning.most_turned && length > tuning.shortest_divided * part.whole_step) length *= 0.5;
  return length;
}

StepPart whole_step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                    std::span<Constraint* const> constraints, const IslandOptions& options) {
  return {.table = table,
          .members = members,
          .constraints = constraints,
          .options = options,
          .whole_step = options.step,
          .left = options.step};
}

}  // namespace

IslandReport IslandParts::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                               std::span<Constraint* const> constraints, const IslandOptions& options) {
  StepInParts& at = parts_;
  at.part = whole_step(table, members, constraints, options);
  at.report = {.bodies = static_cast<int>(members.size())};
  at.left = options.step;
  at.divides = may_divide(at.part);
  at.length = at.begun = length_of_parts(at.part);
  at.gives_up = false;
  begin_times(options.timed);
  for (;;) {
    at.divides ? find_divided() : find_cut();
    commit(at.part, at.done, at.report);
    if (at.part.ends) break;
    at.part.options.energy_surplus = at.report.energy_surplus;
    at.part.begins = false;
    at.left -= at.part.options.step;
  }
  clock_.lap(Stage::kSolve);
  at.report.statuses[at.report.status] = 1;
  at.report.times = times_;
  return at.report;
}

void IslandParts::begin_times(bool timed) {
  times_ = {};
  clock_ = StageClock(timed ? &times_ : nullptr);
}

/// What is left, or up to where the solver wants it cut.
void IslandParts::find_cut() {
  StepPart& part = parts_.part;
  part.last_resort = true;
  part.options.step = part.left = parts_.left;
  part.options.step = next_cut(part, parts_.report.attempts.cuts());
  part.ends = part.options.step == parts_.left;
  parts_.done = find_guarded(part);
  parts_.done.attempts[StepAttempt::kCutAtTouch] = part.ends ? 0 : 1;
}

/// What is left, in halves, quarters and so on of the step from where the rows do not come together. Where the shortest
/// part does not settle either, what is left is taken as it comes.
void IslandParts::find_divided() {
  StepPart& part = parts_.part;
  for (;; parts_.length *= 0.5) {
    if (parts_.gives_up || parts_.left < kConstraintsTuning.parts.last_part * parts_.length)
      parts_.length = parts_.left;  // the last, however rounded
    part.options.step = parts_.length;
    part.left = parts_.left;
    part.ends = parts_.length == parts_.left;
    part.last_resort = parts_.gives_up;
    parts_.done = find_guarded(part);
    if (parts_.done.accepted || parts_.gives_up) break;
    parts_.gives_up = parts_.length <
                      kConstraintsTuning.parts.last_part * kConstraintsTuning.parts.shortest_divided * part.whole_step;
  }
  parts_.done.attempts[StepAttempt::kDivided] = !part.ends && parts_.length < parts_.begun ? 1 : 0;
}

/// Impulses and slip_, by row.
void IslandParts::find_impulses() {
  impulses_.resize(step_.size());
  slip_.assign(step_.size(), 0.0);
  for (std::size_t i = 0; i < step_.size(); ++i)
    impulses_[i] = step_.f[i] + step_.length() * step_.reaction[i] + step_.touch_impulse[i] + step_.end_impulse[i];
  write_slip(slip_);
}

/// What has been found happens.
void IslandParts::commit(const StepPart& part, const IslandReport& done, IslandReport& report) {
  taken();
  clock_.lap(Stage::kSolve, step_.rows.size());
  const BodyStates states(part.table);
  for (Index local = 0; local < step_.bodies.count(); ++local)
    step_.bodies.body(local).group->commit(step_.bodies.body(local).slot, part.begins, part.ends);
  find_impulses();
  for (std::size_t i = 0; i < part.constraints.size(); ++i) {
    part.constraints[i]->slid(step_.of_constraint(slip_, i));
    part.constraints[i]->accept(states, step_.of_constraint(impulses_, i));
  }
  report.attempts.add(done.attempts);
  report.status = std::max(report.status, done.status);
  report.accepted = report.accepted && done.accepted;
  report.rows = step_.rows.size();
  report.iterations = std::max(report.iterations, done.iterations);
  report.newton_steps = std::max(report.newton_steps, done.newton_steps);
  report.change = std::max(report.change, done.change);
  report.energy_removed += done.energy_removed;
  report.energy_surplus = done.energy_surplus;
  clock_.lap(Stage::kCommit, step_.bodies.count());
}

}  // namespace limber::internal
