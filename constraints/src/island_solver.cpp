#include "limber/constraints/island_solver.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "island_step.h"

namespace limber {
namespace {

/// θ: forces are truly held while a contact strikes. Joints and hands keep θ = 1, for their velocities' sake.
double start_share(std::span<const RowLaw> laws) {
  const bool contacts_alone = std::ranges::all_of(laws, &RowLaw::contact);
  return contacts_alone && std::ranges::any_of(laws, &RowLaw::strikes) ? 0.5 : 1.0;
}

constexpr int kMostCuts = 4;  // of a step

/// Bodies that the rows, gravity and held forces move, and nothing else.
bool are_free(std::span<const ConstrainedBody> table, std::span<const Index> members) {
  return std::ranges::all_of(members, [&](Index member) {
    const auto& [group, slot, pose] = table[static_cast<std::size_t>(member)];
    return group->frame_constants().motion == FrameMotion::kFree && !group->has_delayed_impulse(slot);
  });
}

/// Whether a step may be cut where bodies strike: free ones that nothing but contacts acts on.
bool allows_cuts(std::span<const ConstrainedBody> table, std::span<const Index> members,
                 std::span<Constraint* const> constraints) {
  return std::ranges::all_of(constraints, [](const Constraint* c) { return c->is_contact(); }) &&
         are_free(table, members);
}

/// Whether a step may be taken in parts where it does not settle: free bodies that joints alone act on.
bool may_divide(std::span<const ConstrainedBody> table, std::span<const Index> members,
                std::span<Constraint* const> constraints) {
  return std::ranges::all_of(constraints, [](const Constraint* c) { return c->may_be_divided(); }) &&
         are_free(table, members);
}

}  // namespace

IslandSolver::IslandSolver() : impl_(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

IslandReport IslandSolver::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  Impl& s = *impl_;
  IslandReport report{.bodies = static_cast<int>(members.size())};
  Impl::Part part{table, members, constraints, true, true};
  if (may_divide(table, members, constraints)) {
    s.take_divided(part, options, report);
    return report;
  }
  const bool may_cut = allows_cuts(table, members, constraints);
  IslandOptions own = options;
  for (double left = options.step;; left -= own.step, part.begins = false, ++report.cuts) {
    const bool cuts = may_cut && report.cuts < kMostCuts;
    const double time = cuts ? s.next_cut(table, members, constraints, options.gravity, left) : left;
    own.step = is_part(time, left, options.step) ? time : left;
    part.ends = own.step == left;
    IslandReport done = s.foresee_guarded(part, own, options.step);
    if (cuts) s.end_at_release(part, own, options.step, done);
    s.commit(part, own, done, report);
    if (part.ends) return report;
    own.energy_surplus = report.energy_surplus;
  }
}

/// A step, in halves, quarters and so on of it from where the rows do not come together: impulses at a step's start
/// bring joints together at its end only where bodies turn by less than a radian or so in between. Where the shortest
/// part does not settle either, what is left is taken as it comes.
void IslandSolver::Impl::take_divided(Part part, IslandOptions options, IslandReport& report) {
  constexpr double kShortest = 1.0 / 64.0;  // of the step
  const double whole = options.step;
  double left = whole, length = whole;
  bool gives_up = false;
  for (;;) {
    if (gives_up || left < 1.5 * length) length = left;  // the last one, whatever has been rounded
    options.step = length;
    part.ends = length == left;
    const IslandReport done = foresee_guarded(part, options, whole);
    if (done.status == SolveStatus::kIterationLimit && !gives_up) {
      gives_up = length < 1.5 * kShortest * whole;
      length *= 0.5;
      continue;
    }
    commit(part, options, done, report);
    if (part.ends) return;
    options.energy_surplus = report.energy_surplus;
    left -= length;
    part.begins = false;
    ++report.cuts;
  }
}

/// What has been foreseen happens.
void IslandSolver::Impl::commit(const Part& part, const IslandOptions& options, IslandReport done,
                                IslandReport& report) {
  const BodyStates states(part.table);
  for (Index local = 0; local < bodies.count(); ++local)
    bodies.body(local).group->commit(bodies.body(local).slot, part.begins, part.ends);
  for (std::size_t i = 0; i < f.size(); ++i) f[i] += options.step * reaction[i];
  for (std::size_t i = 0; holds_contact_forces() && i < f.size(); ++i) f[i] += touch_impulse[i];
  find_slip();
  done.programs.add(program_report);
  report.programs.add(done.programs);
  for (std::size_t i = 0; i < part.constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(first_row[i]), end = static_cast<std::size_t>(first_row[i + 1]);
    part.constraints[i]->slid(std::span<const double>(slip).subspan(begin, end - begin));
    part.constraints[i]->accept(states, std::span<const double>(f).subspan(begin, end - begin));
  }
  if (done.status != SolveStatus::kSolved) report.status = done.status;
  report.rows = rows.size();
  report.iterations = std::max(report.iterations, done.iterations);
  report.newton_steps = std::max(report.newton_steps, done.newton_steps);
  report.change = std::max(report.change, done.change);
  report.energy_removed += done.energy_removed;
  report.energy_surplus = done.energy_surplus;
}

/// Of contacts that press, where the next step is to begin with it.
void IslandSolver::Impl::find_slip() {
  slip.assign(f.size(), 0.0);
  for (std::size_t u = 0; takes_loads_early() && u < units.size(); ++u)
    if (laws[units[u].first].friction > 0.0 && units[u].impulse[0] > 0.0)
      slip[units[u].first] = units[u].end.tail<2>().norm();
}

/// What becomes of the members by the end, all but the energy.
IslandReport IslandSolver::Impl::foresee(const Part& part, const IslandOptions& options, double whole_step) {
  const BodyStates states(part.table);
  rule = options.contact;
  gather(part.table, part.members, part.constraints, options);
  set_modal_steps(options.step, whole_step);
  IslandReport done;
  energy.begin(bodies, options.gravity);
  program_report = {};
  if (holds_contact_forces()) solve_touch(options, done.programs);
  find_reaction(StepTime::kStart, options, reaction);
  done.status = iterate(states, part.constraints, options, done);
  answer_at_end(states, part.constraints, options);
  return done;
}

/// And the energy with it.
IslandReport IslandSolver::Impl::foresee_guarded(const Part& part, const IslandOptions& options, double whole_step) {
  constexpr int kSlowings = 3;
  slowed = 0.0, recovers = true;
  IslandReport done = foresee(part, options, whole_step);
  if (!options.guard_energy || (rule.is_program() && rule.guard == ProgramGuard::kNone)) return done;
  for (int slowing = 0;; ++slowing) {
    const double left = close_energy(options, done);
    if (!(left > 0.0) || (convex && yield(BodyStates(part.table), part.constraints, options, done))) return done;
    if (recovers && !flexibility.empty() && has_recovery()) {
      recovers = false, slowing = -1;
      done = foresee(part, options, whole_step);
      continue;
    }
    const bool settled = done.status == SolveStatus::kSolved && !holds_contact_forces() && std::isfinite(left);
    if (!settled || slowing == kSlowings || !slow_start(left)) break;
    done = foresee(part, options, whole_step);
  }
  if (!convex && done.status == SolveStatus::kSolved && yield(BodyStates(part.table), part.constraints, options, done))
    return done;
  refuse_impulses(BodyStates(part.table), part.constraints, options, done);
  return done;
}

/// The first time at which a constraint wants the step cut; all of what is left of it where none does.
double IslandSolver::Impl::next_cut(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                    std::span<Constraint* const> constraints, const Vec3& gravity, double left) {
  if (motions.size() < members.size()) motions.resize(members.size());
  for (std::size_t i = 0; i < members.size(); ++i) {
    const ConstrainedBody& body = table[static_cast<std::size_t>(members[i])];
    body.group->predict_motion(body.slot, gravity, left, motions[i]);
  }
  const FreeMotions free{members, std::span(motions).first(members.size())};
  for (Constraint* constraint : constraints) left = constraint->next_cut(BodyStates(table), free, left);
  return left;
}

/// Makes the modes go through a part of a step, or through an impact, in which all of them move: those that answer
/// statically would lose what they store, and no hand is there to whip them.
void IslandSolver::Impl::set_modal_steps(double length, double whole_step) {
  if (theta == 1.0 && length == whole_step) return;
  const auto count = static_cast<std::size_t>(bodies.count());
  if (modal_steps.size() < count) modal_steps.resize(count);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ModalModelData& data = bodies.body(local).group->model().data();
    modal_steps[static_cast<std::size_t>(local)].set(data.eigenvalues, data.decays, length,
                                                     theta < 1.0 ? ModalStep::kNone : std::numbers::pi / whole_step);
  }
  bodies.set_modal_steps(std::span(modal_steps).first(count));
}

