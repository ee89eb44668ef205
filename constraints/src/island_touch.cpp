#include <algorithm>
#include <cmath>

#include "island_step.h"

namespace limber {
/// [H03]'s second method: the impulses of least sum that stop what touches, then the forces of least sum that hold what
/// rests, by velocities and accelerations as they are at the step's start.
void IslandSolver::Impl::solve_touch(const IslandOptions& options, ProgramReport& report) {
  touch_impulse.assign(f.size(), 0.0), contact_force.assign(f.size(), 0.0);
  find_accelerations(StepTime::kStart, options.gravity);
  bodies.write_velocity_metric(metric);
  choose_touching(options, false);
  b_touch.clear();
  for (const Index row : touching) b_touch.push_back(row_speed(row, options));
  ProgramReport found;
  solve_touching(touch_impulse, found);
  report.add(found);
  apply_touch_impulse();
  choose_touching(options, true);
  b_touch.clear();
  for (const Index row : touching) {
    const RowLaw& law = laws[static_cast<std::size_t>(row)];
    // Friction is to take away in the step what still slides.
    b_touch.push_back(row_acceleration(row, options) + (law.slides ? row_speed(row, options) / options.step : 0.0));
  }
  solve_touching(contact_force, found);
  report.add(found);
  hold_contact_forces(options.step);
  for (Index i = 0; i < rows.size(); ++i) laws[static_cast<std::size_t>(i)] = rows.row(i).law;
  theta = std::ranges::all_of(laws, &RowLaw::contact) ? 0.5 : 1.0;
}

/// The contacts that are closed; `resting`: and no faster than held forces make of rest in a step.
void IslandSolver::Impl::choose_touching(const IslandOptions& options, bool resting) {
  constexpr double kClosed = 1e4;  // in units of the rows' tolerance: 1e-6 of the distances at hand
  touching.clear(), mu.clear();
  for (const bool with_friction : {true, false})
    for (Index i = 0; i < rows.size(); ++i) {
      const RowLaw& law = laws[static_cast<std::size_t>(i)];
      if (!law.contact || law.slides || (law.friction > 0.0) != with_friction) continue;
      if (gap[static_cast<std::size_t>(i)] > kClosed * law.tolerance) continue;
      if (resting && std::abs(row_speed(i, options)) > held_motion(StepTime::kStart, i, options).speed_of_a_step)
        continue;
      for (Index t = 0; t < (with_friction ? 3 : 1); ++t) touching.push_back(i + t);
      if (with_friction) mu.push_back(law.friction);
    }
  lower.assign(touching.size(), 0.0), upper.assign(touching.size(), kUnbounded);
  lower.resize(std::max(lower.size(), f.size())), upper.resize(std::max(upper.size(), f.size()));
  assemble_touching();
}

/// A = J M⁻¹Jᵀ of frames and modes, for the rows that touch.
void IslandSolver::Impl::assemble_touching() {
  const std::size_t m = touching.size(), n = metric.size();
  A_touch.resize(m * m);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      const double* x = J.data() + static_cast<std::size_t>(touching[i]) * n;
      const double* y = J.data() + static_cast<std::size_t>(touching[j]) * n;
      double sum = 0.0;
      for (std::size_t k = 0; k < n; ++k) sum += metric[k] * x[k] * y[k];
      A_touch[i * m + j] = A_touch[j * m + i] = sum;
    }
}

template <class Side>
double IslandSolver::Impl::modal_sum(Index row, Side&& number) const {
  double sum = 0.0;
  for (const ConstraintRows::Side& side : rows.row(row).sides) {
    const Index local = bodies.local(side.body);
    if (local < 0) continue;
    const std::span<const double> modal = rows.modal(side);
    for (std::size_t i = 0; i < modal.size(); ++i) sum += modal[i] * number(bodies.body(local), i);
  }
  return sum;
}

double IslandSolver::Impl::row_speed(Index row, const IslandOptions& options) const {
  return held_motion(StepTime::kStart, row, options).speed +
         modal_sum(row, [](const ConstrainedBody& body, std::size_t i) { return body.group->rates(body.slot)[i]; });
}

/// J a of bodies that nothing touches; the turning of J is left out. Modes that answer statically hold still.
double IslandSolver::Impl::row_acceleration(Index row, const IslandOptions& options) const {
  return held_motion(StepTime::kStart, row, options).acceleration +
         modal_sum(row, [](const ConstrainedBody& body, std::size_t i) {
           const BodyGroup& group = *body.group;
           const ModalModelData& data = group.model().data();
           if (group.velocity_response()[i] == 0.0) return 0.0;
           return group.held_modal_forces(body.slot)[i] - 2.0 * data.decays[i] * group.rates(body.slot)[i] -
                  data.eigenvalues[i] * group.amplitudes(body.slot)[i];
         });
}

SolveStatus IslandSolver::Impl::solve_touching(std::span<double> into, ProgramReport& report) {
  f_touch.assign(touching.size(), 0.0);
  report = {};
  const ContactProblem problem{.cones = static_cast<int>(mu.size()),
                               .A = A_touch,
                               .b = b_touch,
                               .friction = mu,
                               .lower = std::span(lower).first(touching.size()),
                               .upper = std::span(upper).first(touching.size()),
                               .gap_before = {},
                               .step = step};
  const SolveStatus status = programs.solve(problem, rule.program(), f_touch, report);
  for (std::size_t i = 0; i < touching.size(); ++i) into[static_cast<std::size_t>(touching[i])] = f_touch[i];
  return status;
}

/// Velocities change at once. Modes that answer statically have none to change.
void IslandSolver::Impl::apply_touch_impulse() {
  sum_loads(touch_impulse, 1.0, 1.0);
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
    double* modal = modal_loads.data() + (load.modal.data() - modal_loads.data());
    for (std::size_t i = 0; i < load.modal.size(); ++i) modal[i] *= group->velocity_response()[i];
    if (std::ranges::any_of(touch_impulse, [](double p) { return p != 0.0; }))
      group->apply_generalized_impulse(slot, load.impulse, load.moment, load.modal);
  }
}

/// Rows of contacts get what the velocity program found, and nothing else.
void IslandSolver::Impl::hold_contact_forces(double length) {
  for (Index i = 0; i < rows.size(); ++i) {
    RowLaw& law = rows.row(i).law;
    if (!law.contact) continue;
    const double impulse = length * contact_force[static_cast<std::size_t>(i)];
    law = {.offset = law.offset, .lower = impulse, .upper = impulse, .tolerance = law.tolerance, .contact = true};
  }
}

}  // namespace limber
