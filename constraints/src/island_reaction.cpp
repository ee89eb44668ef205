#include <algorithm>
#include <cmath>

#include "island_step.h"

namespace limber {
namespace {

FrameAcceleration held_acceleration(const BodyGroup& group, Index slot, StepTime when, const BodyResponse& r,
                                    const Vec3& gravity) {
  const FrameConstants& c = group.frame_constants();
  Vec3 torque = group.held_torque(slot);
  FrameAcceleration a;
  if (c.motion == FrameMotion::kFree)
    a.linear = gravity + group.held_force(slot) / c.mass;
  else
    torque += (frame_at(group, slot, when).pose().q * group.first_moment(slot)).cross(gravity);
  for (int i = 0; i < r.rotations; ++i) a.angular += r.axes.col(i) * (r.inverse_moments[i] * r.axes.col(i).dot(torque));
  return a;
}

/// Whether bodies lie still on a row of one sign: closed, and slower than what held forces make of rest in a step.
bool rests(const RowLaw& law, double gap, double speed, double speed_of_a_step) {
  const double open = gap - law.offset;
  const bool closed =
      (law.lower < 0.0 || open <= 2.0 * law.tolerance) && (law.upper > 0.0 || open >= -2.0 * law.tolerance);
  return closed && std::abs(speed) <= speed_of_a_step;
}

}  // namespace

/// Of all bodies, to `accelerations`.
void IslandSolver::Impl::find_accelerations(StepTime when, const Vec3& gravity) {
  accelerations.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    accelerations.push_back(
        held_acceleration(*bodies.body(local).group, bodies.body(local).slot, when, bodies.response(local), gravity));
}

/// The row's part of what the bodies do under held forces alone.
IslandSolver::Impl::HeldMotion IslandSolver::Impl::held_motion(StepTime when, Index row,
                                                               const IslandOptions& options) const {
  HeldMotion motion;
  double inverse_mass = 0.0, acceleration_squared = 0.0;
  for (const ConstraintRows::Side& side : rows.row(row).sides) {
    const Index local = bodies.local(side.body);
    if (local < 0) continue;
    const auto& [group, slot, pose] = bodies.body(local);
    const FrameConstants& c = group->frame_constants();
    const BodyResponse& r = bodies.response(local);
    const RigidFrame& frame = frame_at(*group, slot, when);
    const FrameAcceleration& a = accelerations[static_cast<std::size_t>(local)];
    motion.acceleration += side.linear.dot(a.linear) + side.angular.dot(a.angular);
    motion.speed += side.linear.dot(frame.velocity()) + side.angular.dot(frame.angular_velocity(c));
    if (r.translations > 0) {
      inverse_mass += r.inverse_mass * side.linear.squaredNorm();
      acceleration_squared += a.linear.squaredNorm() / r.inverse_mass;
    }
    for (int i = 0; i < r.rotations; ++i) {
      const double turn = r.axes.col(i).dot(side.angular), turned = r.axes.col(i).dot(a.angular);
      inverse_mass += r.inverse_moments[i] * turn * turn;
      acceleration_squared += turned * turned / r.inverse_moments[i];
    }
  }
  // |J a| ≤ |J|_{M⁻¹} |a|_M, whatever other rows make of a.
  motion.speed_of_a_step = options.step * std::sqrt(inverse_mass * acceleration_squared);
  return motion;
}

/// What the rows that hold answer to held forces, beside those whose force goes on; the others have no row of G.
void IslandSolver::Impl::find_reaction(StepTime when, const IslandOptions& options, std::vector<double>& answer) {
  if (!answers_to_loads()) return;
  find_accelerations(when, options.gravity);
  bodies.write_frame_metric(metric);
  const std::size_t n = weigh_frames();
  bool equalities = true, any = false;
  const auto take = [&](std::size_t at) {
    if (lower[at] == 0.0 && upper[at] == 0.0)
      std::fill_n(frame_G.begin() + static_cast<std::ptrdiff_t>(at * n), n, 0.0);
    any = any || b[at] != 0.0 || lower[at] > 0.0 || upper[at] < 0.0;
  };
  bool rested = false;  // the normal row of the contact at hand
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
    if (convex && law.contact) {
      lower[at] = upper[at] = b[at] = 0.0;
      take(at);
      continue;
    }
    const HeldMotion held = held_motion(when, i, options);
    const bool lies = rests(law, gap[at], held.speed, held.speed_of_a_step);
    if (law.friction > 0.0) rested = lies;
    b[at] = held.acceleration;
    lower[at] = law.lower / options.step, upper[at] = law.upper / options.step;
    if (law.goes_on && (!law.slides || rested)) {
      const double force = when == StepTime::kStart ? law.last_force : f[at] / options.step + reaction[at];
      lower[at] = upper[at] = std::clamp(force, lower[at], upper[at]);
      equalities = equalities && lower[at] == 0.0;
      if (lower[at] == 0.0) b[at] = 0.0;
    } else if (!(law.holds && (is_equality(law) || lies))) {
      lower[at] = upper[at] = b[at] = 0.0;
    } else {
      equalities = equalities && is_equality(law);
    }
    take(at);
  }
  if (any)
    answer_rows(equalities, answer);
  else
    std::fill(answer.begin(), answer.end(), 0.0);
}

/// The answer to accelerations b within the bounds.
void IslandSolver::Impl::answer_rows(bool equalities, std::vector<double>& answer) {
  std::fill(answer.begin(), answer.end(), 0.0);
  const std::size_t n = frame_G.size() / f.size();
  if (equalities) {
    unit_metric.assign(n, 1.0);
    least_squares.factor(frame_G, unit_metric, static_cast<int>(f.size()));
    for (double& acceleration : b) acceleration = -acceleration;
    least_squares.solve(b, answer);
    return;
  }
  qp.solve(FactoredContactQp{.size = static_cast<int>(f.size()),
                             .dimension = static_cast<int>(n),
                             .G = frame_G,
                             .D = {},
                             .b = b,
                             .lower = lower,
                             .upper = upper},
           answer);
}

/// J M^−½ of the frames alone: the modes answer to held forces by themselves. @return its columns
std::size_t IslandSolver::Impl::weigh_frames() {
  std::size_t n = 0;
  for (Index local = 0; local < bodies.count(); ++local)
    n += static_cast<std::size_t>(bodies.response(local).translations + bodies.response(local).rotations);
  frame_G.resize(f.size() * n);
  std::size_t column = 0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const BodyResponse& r = bodies.response(local);
    for (int i = 0; i < r.translations + r.rotations; ++i, ++column) {
      const std::size_t from = static_cast<std::size_t>(bodies.first(local)) + static_cast<std::size_t>(i);
      const double weight = std::sqrt(metric[from]);
      for (std::size_t row = 0; row < f.size(); ++row)
        frame_G[row * n + column] = weight * J[row * metric.size() + from];
    }
  }
  return n;
}

}  // namespace limber
