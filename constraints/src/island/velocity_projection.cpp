#include "velocity_projection.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {

void VelocityProjection::meet_rows(IslandStep& step, std::span<const char> active) {
  IslandBodies& bodies = step.bodies;
  bodies.place(StepTime::kEnd);
  metric_.resize(static_cast<std::size_t>(bodies.degrees_of_freedom()));
  bodies.write_velocity_metric(metric_);
  rows_.clear(), off_.clear(), compliance_.clear();
  bool met = true;
  for (std::size_t i = 0; i < step.size(); ++i) {
    const RowParameters& law = step.law(i);
    if (law.contact) continue;  // they press from the step's start: velocities are what closes their gaps
    if (!is_equality(law) && (active[i] == 0 || step.f[i] == 0.0)) continue;
    const double yields = law.compliance > 0.0 ? compliance_of(step, i) : 0.0;
    if (yields == kUnbounded) continue;
    const double off = law.end_rate - rate(step, static_cast<Index>(i));
    rows_.push_back(i), off_.push_back(off), compliance_.push_back(yields);
    met = met && step.length() * std::abs(off) <= law.digits;
  }
  if (!met) solve(step);
}

void VelocityProjection::solve(IslandStep& step) {
  const std::size_t n = metric_.size();
  J_.assign(rows_.size() * n, 0.0);
  for (std::size_t i = 0; i < rows_.size(); ++i) write_row(step, rows_[i], std::span(J_).subspan(i * n, n));
  equalities_.factor(J_, metric_, compliance_);
  found_ = off_;
  equalities_.solve(found_);
  if (!are_within_bounds(step)) solve_within_bounds();
  impulses_.assign(step.size(), 0.0);
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const RowParameters& law = step.law(rows_[i]);
    impulses_[rows_[i]] = found_[i];
    step.end_work += found_[i] * law.end_rate;
    if (!(law.compliance > 0.0)) step.end_impulse[rows_[i]] = found_[i];
  }
  give(step, impulses_);
}

/// With the impulses in the middle of the step: a limited hand, spring or motor, or friction, exerts no more at its
/// end. Stops keep what came to them within the step, whatever that takes: chains with heavy ends would whip on from
/// them.
bool VelocityProjection::are_within_bounds(const IslandStep& step) {
  lower_.clear(), upper_.clear();
  bool within = true;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const RowParameters& law = step.law(rows_[i]);
    const bool stop = law.lower == 0.0;
    lower_.push_back(stop ? -kUnbounded : law.lower - step.f[rows_[i]]);
    upper_.push_back(law.upper - step.f[rows_[i]]);
    within = within && found_[i] >= lower_[i] && found_[i] <= upper_[i];
  }
  return within;
}

void VelocityProjection::solve_within_bounds() {
  const std::size_t n = metric_.size();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    found_[i] = std::clamp(found_[i], lower_[i], upper_[i]);
    off_[i] = -off_[i];
    for (std::size_t k = 0; k < n; ++k) J_[i * n + k] *= std::sqrt(metric_[k]);
  }
  bounded_.solve({.dimension = n, .G = J_, .D = compliance_, .b = off_, .lower = lower_, .upper = upper_}, found_);
}

/// Springs that are stiff yield: with κ = Δt a/c, a what an impulse changes the rate by, c the compliance, by
/// a (1 + κ)/κ². @return unbounded where nothing moves the row
double VelocityProjection::compliance_of(const IslandStep& step, std::size_t row) {
  const std::size_t n = metric_.size();
  row_.assign(n, 0.0);
  write_row(step, row, row_);
  double moved = 0.0;
  for (std::size_t k = 0; k < n; ++k) moved += metric_[k] * row_[k] * row_[k];
  const double stiff = step.length() * moved / step.law(row).compliance;
  return stiff > 0.0 ? moved * (1.0 + stiff) / (stiff * stiff) : kUnbounded;
}

/// J of the end. @param J zeros, one per degree of freedom
void VelocityProjection::write_row(const IslandStep& step, std::size_t row, std::span<double> J) {
  for (const ConstraintRows::Side& side : step.end_rows.row(static_cast<Index>(row)).sides)
    if (const Index local = step.bodies.local(side.body); local >= 0)
      step.bodies.response(local).add_row(side.linear, side.angular, step.end_rows.modal(side),
                                          J.data() + step.bodies.first(local));
}

/// J of the end times the velocities there.
double VelocityProjection::rate(const IslandStep& step, Index row) {
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

void VelocityProjection::give(IslandStep& step, std::span<const double> impulses) {
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
