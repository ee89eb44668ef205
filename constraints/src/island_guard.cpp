#include <algorithm>
#include <cmath>

#include "island_step.h"

namespace limber {
/// What it takes to lift all bodies of the island by a distance within a step. Rows that push overlapping bodies apart
/// may do no more, however hard they press against each other.
double IslandSolver::Impl::largest_recovery_work(double distance, const IslandOptions& options) const {
  const double speed = distance / options.step;
  double work = 0.0;
  for (Index local = 0; local < bodies.count(); ++local)
    work +=
        bodies.body(local).group->frame_constants().mass * (0.5 * speed * speed + options.gravity.norm() * distance);
  return work;
}

/// Σ f/Δt times the agents' displacements, what is negative not counted, and what the rows' springs give.
double IslandSolver::Impl::agent_work(const IslandOptions& options) const {
  double work = 0.0;
  double recovery_work = 0.0, recovery = 0.0;
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const double given = std::max(0.0, (f[i] / options.step + reaction[i]) * laws[i].agent_displacement);
    if (laws[i].lower == 0.0) {
      recovery_work += given;
      recovery = std::max(recovery, laws[i].agent_displacement);
    } else {
      work += given;
    }
    // A spring with one bound pushes on one side alone.
    const double before = laws[i].lower == 0.0 ? std::min(start_gap[i], 0.0) : start_gap[i];
    const double after = laws[i].lower == 0.0 ? std::min(gap[i], 0.0) : gap[i];
    work += 0.5 * laws[i].stiffness * (before * before - after * after);
  }
  work += std::min(recovery_work, largest_recovery_work(recovery, options));
  work += stored_energy;
  for (const ConstraintRows::Flexibility& g : flexibility) {
    const auto i = static_cast<std::size_t>(g.i), j = static_cast<std::size_t>(g.j);
    work -= (i == j ? 0.5 : 1.0) * g.value * (f[i] / step + reaction[i]) * (f[j] / step + reaction[j]);
  }
  return work;
}

/// Whether only rows act that can neither give nor take energy: hard ones that no agent moves.
bool IslandSolver::Impl::is_workless() const {
  if (stored_energy > 0.0) return false;  // dents that let go
  for (std::size_t i = 0; i < laws.size(); ++i) {
    if (f[i] == 0.0 && reaction[i] == 0.0) continue;
    if (!is_equality(laws[i]) || laws[i].compliance > 0.0 || laws[i].agent_displacement != 0.0) return false;
  }
  return true;
}

/// Of the rows: in the step, at a touch before it, and at its end.
std::span<const double> IslandSolver::Impl::whole_impulses() {
  for (std::size_t i = 0; i < f.size(); ++i) b[i] = f[i] + step * (reaction[i] + end_reaction[i]);
  for (std::size_t i = 0; holds_contact_forces() && i < f.size(); ++i) b[i] += touch_impulse[i];
  return b;
}

/// What the energy is above what it may be, when all motion at the step's end that may be taken has been.
double IslandSolver::Impl::close_energy(const IslandOptions& options, IslandReport& report) {
  const bool settled = report.status == SolveStatus::kSolved;
  const bool give_back = options.undisturbed && settled && slowed == 0.0 && is_workless();
  const IslandEnergy::Change done =
      energy.guard(bodies, rows, whole_impulses(), agent_work(options), give_back, options);
  report.energy_removed = done.removed + start_energy * slowed * (2.0 - slowed);
  report.energy_surplus = done.surplus;
  return done.left;
}

/// Whether overlapping bodies are being pushed apart.
bool IslandSolver::Impl::has_recovery() const {
  return std::ranges::any_of(laws, [](const RowLaw& law) { return law.contact && law.agent_displacement > 0.0; });
}

/// Overlap stays as it is. Where a part of one body is caught between two of another, contacts that push it either way
/// would press without bound to come apart; that nothing comes closer they can all have, by standing still.
void IslandSolver::Impl::stop_recovery() {
  for (Index i = 0; i < rows.size(); ++i) {
    RowLaw& law = rows.row(i).law;
    if (!law.contact) continue;
    law.offset -= law.agent_displacement;
    law.agent_displacement = 0.0;
  }
}

/// Rows that came together, and yet the bodies end higher than they may: a swing that turns round within the step. It
/// is to begin more slowly, at rest in the end. @return whether there is motion to take
bool IslandSolver::Impl::slow_start(double left) {
  constexpr double kMore = 1.5;  // of what is left is taken, as the motion taken would not have gone all into height
  if (slowed == 0.0) start_energy = IslandEnergy::start_motion(bodies, rows, whole_impulses(), start_momenta);
  if (slowed == 1.0 || !(start_energy > 0.0)) return false;
  const double moving = (1.0 - slowed) * (1.0 - slowed) - kMore * left / start_energy;
  constexpr double kLeast = 0.01;  // of the energy: what is slower may as well rest
  slowed = moving > kLeast ? 1.0 - std::sqrt(moving) : 1.0;
  return true;
}

/// Islands of nothing but contacts: what their gaps may be off is energy where they are at rest, with no motion to take
/// it from, and most of all in large ones. Forces that are smaller by a part that no gap shows let the pile down by as
/// much.
/// @return whether they do
bool IslandSolver::Impl::yield(const BodyStates& states, std::span<Constraint* const> constraints,
                               const IslandOptions& options, IslandReport& report) {
  if (!std::ranges::all_of(laws, &RowLaw::contact)) return false;
  next_f = f, change = reaction;
  const auto scale = [&](double part) {
    for (std::size_t i = 0; i < f.size(); ++i) f[i] = part * next_f[i], reaction[i] = part * change[i];
  };
  for (const double share : {1e-6, 1e-5, 1e-4}) {  // of ½gΔt², at 60 steps a second 0.14 µm at most
    scale(1.0 - share);
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
    answer_at_end(states, constraints, options);
    if (!(close_energy(options, report) > 0.0)) return true;
  }
  scale(1.0);
  return false;
}

/// Where neither is enough, since the rows did not come together and have left bodies bent, or loads have moved to
/// contacts that have to be filled first: less of the impulses, in the end none. The free step has the energy it began
/// with. Where contacts alone act, as little less as will do: half of what holds a pile would be half a fall.
void IslandSolver::Impl::refuse_impulses(const BodyStates& states, std::span<Constraint* const> constraints,
                                         const IslandOptions& options, IslandReport& report) {
  constexpr double kLeast = 4e-4;
  report.status = SolveStatus::kIterationLimit;
  const double first = std::ranges::all_of(laws, &RowLaw::contact) ? 0.01 : 0.5;
  for (double refused = first, accepted = 1.0; accepted > 0.0; refused = std::min(2.0 * refused, 0.5)) {
    accepted *= 1.0 - refused;
    if (accepted < kLeast) accepted = 0.0;
    for (std::size_t i = 0; i < f.size(); ++i) {
      f[i] = accepted == 0.0 ? 0.0 : (1.0 - refused) * f[i];  // not times 0: they need not be finite
      reaction[i] = accepted == 0.0 ? 0.0 : (1.0 - refused) * reaction[i];
    }
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
    if (!(close_energy(options, report) > 0.0)) return;
  }
}

}  // namespace limber