void IslandSolver::Impl::gather(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  bodies.set(table, members);
  rows.clear();
  first_row.clear();
  const BodyStates states(table);
  for (Constraint* constraint : constraints) {
    first_row.push_back(rows.size());
    constraint->add_rows(states, StepTime::kStart, options.step, rows);
  }
  first_row.push_back(rows.size());
  if (!recovers) stop_recovery();
  laws.clear();
  for (Index i = 0; i < rows.size(); ++i) laws.push_back(rows.row(i).law);
  theta = start_share(laws);
  flexibility = rows.flexibility();
  stored_energy = rows.stored_energy();
  const auto m = static_cast<std::size_t>(rows.size()), n = static_cast<std::size_t>(bodies.degrees_of_freedom());
  convex = rule.is_convex() && std::ranges::any_of(laws, &RowLaw::contact);
  begin_early();
  metric.resize(n), weighted.resize(n);
  if (needs_jacobian()) J.resize(m * n);
  for (std::vector<double>* v : {&gap, &start_gap, &b, &lower, &upper, &compliance, &next_f, &change}) v->resize(m);
  f.assign(m, 0.0), reaction.assign(m, 0.0), end_reaction.assign(m, 0.0);
  if (needs_jacobian()) bodies.write_jacobian(rows, J);
  measure(states, StepTime::kStart, constraints, gap);
  start_gap = gap;
}

