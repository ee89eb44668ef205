#include "end_velocities.h"

#include <algorithm>

namespace limber::internal {

void EndVelocities::meet_rows(IslandStep& step, std::span<const char> active) {
  IslandBodies& bodies = step.bodies;
  bodies.place(StepTime::kEnd);
  const auto m = step.size(), n = static_cast<std::size_t>(bodies.degrees_of_freedom());
  J_.resize(m * n), metric_.resize(n), impulses_.assign(m, 0.0), compliance_.assign(m, 0.0);
  bodies.write_jacobian(step.end_rows, J_);
  bodies.write_velocity_metric(metric_);
  for (std::size_t i = 0; i < m; ++i) {
    if (choose(step, i, active[i] != 0))
      impulses_[i] = step.law(i).end_rate - rate(step, static_cast<Index>(i));
    else
      std::fill_n(J_.begin() + static_cast<std::ptrdiff_t>(i * n), n, 0.0);
  }
  equalities_.factor(J_, metric_, compliance_);
  equalities_.solve(impulses_);
  give(step, impulses_);
  for (std::size_t i = 0; i < m; ++i) {
    step.end_work += impulses_[i] * step.law(i).end_rate;
    if (!(step.law(i).compliance > 0.0)) step.end_impulse[i] = impulses_[i];
  }
}

/// Rows that hold, and springs that are stiff: with κ = Δt a/c, a what an impulse changes the rate by, c the
/// compliance, they yield by a (1 + κ)/κ².
bool EndVelocities::choose(const IslandStep& step, std::size_t row, bool active) {
  const RowLaw& law = step.law(row);
  if (!is_equality(law) && (!active || step.f[row] == 0.0)) return false;
  if (!(law.compliance > 0.0)) return true;
  const std::size_t n = metric_.size();
  double moved = 0.0;
  for (std::size_t k = 0; k < n; ++k) moved += metric_[k] * J_[row * n + k] * J_[row * n + k];
  const double stiff = step.length() * moved / law.compliance;
  if (!(stiff > 0.0)) return false;
  compliance_[row] = moved * (1.0 + stiff) / (stiff * stiff);
  return true;
}

/// J of the end times the velocities there.
double EndVelocities::rate(const IslandStep& step, Index row) {
  double sum = 0.0;
  for (const ConstraintRows::Side& side : step.end_rows.row(row).sides) {
    const Index local = step.bodies.local(side.body);
    if (local < 0) continue;
    const auto& [group, slot, pose] = step.bodies.body(local);
    const RigidFrame& frame = group->predicted_frame(slot);
    sum += side.linear.dot(frame.velocity()) + side.angular.dot(frame.angular_velocity(group->frame_constants()));
    const std::span<const double> shapes = step.end_rows.modal(side), rates = group->predicted_rates(slot),
                                  moves = step.bodies.modal_step(local).velocity_response();
    for (std::size_t k = 0; k < shapes.size(); ++k) sum += moves[k] * shapes[k] * rates[k];
  }
  return sum;
}

void EndVelocities::give(IslandStep& step, std::span<const double> impulses) {
  step.loads.clear(step.bodies);
  step.loads.add(step.bodies, step.end_rows, impulses, 1.0, 1.0);
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const ConstrainedBody& at = step.bodies.body(local);
    const ConstraintLoad& load = step.loads.frames[static_cast<std::size_t>(local)];
    double* modal = step.loads.modal(local);
    const std::span<const double> moves = step.bodies.modal_step(local).velocity_response(),
                                  rates = at.group->predicted_rates(at.slot);
    for (std::size_t k = 0; k < moves.size(); ++k) {
      modal[k] *= moves[k];
      step.end_modal_gain += modal[k] * (rates[k] + 0.5 * modal[k]);
    }
    at.group->adjust_prediction(at.slot, load.impulse, load.moment, load.modal);
  }
}

}  // namespace limber::internal
