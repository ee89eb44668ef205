// The exact path of a step: islands, each solved to the law of its rows.
#pragma once

#include "step_path.h"

namespace limber::internal {

class ExactPath final : public StepPath {
 public:
  using StepPath::StepPath;

 protected:
  IslandReport solve(const Substep& substep, Jobs& jobs, StageClock& clock) override {
    constraints().step(jobs, {.step = substep.length, .gravity = substep.gravity, .timed = clock.runs()});
    if (clock.runs()) clock.lap(constraints().times(), Stage::kSolve);
    return constraints().report();
  }
};

}  // namespace limber::internal
