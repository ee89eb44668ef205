#include "limber/constraints/island_solver.h"

#include <algorithm>

#include "island_impl.h"

namespace limber {
namespace {

using internal::StepPart;

/// Bodies that the rows, gravity and held forces move, and nothing else.
bool are_free(const StepPart& part) {
  return std::ranges::all_of(part.members, [&](Index member) {
    const auto& [group, slot, pose] = part.table[static_cast<std::size_t>(member)];
    return group->frame_constants().motion == FrameMotion::kFree && !group->has_delayed_impulse(slot);
  });
}

/// Whether a step may be cut where bodies strike: free ones that nothing but contacts acts on.
bool allows_cuts(const StepPart& part) {
  return std::ranges::all_of(part.constraints, [](const Constraint* c) { return c->is_contact(); }) && are_free(part);
}

/// Whether a step may be taken in parts where it does not settle: free bodies that joints alone act on.
bool may_divide(const StepPart& part) {
  return std::ranges::all_of(part.constraints, [](const Constraint* c) { return c->may_be_divided(); }) &&
         are_free(part);
}

}  // namespace

IslandSolver::IslandSolver() : impl_(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

IslandReport IslandSolver::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  IslandReport report{.bodies = static_cast<int>(members.size())};
  const StepPart whole{.table = table,
                       .members = members,
                       .constraints = constraints,
                       .options = options,
                       .whole_step = options.step,
                       .left = options.step};
  if (options.watch != nullptr)
    impl_->take_watched(whole, report);
  else if (may_divide(whole))
    impl_->take_divided(whole, report);
  else
    impl_->take_cut(whole, report);
  return report;
}

/// One part, as long as the watch lets it be. A shorter one is another motion, which the watch is shown in its turn.
void IslandSolver::Impl::take_watched(StepPart part, IslandReport& report) {
  constexpr int kMostLooks = 3;
  constexpr double kShortest = 1e-9;  // of the whole step: less is no motion
  IslandOptions& options = part.options;
  if (options.whole_step > 0.0) part.whole_step = options.whole_step;
  part.begins = options.begins, part.ends = false;
  IslandReport done;
  for (int looks = 1;; ++looks) {
    done = foresee_guarded(part);
    const double clear = options.watch->clear_until({part.members, motions}, options.step);
    if (!(clear < options.step) || looks == kMostLooks) break;
    if (clear < kShortest * part.whole_step) return;
    options.step = clear;
  }
  report.taken = options.step;
  commit(part, done, report);
}

/// A step, in parts where impacts begin or let go.
void IslandSolver::Impl::take_cut(StepPart part, IslandReport& report) {
  constexpr int kMostCuts = 4;
  const bool may_cut = allows_cuts(part);
  for (double left = part.whole_step;; left -= part.options.step, part.begins = false) {
    const bool cuts = may_cut && report.attempts.cuts() < kMostCuts;
    part.options.step = part.left = left;
    const double time = cuts ? next_cut(part) : left;
    if (is_part(time, left, part.whole_step)) part.options.step = time;
    part.ends = part.options.step == left;
    IslandReport done = foresee_guarded(part);
    done.attempts[StepAttempt::kCutAtTouch] = part.ends ? 0 : 1;
    if (cuts) end_at_release(part, done);
    commit(part, done, report);
    if (part.ends) return;
    part.options.energy_surplus = report.energy_surplus;
  }
}

/// A step, in halves, quarters and so on of it from where the rows do not come together: impulses at a step's start
/// bring joints together at its end only where bodies turn by less than a radian or so in between. Where the shortest
/// part does not settle either, what is left is taken as it comes.
void IslandSolver::Impl::take_divided(StepPart part, IslandReport& report) {
  constexpr double kShortest = 1.0 / 64.0;  // of the step
  double left = part.whole_step, length = part.whole_step;
  bool gives_up = false;
  for (;;) {
    if (gives_up || left < 1.5 * length) length = left;  // the last one, whatever has been rounded
    part.options.step = length;
    part.left = left;
    part.ends = length == left;
    part.last_resort = gives_up;
    IslandReport done = foresee_guarded(part);
    if (done.status == SolveStatus::kIterationLimit && !gives_up) {
      gives_up = length < 1.5 * kShortest * part.whole_step;
      length *= 0.5;
      continue;
    }
    done.attempts[StepAttempt::kDivided] = part.ends ? 0 : 1;
    commit(part, done, report);
    if (part.ends) return;
    part.options.energy_surplus = report.energy_surplus;
    left -= length;
    part.begins = false;
  }
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

/// What has been foreseen happens.
void IslandSolver::Impl::commit(const StepPart& part, const IslandReport& done, IslandReport& report) {
  const BodyStates states(part.table);
  for (Index local = 0; local < step.bodies.count(); ++local)
    step.bodies.body(local).group->commit(step.bodies.body(local).slot, part.begins, part.ends);
  impulses.resize(step.size());
  slip.assign(step.size(), 0.0);
  for (std::size_t i = 0; i < step.size(); ++i)
    impulses[i] = step.f[i] + step.length() * step.reaction[i] + step.touch_impulse[i] + step.end_impulse[i];
  if (step.convex) rounds.write_slip(step, slip);
  for (std::size_t i = 0; i < part.constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(step.first_row[i]);
    const std::size_t count = static_cast<std::size_t>(step.first_row[i + 1]) - begin;
    part.constraints[i]->slid(std::span<const double>(slip).subspan(begin, count));
    part.constraints[i]->accept(states, std::span<const double>(impulses).subspan(begin, count));
  }
  report.programs.add(done.programs);
  report.attempts.add(done.attempts);
  if (done.status != SolveStatus::kSolved) report.status = done.status;
  report.rows = step.rows.size();
  report.iterations = std::max(report.iterations, done.iterations);
  report.newton_steps = std::max(report.newton_steps, done.newton_steps);
  report.change = std::max(report.change, done.change);
  report.energy_removed += done.energy_removed;
  report.energy_surplus = done.energy_surplus;
}

}  // namespace limber
