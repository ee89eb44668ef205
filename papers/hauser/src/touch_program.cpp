#include "touch_program.h"

#include <algorithm>
#include <cmath>

#include "touch_times.h"

namespace limber::internal {
namespace {

/// Σ shape · number(body, mode) over the modes that a row sees.
template <class Number>
double modal_sum(const IslandStep& step, Index row, Number&& number) {
  double sum = 0.0;
  for (const ConstraintRows::Side& side : step.rows.row(row).sides) {
    const Index local = step.bodies.local(side.body);
    if (local < 0) continue;
    const std::span<const double> shapes = step.rows.modal(side);
    for (std::size_t i = 0; i < shapes.size(); ++i) sum += shapes[i] * number(step.bodies.body(local), i);
  }
  return sum;
}

}  // namespace

void TouchProgram::solve(IslandStep& step, HeldReaction& reaction, const ContactRule& rule, ProgramReport& report) {
  force_.assign(step.size(), 0.0);
  reaction.find_accelerations(step, StepTime::kStart);
  J_.resize(step.size() * static_cast<std::size_t>(step.bodies.degrees_of_freedom()));
  metric_.resize(static_cast<std::size_t>(step.bodies.degrees_of_freedom()));
  step.bodies.write_jacobian(step.rows, J_);
  step.bodies.write_velocity_metric(metric_);
  choose_touching(step, reaction, false);
  b_.clear();
  for (const Index row : touching_) b_.push_back(speed(step, reaction, row));
  solve_touching(step, rule, step.touch_impulse, report);
  apply(step);
  choose_touching(step, reaction, true);
  find_bias(step);
  b_.clear();
  for (const Index row : touching_) {
    // Friction is to take away in the step what still slides.
    const bool slides = step.rows.row(row).law.slides;
    b_.push_back(acceleration(step, reaction, row) + (slides ? speed(step, reaction, row) / step.length() : 0.0));
  }
  solve_touching(step, rule, force_, report);
  hold_forces(step.rows, step.length());
  step.theta = step.contacts_alone ? 0.5 : 1.0;
}

/// The contacts that are closed; `resting`: and no faster than held forces make of rest in a step.
void TouchProgram::choose_touching(const IslandStep& step, const HeldReaction& reaction, bool resting) {
  constexpr double kClosed = 1e4;  // in units of the rows' tolerance: 1e-6 of the distances at hand
  touching_.clear(), mu_.clear();
  for (const bool with_friction : {true, false})
    for (Index i = 0; i < step.rows.size(); ++i) {
      const RowParameters& law = step.rows.row(i).law;
      if (!law.contact || law.slides || (law.friction > 0.0) != with_friction) continue;
      if (step.gap[static_cast<std::size_t>(i)] > kClosed * law.tolerance) continue;
      const double allowed = reaction.motion_of(step, StepTime::kStart, i).speed_of_a_step;
      if (resting && std::abs(speed(step, reaction, i)) > allowed) continue;
      for (Index t = 0; t < (with_friction ? 3 : 1); ++t) touching_.push_back(i + t);
      if (with_friction) mu_.push_back(law.friction);
    }
  lower_.assign(touching_.size(), 0.0), upper_.assign(touching_.size(), kUnbounded);
  assemble(step);
}

/// A = J M⁻¹Jᵀ of frames and modes, for the rows that touch.
void TouchProgram::assemble(const IslandStep& step) {
  const std::size_t m = touching_.size(), n = static_cast<std::size_t>(step.bodies.degrees_of_freedom());
  A_.resize(m * m);
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j <= i; ++j) {
      const double* x = J_.data() + static_cast<std::size_t>(touching_[i]) * n;
      const double* y = J_.data() + static_cast<std::size_t>(touching_[j]) * n;
      double sum = 0.0;
      for (std::size_t k = 0; k < n; ++k) sum += metric_[k] * x[k] * y[k];
      A_[i * m + j] = A_[j * m + i] = sum;
    }
}

double TouchProgram::speed(const IslandStep& step, const HeldReaction& reaction, Index row) const {
  return reaction.motion_of(step, StepTime::kStart, row).speed +
         modal_sum(step, row,
                   [](const ConstrainedBody& body, std::size_t i) { return body.group->rates(body.slot)[i]; });
}

