#include "limber/constraints/island_solver.h"

#include <algorithm>

#include "island_impl.h"

namespace limber {
namespace {

using internal::StepPart;

/// Whether nothing is to come part way into the step, or at its end.
bool has_no_dates(const StepPart& part) {
  return std::ranges::all_of(part.members, [&](Index member) {
    const auto& [group, slot, pose] = part.table[static_cast<std::size_t>(member)];
    return !group->frame(slot).has_next_parent() && !group->has_delayed_impulse(slot);
  });
}

/// Whether a step may be cut where bodies strike: free ones that nothing but contacts acts on.
bool allows_cuts(const StepPart& part) {
  return std::ranges::all_of(part.constraints, [](const Constraint* c) { return c->is_contact(); }) &&
         std::ranges::all_of(part.members,
                             [&](Index member) {
                               const ConstrainedBody& body = part.table[static_cast<std::size_t>(member)];
                               return body.group->frame_constants().motion == FrameMotion::kFree;
                             }) &&
         has_no_dates(part);
}

/// Whether a step may be taken in parts where it does not settle.
bool may_divide(const StepPart& part) {
  return std::ranges::all_of(part.constraints, [](const Constraint* c) { return c->may_be_divided(); }) &&
         has_no_dates(part);
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

IslandSolver::IslandSolver() : impl_(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

IslandReport IslandSolver::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  if (options.watch == nullptr) {
    foresee(table, members, constraints, options);
    const StageTimes foreseen = impl_->times;
    IslandReport report = finish();
    report.times.add(foreseen);
    return report;
  }
  IslandReport report{.bodies = static_cast<int>(members.size())};
  impl_->begin_times(options.timed);
  impl_->take_watched(whole_step(table, members, constraints, options), report);
  impl_->clock.lap(Stage::kSolve);
  report.statuses[report.status] = 1;
  report.times = impl_->times;
  return report;
}

void IslandSolver::foresee(std::span<const ConstrainedBody> table, std::span<const Index> members,
                           std::span<Constraint* const> constraints, const IslandOptions& options) {
  StepInParts& at = impl_->parts;
  at.part = whole_step(table, members, constraints, options);
  at.report = {.bodies = static_cast<int>(members.size())};
  at.left = at.length = options.step;
  at.may_cut = allows_cuts(at.part);
  at.divides = may_divide(at.part);
  at.gives_up = false;
  impl_->begin_times(options.timed);
  impl_->foresee_next();
  if (at.part.ends) impl_->tell_foreseen();
  impl_->clock.lap(Stage::kSolve);
}

void IslandSolver::refine() {
  StepInParts& at = impl_->parts;
  impl_->begin_times(at.part.options.timed);
  if (!at.done.rough) return;
  at.part.options.rough = 0.0;
  at.done = impl_->refine(at.part, at.done);
  impl_->end_cut();
  if (at.part.ends) impl_->tell_foreseen();
  impl_->clock.lap(Stage::kSolve);
}

const IslandReport& IslandSolver::foreseen() const { return impl_->parts.done; }
const StageTimes& IslandSolver::times() const { return impl_->times; }

IslandReport IslandSolver::finish() {
  StepInParts& at = impl_->parts;
  impl_->begin_times(at.part.options.timed);
  for (;;) {
    impl_->commit(at.part, at.done, at.report);
    if (at.part.ends) break;
    at.part.options.energy_surplus = at.report.energy_surplus;
    at.part.begins = false;
    at.left -= at.part.options.step;
    impl_->foresee_next();
  }
  impl_->clock.lap(Stage::kSolve);
  at.report.statuses[at.report.status] = 1;
  at.report.times = impl_->times;
  return at.report;
}

void IslandSolver::Impl::begin_times(bool timed) {
  times = {};
  clock = StageClock(timed ? &times : nullptr);
}

void IslandSolver::Impl::foresee_next() { parts.divides ? foresee_divided() : foresee_cut(); }

/// One part, as long as the watch lets it be. The impulses of a shorter one are found anew. As they are those of a
/// shorter part of the same step (PartOfStep::ahead), it moves as the longer one would have until then, but for how
/// bodies bend; so the last one is not looked at again. However short, its impulses act.
void IslandSolver::Impl::take_watched(StepPart part, IslandReport& report) {
  constexpr int kMostLooks = 3;
  constexpr double kShortest = 1e-9;  // of the whole step
  IslandOptions& options = part.options;
  if (options.whole_step > 0.0) part.whole_step = options.whole_step;
  part.begins = options.begins, part.ends = false;
  IslandReport done = foresee_guarded(part);
  for (int looks = 0; looks < kMostLooks; ++looks) {
    const double clear = options.watch->clear_until({part.members, motions}, options.step);
    if (!(clear < options.step)) break;
    options.step = std::max(clear, kShortest * part.whole_step);
    done = foresee_guarded(part);
  }
  report.taken = options.step;
  commit(part, done, report);
}

/// What is left, or up to where an impact begins or lets go.
void IslandSolver::Impl::foresee_cut() {
  constexpr int kMostCuts = 4;
  StepPart& part = parts.part;
  part.last_resort = true;
  parts.cuts = parts.may_cut && parts.report.attempts.cuts() < kMostCuts;
  part.options.step = part.left = parts.left;
  const double time = parts.cuts ? next_cut(part) : parts.left;
  if (is_part(time, parts.left, part.whole_step)) part.options.step = time;
  part.ends = part.options.step == parts.left;
  parts.done = foresee_guarded(part);
  end_cut();
}

void IslandSolver::Impl::end_cut() {
  if (parts.done.rough) return;
  parts.done.attempts[StepAttempt::kCutAtTouch] = parts.part.ends ? 0 : 1;
  if (parts.cuts) end_at_release(parts.part, parts.done);
}

/// What is left, in halves, quarters and so on of the step from where the rows do not come together: impulses at a
/// step's start bring joints together at its end only where bodies turn by less than a radian or so in between. Where
/// the shortest part does not settle either, what is left is taken as it comes.
void IslandSolver::Impl::foresee_divided() {
  constexpr double kShortest = 1.0 / 64.0;  // of the step
  StepPart& part = parts.part;
  for (;; parts.length *= 0.5) {
    if (parts.gives_up || parts.left < 1.5 * parts.length) parts.length = parts.left;  // the last, however rounded
    part.options.step = parts.length;
    part.left = parts.left;
    part.ends = parts.length == parts.left;
    part.last_resort = parts.gives_up;
    parts.done = foresee_guarded(part);
    if (parts.done.accepted || parts.gives_up) break;
    parts.gives_up = parts.length < 1.5 * kShortest * part.whole_step;
  }
  parts.done.attempts[StepAttempt::kDivided] = part.ends ? 0 : 1;
}

/// The first time at which a constraint wants the step cut; all of the part where none does.
double IslandSolver::Impl::next_cut(const StepPart& part) {
  double left = part.options.step;
  if (motions.size() < part.members.size()) motions.resize(part.members.size());
  for (std::size_t i = 0; i < part.members.size(); ++i) {
    const ConstrainedBody& body = part.table[static_cast<std::size_t>(part.members[i])];
    body.group->predict_motion(body.slot, part.options.gravity, left, motions[i]);
  }
  const FreeMotions free{part.members, std::span(motions).first(part.members.size())};
  for (Constraint* constraint : part.constraints) left = constraint->next_cut(BodyStates(part.table), free, left);
  return left;
}

/// Impulses and slip, by row.
void IslandSolver::Impl::find_impulses() {
  impulses.resize(step.size());
  slip.assign(step.size(), 0.0);
  for (std::size_t i = 0; i < step.size(); ++i)
    impulses[i] = step.f[i] + step.length() * step.reaction[i] + step.touch_impulse[i] + step.end_impulse[i];
  if (step.convex) rounds.write_slip(step, slip);
  if (step.mean) mean.write_slip(step, slip);
}

void IslandSolver::Impl::tell_foreseen() {
  find_impulses();
  for (std::size_t i = 0; i < step.part.constraints.size(); ++i)
    step.part.constraints[i]->foreseen(step.of_constraint(impulses, i), step.of_constraint(slip, i));
}

/// What has been foreseen happens.
void IslandSolver::Impl::commit(const StepPart& part, const IslandReport& done, IslandReport& report) {
  clock.lap(Stage::kSolve, step.rows.size());
  const BodyStates states(part.table);
  for (Index local = 0; local < step.bodies.count(); ++local)
    step.bodies.body(local).group->commit(step.bodies.body(local).slot, part.begins, part.ends);
  find_impulses();
  for (std::size_t i = 0; i < part.constraints.size(); ++i) {
    part.constraints[i]->slid(step.of_constraint(slip, i));
    part.constraints[i]->accept(states, step.of_constraint(impulses, i));
  }
  report.programs.add(done.programs);
  report.attempts.add(done.attempts);
  report.status = std::max(report.status, done.status);
  report.accepted = report.accepted && done.accepted;
  report.rows = step.rows.size();
  report.iterations = std::max(report.iterations, done.iterations);
  report.newton_steps = std::max(report.newton_steps, done.newton_steps);
  report.change = std::max(report.change, done.change);
  report.energy_removed += done.energy_removed;
  report.energy_surplus = done.energy_surplus;
  clock.lap(Stage::kCommit, step.bodies.count());
}

}  // namespace limber
