#include "game_path.h"

#include <iterator>

namespace limber::internal {

void GamePath::list_constraints() {
  const auto acts = [&](Index body) { return body >= 0 && constraints().constrained(body); };
  constraining_.clear();
  for (const ConstraintStage::Entry& entry : constraints().entries()) {
    Constraint* constraint = entry.constraint();
    if (constraint == nullptr) continue;
    const auto [a, b] = constraint->bodies();
    if (acts(a) || acts(b)) constraining_.push_back(constraint);
  }
}

IslandReport GamePath::solve(const Substep& substep, Jobs& jobs, StageClock& clock) {
  list_constraints();
  clock.lap(Stage::kRows, std::ssize(search().found()));
  const SmallStepReport report = solver_.step({.table = constraints().table(),
                                               .members = members(),
                                               .contacts = &rows().set,
                                               .constraints = constraining_,
                                               .thickness = search().thickness(),
                                               .step = substep.length,
                                               .gravity = substep.gravity},
                                              jobs);
  IslandReport sums;
  sums.status = report.solved ? IslandStatus::kSolved : IslandStatus::kFailed;
  sums.statuses[sums.status] = 1;
  sums.bodies = static_cast<int>(members().size());
  sums.rows = report.rows;
  sums.change = report.residual;
  clock.lap(Stage::kSolve, report.rows);
  return sums;
}

void GamePath::save_state(StateWriter& state) const {
  StepPath::save_state(state);
  solver_.save_state(state);
}

void GamePath::restore_state(StateReader& state) {
  StepPath::restore_state(state);
  solver_.restore_state(state);
}

}  // namespace limber::internal
