// Who meets in a step, and the two ways of a step through contacts, handles and joints.
#pragma once

#include "contact_registry.h"
#include "exact_path.h"
#include "game_path.h"

namespace limber::internal {

struct ContactPaths {
  ContactPaths(BodyTable& bodies, ConstraintStage& constraints, SleepStage& sleep)
      : registry(bodies), exact(bodies, constraints, sleep, registry), game(bodies, constraints, sleep, registry) {}

  /// That of the contact solver in force.
  StepPath& in_force() {
    if (solver == ContactSolver::kGame) return game;
    return exact;
  }
  /// Forgets what was known of contacts. @param options name the solver that is in force from now on
  void reset(const ContactOptions& options) {
    exact.reset(options);
    game.reset(options);
    solver = options.solver;
  }

  ContactRegistry registry;
  ExactPath exact;
  GamePath game;
  ContactSolver solver = kDefaultContactSolver;
};

}  // namespace limber::internal