/// What rows accelerate by without forces: J̇v, and what the turning of the bodies themselves makes of their frames,
/// α = I⁻¹(−ω × I ω).
void TouchProgram::find_bias(const IslandStep& step) {
  bias_.assign(step.size(), 0.0);
  const BodyStates states(step.part.table);
  for (std::size_t i = 0; i < step.part.constraints.size(); ++i) {
    const auto* contacts = dynamic_cast<const PairContacts*>(step.part.constraints[i]);
    if (contacts == nullptr) continue;
    const auto begin = static_cast<std::size_t>(step.first_row[i]),
               end = static_cast<std::size_t>(step.first_row[i + 1]);
    bias_accelerations(*contacts, states, std::span(bias_).subspan(begin, end - begin));
  }
  for (std::size_t row = 0; row < bias_.size(); ++row)
    step.for_bodies(row, [&](const ConstraintRows::Side& side, Index local, bool) {
      const auto& [group, slot, pose] = step.bodies.body(local);
      const FrameConstants& c = group->frame_constants();
      const BodyResponse& r = step.bodies.response(local);
      const Vec3 torque = group->frame(slot).angular_momentum(c).cross(group->frame(slot).angular_velocity(c));
      for (int i = 0; i < r.rotations; ++i)
        bias_[row] += r.axes.col(i).dot(side.angular) * r.inverse_moments[i] * r.axes.col(i).dot(torque);
    });
}

/// J a + J̇v of bodies that nothing touches. Modes that answer statically hold still.
double TouchProgram::acceleration(const IslandStep& step, const HeldReaction& reaction, Index row) const {
  return reaction.motion_of(step, StepTime::kStart, row).acceleration + bias_[static_cast<std::size_t>(row)] +
         modal_sum(step, row, [](const ConstrainedBody& body, std::size_t i) {
           const BodyGroup& group = *body.group;
           const ModalModelData& data = group.model().data();
           if (group.velocity_response()[i] == 0.0) return 0.0;
           return group.held_modal_forces(body.slot)[i] - 2.0 * data.decays[i] * group.rates(body.slot)[i] -
                  data.eigenvalues[i] * group.amplitudes(body.slot)[i];
         });
}

void TouchProgram::solve_touching(const IslandStep& step, const ContactRule& rule, std::vector<double>& into,
                                  ProgramReport& report) {
  f_.assign(touching_.size(), 0.0);
  ProgramReport found;
  programs_.solve({.cones = static_cast<int>(mu_.size()),
                   .A = A_,
                   .b = b_,
                   .friction = mu_,
                   .lower = lower_,
                   .upper = upper_,
                   .gap_before = {},
                   .step = step.length()},
                  rule.program(), f_, found);
  report.add(found);
  for (std::size_t i = 0; i < touching_.size(); ++i) into[static_cast<std::size_t>(touching_[i])] = f_[i];
}

/// Velocities change at once. Modes that answer statically have none to change.
void TouchProgram::apply(IslandStep& step) {
  if (std::ranges::none_of(step.touch_impulse, [](double p) { return p != 0.0; })) return;
  step.loads.clear(step.bodies);
  step.loads.add(step.bodies, step.rows, step.touch_impulse, 1.0, 1.0);
  for (Index local = 0; local < step.bodies.count(); ++local) {
    const auto& [group, slot, pose] = step.bodies.body(local);
    const ConstraintLoad& load = step.loads.frames[static_cast<std::size_t>(local)];
    double* modal = step.loads.modal(local);
    for (std::size_t i = 0; i < load.modal.size(); ++i) modal[i] *= group->velocity_response()[i];
    group->apply_generalized_impulse(slot, load.impulse, load.moment, load.modal);
  }
}

void TouchProgram::hold_forces(ConstraintRows& rows, double length) const {
  for (Index i = 0; i < rows.size(); ++i) {
    RowParameters& law = rows.row(i).law;
    if (!law.contact) continue;
    const double impulse = length * force_[static_cast<std::size_t>(i)];
    law = {.offset = law.offset, .lower = impulse, .upper = impulse, .tolerance = law.tolerance, .contact = true};
  }
}

}  // namespace limber::internal
