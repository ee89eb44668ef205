#include <algorithm>

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

/// Where not even standing still is enough, since the rows did not come together and have left bodies bent: less of the
/// impulses, in the end none. The free step has the energy it began with.
void IslandSolver::Impl::guard_energy(const BodyStates& states, std::span<Constraint* const> constraints,
                                      const IslandOptions& options, IslandReport& report) {
  constexpr int kHalvings = 12;
  bool give_back = options.undisturbed && report.status == SolveStatus::kSolved && is_workless();
  for (int halving = 0;; ++halving) {
    const IslandEnergy::Change done = energy.guard(bodies, rows, agent_work(options), give_back, options);
    report.energy_removed = done.removed;
    report.energy_surplus = done.surplus;
    if (!(done.left > 0.0) || halving == kHalvings) return;
    const bool last = halving + 1 == kHalvings;
    for (std::size_t i = 0; i < f.size(); ++i) {
      f[i] = last ? 0.0 : 0.5 * f[i];  // not times 0: they need not be finite
      reaction[i] = last ? 0.0 : 0.5 * reaction[i];
    }
    give_back = false;
    report.status = SolveStatus::kIterationLimit;
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
  }
}

}  // namespace limber
