// A pose to be found: by PoseSolver, or by a PoseMethod that a session was given.
#pragma once

#include <vector>

#include "limber/posing/pose_method.h"
#include "skin/skin.h"
#include "solver/pose_energy.h"

namespace limber::internal {

struct PoseProblem {
  const PoseStructure& structure;
  const PosingOptions& options;
  std::vector<HandleTerm> handles;
};

struct AffinePose {
  std::vector<BodyMap> maps;  // by body
  std::vector<double> turns;  // by joint, with full turns, rad
};

}  // namespace limber::internal