void IslandSolver::Impl::measure(const BodyStates& states, StepTime when, std::span<Constraint* const> constraints,
                                 std::vector<double>& into) const {
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(first_row[i]), end = static_cast<std::size_t>(first_row[i + 1]);
    constraints[i]->gaps(states, when, std::span(into).subspan(begin, end - begin));
  }
}

/// The bodies under θ f and the first half of the reaction at the step's start; their modes under all of both, held.
void IslandSolver::Impl::predict(const IslandOptions& options) {
  sum_loads(f, theta, 1.0);
  add_loads(reaction, 0.5 * options.step, options.step);
  for (std::size_t i = 0; slowed > 0.0 && i < loads.size(); ++i) {
    loads[i].impulse -= slowed * start_momenta[i].linear;
    loads[i].moment -= slowed * start_momenta[i].angular;
  }
  predict_under_loads(options);
}

void IslandSolver::Impl::predict_under_loads(const IslandOptions& options) {
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
    Vec3 gravity = options.gravity;
    if (early[static_cast<std::size_t>(local)] != 0) {
      const FrameConstants& c = body.group->frame_constants();
      const Vec3 early = options.step * c.mass * gravity,
                 arm = body.group->frame(body.slot).pose().q * c.center_of_mass;
      load.impulse += early + options.step * body.group->held_force(body.slot);
      load.moment += arm.cross(early);
      gravity = -body.group->held_force(body.slot) / c.mass;
    }
    body.group->predict(body.slot, gravity, load, bodies.modal_step(local));
  }
}

void IslandSolver::Impl::sum_loads(std::span<const double> values, double frame_scale, double modal_scale) {
  loads.assign(static_cast<std::size_t>(bodies.count()), {});
  modal_loads.assign(metric.size(), 0.0);
  for (Index local = 0; local < bodies.count(); ++local)
    loads[static_cast<std::size_t>(local)].modal = {
        modal_loads.data() + bodies.first(local) + bodies.response(local).size() - bodies.response(local).modes,
        static_cast<std::size_t>(bodies.response(local).modes)};
  add_loads(values, frame_scale, modal_scale);
}

void IslandSolver::Impl::add_loads(std::span<const double> values, double frame_scale, double modal_scale) {
  for (Index i = 0; i < rows.size(); ++i) {
    const double value = values[static_cast<std::size_t>(i)];
    if (value == 0.0) continue;
    for (const ConstraintRows::Side& side : rows.row(i).sides) {
      const Index local = bodies.local(side.body);
      if (local < 0) continue;
      ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
      load.impulse += frame_scale * value * side.linear;
      load.moment += frame_scale * value * side.angular;
      const std::span<const double> modal = rows.modal(side);
      double* sum = modal_loads.data() + (load.modal.data() - modal_loads.data());
      for (std::size_t k = 0; k < modal.size(); ++k) sum[k] += modal_scale * value * modal[k];
    }
  }
}

/// The frames' second half of what holds them, and of what strikes them: at the step's end, by the rows there.
void IslandSolver::Impl::answer_at_end(const BodyStates& states, std::span<Constraint* const> constraints,
                                       const IslandOptions& options) {
  if (takes_loads_early()) return;
  bodies.place(StepTime::kEnd);
  rows.clear();
  for (Constraint* constraint : constraints) constraint->add_rows(states, StepTime::kEnd, options.step, rows);
  if (holds_contact_forces()) hold_contact_forces(options.step);
  if (needs_jacobian()) bodies.write_jacobian(rows, J);
  find_reaction(StepTime::kEnd, options, end_reaction);
  sum_loads(end_reaction, 0.5 * options.step, 0.0);
  if (theta < 1.0) add_loads(f, 1.0 - theta, 0.0);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    const ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
    body.group->adjust_prediction(body.slot, load.impulse, load.moment, {});
  }
}

}  // namespace limber
