#include "limber/constraints/small_steps.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "game_bodies.h"
#include "game_constraints.h"
#include "game_contacts.h"
#include "limber/constraints/contact_constraint.h"
#include "limber/core/error.h"

namespace limber {

using internal::GameBodies;
using internal::GameConstraints;
using internal::GameContacts;

void SmallSteps::validate() const {
  if (substeps < 1)
    throw InvalidArgument("SmallSteps: substeps is " + std::to_string(substeps) + ", expected at least 1");
  const auto number = [](double value, const char* name) {
    if (!(value >= 0.0) || std::isinf(value))
      throw InvalidArgument(std::string("SmallSteps: ") + name + " is " + std::to_string(value) +
                            ", expected a finite number of at least 0");
  };
  number(slop, "slop");
  number(push_speed, "push_speed");
}

struct SmallStepSolver::Impl {
  GameBodies bodies;
  GameContacts contacts;
  GameConstraints constraints;

  void take_substep(const SmallStepProblem& problem, const SmallSteps& steps, int number, Jobs& jobs);
};

SmallStepSolver::SmallStepSolver() : impl_(std::make_unique<Impl>()) {}
SmallStepSolver::~SmallStepSolver() = default;
SmallStepSolver::SmallStepSolver(SmallStepSolver&&) noexcept = default;
SmallStepSolver& SmallStepSolver::operator=(SmallStepSolver&&) noexcept = default;

SmallStepReport SmallStepSolver::step(const SmallStepProblem& problem, Jobs& jobs) {
  Impl& m = *impl_;
  const BodyStates states(problem.table);
  const SmallSteps steps = problem.contacts != nullptr ? problem.contacts->options().small_steps : SmallSteps{};
  m.bodies.begin_step(problem.table, problem.members,
                      {.step = problem.step,
                       .count = steps.substeps,
                       .gravity = problem.gravity,
                       .seen = !problem.constraints.empty()});
  GameContacts::Options options{.steps = steps, .thickness = problem.thickness};
  std::span<PreparedContact> contacts;
  if (problem.contacts != nullptr) {
    options.rolling_friction = problem.contacts->options().rolling_friction;
    options.residual_compliance = problem.contacts->options().residual_compliance;
    contacts = problem.contacts->prepared();
  }
  m.contacts.begin_step(states, m.bodies, contacts, options, jobs);
  m.contacts.apply_last_forces(m.bodies, jobs);
  for (int number = 0; number < steps.substeps; ++number) m.take_substep(problem, steps, number, jobs);
  SmallStepReport report{.rows = static_cast<int>(3 * m.contacts.size() + m.constraints.size()),
                         .residual = std::max(m.contacts.residual(m.bodies, jobs), m.constraints.residual())};
  report.solved = m.contacts.meet_law() && m.constraints.all_finite() && m.bodies.all_finite();
  m.contacts.end_step(m.bodies.plan());
  m.bodies.end_step();
  if (problem.contacts != nullptr) problem.contacts->press_indentations(states);
  return report;
}

void SmallStepSolver::Impl::take_substep(const SmallStepProblem& problem, const SmallSteps& steps, int number,
                                         Jobs& jobs) {
  const BodyStates states(problem.table);
  bodies.turn_axes();
  constraints.make_rows(states, bodies, problem.constraints, number);
  bodies.begin_substep(number, jobs);
  const bool overlap = contacts.begin_substep(bodies, jobs);
  constraints.solve(bodies);
  contacts.sweep(bodies, false, jobs);
  contacts.limit_forces(bodies, constraints.moved(), jobs);
  contacts.sweep(bodies, true, jobs);
  if (overlap) {
    std::ranges::fill(bodies.pushes(), internal::Block8{});
    const bool backward = number % 2 != 0;  // in turns, so that no pair is always the last
    contacts.push_apart(bodies, steps.push_speed, backward, jobs);
  }
  bodies.end_substep(overlap, jobs);
  constraints.close(states, bodies, overlap);
  contacts.end_substep(bodies, jobs);
  constraints.end_substep(states, bodies, number + 1 == steps.substeps);
}

void SmallStepSolver::clear() {
  impl_->contacts.rolling_memory().clear();
  impl_->contacts.rebound_memory().clear();
}

void SmallStepSolver::save_state(StateWriter& state) const {
  state(impl_->contacts.rolling_memory());
  state(impl_->contacts.rebound_memory());
}

void SmallStepSolver::restore_state(StateReader& state) {
  state(impl_->contacts.rolling_memory());
  state(impl_->contacts.rebound_memory());
}

}  // namespace limber
