// The path of a step by small steps: substeps over all rows (small_steps.h). Work is bounded: nothing is looked at
// twice but where sleepers wake.
#pragma once

#include <vector>

#include "limber/constraints/small_steps.h"
#include "step_path.h"

namespace limber::internal {

class GamePath final : public StepPath {
 public:
  using StepPath::StepPath;

  void save_state(StateWriter& state) const override;
  void restore_state(StateReader& state) override;

 protected:
  int parts() const override { return rows().options().small_steps.substeps; }
  IslandReport solve(const Substep& substep, Jobs& jobs, StageClock& clock) override;
  void clear() override { solver_.clear(); }

 private:
  void list_constraints();

  SmallStepSolver solver_;
  std::vector<Constraint*> constraining_;  // handles and joints that act
};

}  // namespace limber::internal
