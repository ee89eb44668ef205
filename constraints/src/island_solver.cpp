#include "limber/constraints/island_solver.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "bounded_rows.h"
#include "contact_program.h"
#include "difference_newton.h"
#include "island_energy.h"
#include "limber/constraints/contact_qp.h"
#include "limber/constraints/least_squares.h"
#include "secant_iteration.h"

namespace limber {
namespace {

Eigen::Map<const Eigen::VectorXd> as_vector(std::span<const double> v) {
  return {v.data(), static_cast<Eigen::Index>(v.size())};
}

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// The generalised acceleration of a frame under what is held over the step, without constraints: linear in the loads,
/// so that the rows' answer balances them exactly where nothing moves.
struct FrameAcceleration {
  Vec3 linear = Vec3::Zero(), angular = Vec3::Zero();
};

const RigidFrame& frame_at(const BodyGroup& group, Index slot, StepTime when) {
  return when == StepTime::kStart ? group.frame(slot) : group.predicted_frame(slot);
}

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

bool is_equality(const RowLaw& law) { return !law.slides && law.lower == -kUnbounded && law.upper == kUnbounded; }

/// θ: forces are truly held while a contact strikes. Joints and hands keep θ = 1, for their velocities' sake.
double start_share(std::span<const RowLaw> laws) {
  const bool contacts_alone = std::ranges::all_of(laws, &RowLaw::contact);
  return contacts_alone && std::ranges::any_of(laws, &RowLaw::strikes) ? 0.5 : 1.0;
}

bool in_cone(const RowLaw& law) { return law.slides || law.friction > 0.0; }

/// Whether bodies lie still on a row of one sign: closed, and slower than what held forces make of rest in a step.
bool rests(const RowLaw& law, double gap, double speed, double speed_of_a_step) {
  const double open = gap - law.offset;
  const bool closed =
      (law.lower < 0.0 || open <= 2.0 * law.tolerance) && (law.upper > 0.0 || open >= -2.0 * law.tolerance);
  return closed && std::abs(speed) <= speed_of_a_step;
}

// A step is cut so often at most, and never into parts shorter than this share of it.
constexpr int kMostCuts = 4;
constexpr double kShortestPart = 1e-3;

/// Whether a step may be cut: free bodies that nothing but contacts, gravity and held forces acts on.
bool allows_cuts(std::span<const ConstrainedBody> table, std::span<const Index> members,
                 std::span<Constraint* const> constraints) {
  return std::ranges::all_of(constraints, [](const Constraint* c) { return c->is_contact(); }) &&
         std::ranges::all_of(members, [&](Index member) {
           const auto& [group, slot, pose] = table[static_cast<std::size_t>(member)];
           return group->frame_constants().motion == FrameMotion::kFree && !group->has_delayed_impulse(slot);
         });
}

}  // namespace

struct IslandSolver::Impl {
  IslandBodies bodies;
  ConstraintRows rows;
  std::vector<ExactMotion> motions;    // of the members, where a step may be cut
  std::vector<ModalStep> modal_steps;  // of the bodies, where they are not those of their groups
  std::vector<Index> first_row;        // per constraint, and the end
  std::vector<RowLaw> laws;            // of the rows at the step's start
  std::vector<double> J, metric, G, weighted, gap, start_gap, b, lower, upper, compliance;
  std::vector<double> f, next_f, reaction, end_reaction, change;
  std::vector<FrameAcceleration> accelerations;  // per body, under held forces
  std::vector<double> frame_G, unit_metric;
  std::vector<ConstraintLoad> loads;
  std::vector<double> modal_loads;
  // Rows with bounds, and all rows with those last; the problem in that order, and reduced to those.
  // Among those the contacts with friction come first, three rows each.
  std::vector<Index> bounded, order, place;
  std::size_t cones = 0;
  std::vector<double> ordered_G, A, ordered_b, A_reduced, b_reduced, f_bounded, lower_bounded, upper_bounded, f_equal;
  std::vector<double> held_impulse, friction;
  std::vector<ConstraintRows::Flexibility> flexibility;  // of the rows at the step's start
  double stored_energy = 0.0;
  std::vector<double> wide_J, wide_metric;  // J and the metric with a degree of freedom for each compliance
  LeastSquaresSolver least_squares;
  EqualityElimination elimination;
  ContactQpSolver qp;
  BoundedRowSolver bounded_rows;
  ContactProgramSolver programs;
  ContactRule rule;
  ProgramReport program_report;
  std::vector<double> gap_before;     // of the bounded rows
  std::vector<double> touch_impulse;  // by row, what the velocity program gave at the touch
  std::vector<double> contact_force;  // by row, N, what it holds over the step
  std::vector<Index> touching;        // rows of its contacts, three each with friction
  std::vector<double> mu, A_touch, b_touch, f_touch;
  SecantIteration secant;
  DifferenceNewton newton;
  std::vector<double> slope, tolerance;
  IslandEnergy energy;

  void gather(std::span<const ConstrainedBody> table, std::span<const Index> members,
              std::span<Constraint* const> constraints, const IslandOptions& options);
  void measure(const BodyStates& states, StepTime when, std::span<Constraint* const> constraints,
               std::vector<double>& into) const;
  void weigh();
  std::size_t weigh_frames();
  double step = 0.0;
  double theta = 1.0;  // the part of f that frames get at the step's start; the rest at its end
  struct HeldMotion {
    double acceleration = 0.0, speed = 0.0, speed_of_a_step = 0.0;
  };
  HeldMotion held_motion(StepTime when, Index row, const IslandOptions& options) const;
  void find_reaction(StepTime when, const IslandOptions& options, std::vector<double>& answer);
  void answer_at_end(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options);
  void set_modal_steps(double length, double whole_step);
  struct Part {
    std::span<const ConstrainedBody> table;
    std::span<const Index> members;
    std::span<Constraint* const> constraints;
    bool begins, ends;  // the whole step
  };
  void take_part(const Part& part, const IslandOptions& options, double whole_step, IslandReport& report);
  double next_cut(std::span<const ConstrainedBody> table, std::span<const Index> members,
                  std::span<Constraint* const> constraints, const Vec3& gravity, double left);
  SolveStatus iterate(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options,
                      IslandReport& report);
  void factor();
  void respond(std::span<const double> values, std::vector<double>& gaps);
  SolveStatus improve(bool first);
  SolveStatus improve_equalities();
  SolveStatus improve_all(bool first);
  SolveStatus solve_bounded(bool first);
  bool holds_contact_forces() const { return rule.method == ContactMethod::kVelocityProgram; }
  void solve_touch(const IslandOptions& options, ProgramReport& report);
  void choose_touching(const IslandOptions& options, bool resting);
  void assemble_touching();
  double row_speed(Index row, const IslandOptions& options) const;
  double row_acceleration(Index row, const IslandOptions& options) const;
  template <class Side>
  double modal_sum(Index row, Side&& number) const;
  SolveStatus solve_touching(std::span<double> into, ProgramReport& report);
  void apply_touch_impulse();
  void hold_contact_forces(double length);
  void keep_within_bounds();
  double largest_change() const;
  bool can_differentiate() const;
  SolveStatus differentiate(const BodyStates& states, std::span<Constraint* const> constraints,
                            const IslandOptions& options, IslandReport& report);
  SolveStatus take_best(const BodyStates& states, std::span<Constraint* const> constraints,
                        const IslandOptions& options, IslandReport& report);
  void predict(const IslandOptions& options);
  void sum_loads(std::span<const double> values, double frame_scale, double modal_scale);
  void add_loads(std::span<const double> values, double frame_scale, double modal_scale);
  double largest_recovery_work(double distance, const IslandOptions& options) const;
  double agent_work(const IslandOptions& options) const;
  bool is_workless() const;
  void guard_energy(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options,
                    IslandReport& report);
};

void IslandSolver::Impl::gather(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  bodies.set(table, members);
  rows.clear();
  first_row.clear();
  const BodyStates states(table);
  for (Constraint* constraint : constraints) {
    first_row.push_back(rows.size());
    constraint->add_rows(states, StepTime::kStart, options.step, rows);
  }
  first_row.push_back(rows.size());
  laws.clear();
  for (Index i = 0; i < rows.size(); ++i) laws.push_back(rows.row(i).law);
  theta = start_share(laws);
  flexibility = rows.flexibility();
  stored_energy = rows.stored_energy();
  const auto m = static_cast<std::size_t>(rows.size()), n = static_cast<std::size_t>(bodies.degrees_of_freedom());
  J.resize(m * n), metric.resize(n), G.resize(m * n), weighted.resize(n);
  for (std::vector<double>* v : {&gap, &start_gap, &b, &lower, &upper, &compliance, &next_f, &change}) v->resize(m);
  f.assign(m, 0.0), reaction.assign(m, 0.0), end_reaction.assign(m, 0.0);
  bodies.write_jacobian(rows, J);
  measure(states, StepTime::kStart, constraints, gap);
  start_gap = gap;
}

void IslandSolver::Impl::measure(const BodyStates& states, StepTime when, std::span<Constraint* const> constraints,
                                 std::vector<double>& into) const {
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(first_row[i]), end = static_cast<std::size_t>(first_row[i + 1]);
    constraints[i]->gaps(states, when, std::span(into).subspan(begin, end - begin));
  }
}

/// G = J D^½.
void IslandSolver::Impl::weigh() {
  const std::size_t n = metric.size();
  for (std::size_t i = 0; i < n; ++i) weighted[i] = std::sqrt(metric[i]);
  for (std::size_t row = 0; row < f.size(); ++row)
    for (std::size_t i = 0; i < n; ++i) G[row * n + i] = J[row * n + i] * weighted[i];
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
  accelerations.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    accelerations.push_back(held_acceleration(*bodies.body(local).group, bodies.body(local).slot, when,
                                              bodies.response(local), options.gravity));
  const std::size_t n = weigh_frames();
  bool equalities = true, any = false;
  bool rested = false;  // the normal row of the contact at hand
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
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
    if (lower[at] == 0.0 && upper[at] == 0.0)
      std::fill_n(frame_G.begin() + static_cast<std::ptrdiff_t>(at * n), n, 0.0);
    any = any || b[at] != 0.0 || lower[at] > 0.0 || upper[at] < 0.0;
  }
  std::fill(answer.begin(), answer.end(), 0.0);
  if (!any) return;
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
  bodies.write_frame_metric(metric);
  std::size_t n = 0;
  for (Index local = 0; local < bodies.count(); ++local)
    n += static_cast<std::size_t>(bodies.response(local).translations + bodies.response(local).rotations);
  frame_G.resize(f.size() * n);
  std::size_t column = 0;
  for (Index local = 0; local < bodies.count(); ++local) {
    const BodyResponse& r = bodies.response(local);
    for (int i = 0; i < r.translations + r.rotations; ++i, ++column) {
      const auto from = static_cast<std::size_t>(bodies.first(local) + i);
      const double weight = std::sqrt(metric[from]);
      for (std::size_t row = 0; row < f.size(); ++row)
        frame_G[row * n + column] = weight * J[row * metric.size() + from];
    }
  }
  return n;
}

/// The frames' second half of what holds them, and of what strikes them: at the step's end, by the rows there.
void IslandSolver::Impl::answer_at_end(const BodyStates& states, std::span<Constraint* const> constraints,
                                       const IslandOptions& options) {
  bodies.place(StepTime::kEnd);
  rows.clear();
  for (Constraint* constraint : constraints) constraint->add_rows(states, StepTime::kEnd, options.step, rows);
  if (holds_contact_forces()) hold_contact_forces(options.step);
  bodies.write_jacobian(rows, J);
  find_reaction(StepTime::kEnd, options, end_reaction);
  sum_loads(end_reaction, 0.5 * options.step, 0.0);
  if (theta < 1.0) add_loads(f, 1.0 - theta, 0.0);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    const ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
    body.group->adjust_prediction(body.slot, load.impulse, load.moment, {});
  }
}

/// The bodies under θ f and the first half of the reaction at the step's start; their modes under all of both, held.
void IslandSolver::Impl::predict(const IslandOptions& options) {
  sum_loads(f, theta, 1.0);
  add_loads(reaction, 0.5 * options.step, options.step);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    body.group->predict(body.slot, options.gravity, loads[static_cast<std::size_t>(local)], bodies.modal_step(local));
  }
}

void IslandSolver::Impl::sum_loads(std::span<const double> values, double frame_scale, double modal_scale) {
  loads.assign(static_cast<std::size_t>(bodies.count()), {});
  modal_loads.assign(metric.size(), 0.0);
  for (Index local = 0; local < bodies.count(); ++local)
    loads[static_cast<std::size_t>(local)].modal = {
        modal_loads.data() + bodies.first(local) + bodies.response(local).size() - bodies.response(local).modes,
        static_cast<std::size_t>(bodies.response(local).modes)};
  add_loads(values, frame_scale, modal_scale);
}

void IslandSolver::Impl::add_loads(std::span<const double> values, double frame_scale, double modal_scale) {
  for (Index i = 0; i < rows.size(); ++i) {
    const double value = values[static_cast<std::size_t>(i)];
    if (value == 0.0) continue;
    for (const ConstraintRows::Side& side : rows.row(i).sides) {
      const Index local = bodies.local(side.body);
      if (local < 0) continue;
      ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
      load.impulse += frame_scale * value * side.linear;
      load.moment += frame_scale * value * side.angular;
      const std::span<const double> modal = rows.modal(side);
      double* sum = modal_loads.data() + (load.modal.data() - modal_loads.data());
      for (std::size_t k = 0; k < modal.size(); ++k) sum[k] += modal_scale * value * modal[k];
    }
  }
}

/// One step of Newton's method from f, to next_f; `change` is what it makes of the gaps.
SolveStatus IslandSolver::Impl::improve(bool first) {
  const SolveStatus status = bounded.empty() ? improve_equalities() : improve_all(first);
  for (std::size_t i = 0; i < f.size(); ++i) b[i] = next_f[i] - f[i];
  respond(b, change);
  return status;
}

/// Rows without bounds: A Δf = −(gap − offset + compliance f), in the least-squares sense.
SolveStatus IslandSolver::Impl::improve_equalities() {
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
    next_f[at] = law.offset - gap[at] - law.compliance * (f[at] + step * reaction[at]);
  }
  const SolveStatus status = least_squares.solve(next_f, next_f);
  for (std::size_t i = 0; i < f.size(); ++i) next_f[i] += f[i];
  return status;
}

/// Rows with bounds beside the others, which are eliminated first: A f' + b, b = gap − offset − A₀ f.
SolveStatus IslandSolver::Impl::improve_all(bool first) {
  respond(f, change);
  for (const ConstraintRows::Flexibility& g : flexibility) {
    const auto i = static_cast<std::size_t>(g.i), j = static_cast<std::size_t>(g.j);
    change[i] -= g.value * reaction[j];
    if (i != j) change[j] -= g.value * reaction[i];
  }
  const std::size_t m = f.size(), e = m - bounded.size();
  for (std::size_t i = 0; i < m; ++i) {
    const auto at = static_cast<std::size_t>(order[i]);
    const RowLaw& law = laws[at];
    ordered_b[i] = gap[at] - law.offset - change[at] + law.compliance * step * reaction[at];
  }
  elimination.reduce(A, ordered_b, static_cast<int>(e), A_reduced, b_reduced);
  gap_before.clear();
  for (const Index row : bounded)
    gap_before.push_back(start_gap[static_cast<std::size_t>(row)] - laws[static_cast<std::size_t>(row)].offset);
  const SolveStatus status = solve_bounded(first);
  f_equal.resize(e);
  elimination.recover(f_bounded, f_equal);
  for (std::size_t i = 0; i < m; ++i)
    next_f[static_cast<std::size_t>(order[i])] = i < e ? f_equal[i] : f_bounded[i - e];
  return status;
}

/// Bounds and cones are of whole impulses, F = f + Δt reaction: A F + (b − A Δt reaction).
SolveStatus IslandSolver::Impl::solve_bounded(bool first) {
  const std::size_t n = bounded.size();
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(bounded[i]);
    held_impulse[i] = step * reaction[at];
    f_bounded[i] = first && i < 3 * cones ? step * laws[at].last_force : f[at] + held_impulse[i];
    lower_bounded[i] = laws[at].lower, upper_bounded[i] = laws[at].upper;
  }
  constexpr double kPart = 0.5;  // of what a gap may be off
  double noise = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < n; ++i)
    if (const double own = A_reduced[i * n + i]; own > 0.0)
      noise = std::min(noise, kPart * laws[static_cast<std::size_t>(bounded[i])].tolerance / std::sqrt(own));
  const auto size = static_cast<Eigen::Index>(n);
  Eigen::Map<Eigen::VectorXd>(b_reduced.data(), size).noalias() -=
      Eigen::Map<const RowMajor>(A_reduced.data(), size, size) * as_vector(held_impulse);
  if (rule.method == ContactMethod::kGapProgram || (cones > 0 && rule.friction != FrictionModel::kCone)) {
    const SolveStatus solved = programs.solve({.cones = static_cast<int>(cones),
                                               .A = A_reduced,
                                               .b = b_reduced,
                                               .friction = friction,
                                               .lower = lower_bounded,
                                               .upper = upper_bounded,
                                               .gap_before = gap_before,
                                               .step = step},
                                              rule, f_bounded, program_report);
    for (std::size_t i = 0; i < n; ++i) f_bounded[i] -= held_impulse[i];
    return solved;
  }
  const SolveStatus status = bounded_rows.solve({.cones = static_cast<int>(cones),
                                                 .A = A_reduced,
                                                 .b = b_reduced,
                                                 .friction = friction,
                                                 .lower = lower_bounded,
                                                 .upper = upper_bounded,
                                                 .noise = noise},
                                                f_bounded);
  for (std::size_t i = 0; i < n; ++i) f_bounded[i] -= held_impulse[i];
  return status;
}

/// [H03]'s second method: the impulses of least sum that stop what touches, then the forces of least sum that hold what
/// rests, by velocities and accelerations as they are at the step's start.
void IslandSolver::Impl::solve_touch(const IslandOptions& options, ProgramReport& report) {
  touch_impulse.assign(f.size(), 0.0), contact_force.assign(f.size(), 0.0);
  accelerations.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    accelerations.push_back(held_acceleration(*bodies.body(local).group, bodies.body(local).slot, StepTime::kStart,
                                              bodies.response(local), options.gravity));
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
  const SolveStatus status = programs.solve({.cones = static_cast<int>(mu.size()),
                                             .A = A_touch,
                                             .b = b_touch,
                                             .friction = mu,
                                             .lower = std::span(lower).first(touching.size()),
                                             .upper = std::span(upper).first(touching.size()),
                                             .gap_before = {},
                                             .step = step},
                                            rule, f_touch, report);
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

/// What impulses make of the gaps, compliance left out: J D Jᵀ values.
void IslandSolver::Impl::respond(std::span<const double> values, std::vector<double>& gaps) {
  const auto m = static_cast<Eigen::Index>(values.size()), n = static_cast<Eigen::Index>(metric.size());
  const Eigen::Map<const RowMajor> Jacobian(J.data(), m, n);
  Eigen::Map<Eigen::VectorXd> x(weighted.data(), n);
  x.noalias() = Jacobian.transpose() * as_vector(values);
  x.array() *= as_vector(metric).array();
  Eigen::Map<Eigen::VectorXd>(gaps.data(), m).noalias() = Jacobian * x;
}

/// Makes ready what all iterations of a step share: the factor of the rows, or A with the equality rows first.
void IslandSolver::Impl::factor() {
  const std::size_t m = f.size(), n = metric.size();
  if (bounded.empty()) {
    std::size_t soft = 0;
    for (const double c : compliance) soft += c > 0.0 ? 1 : 0;
    if (soft == 0) {
      least_squares.factor(J, metric, static_cast<int>(m));
      return;
    }
    // A row's compliance is a degree of freedom of its own.
    const std::size_t width = n + soft;
    wide_J.assign(m * width, 0.0), wide_metric = metric;
    for (std::size_t i = 0; i < m; ++i) {
      std::copy_n(J.begin() + static_cast<std::ptrdiff_t>(i * n), n,
                  wide_J.begin() + static_cast<std::ptrdiff_t>(i * width));
      if (compliance[i] == 0.0) continue;
      wide_J[i * width + wide_metric.size()] = 1.0;
      wide_metric.push_back(compliance[i]);
    }
    least_squares.factor(wide_J, wide_metric, static_cast<int>(m));
    return;
  }
  order.clear();
  for (Index i = 0; i < rows.size(); ++i)
    if (is_equality(rows.row(i).law)) order.push_back(i);
  order.insert(order.end(), bounded.begin(), bounded.end());
  place.resize(m);
  for (std::size_t i = 0; i < m; ++i) place[static_cast<std::size_t>(order[i])] = static_cast<Index>(i);
  weigh();
  ordered_G.resize(m * n);
  for (std::size_t i = 0; i < m; ++i)
    std::copy_n(G.begin() + static_cast<std::ptrdiff_t>(static_cast<std::size_t>(order[i]) * n), n,
                ordered_G.begin() + static_cast<std::ptrdiff_t>(i * n));
  A.resize(m * m);
  const Eigen::Map<const RowMajor> B(ordered_G.data(), static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(n));
  Eigen::Map<RowMajor>(A.data(), static_cast<Eigen::Index>(m), static_cast<Eigen::Index>(m)).noalias() =
      B * B.transpose();
  for (std::size_t i = 0; i < m; ++i) A[i * m + i] += compliance[static_cast<std::size_t>(order[i])];
  for (const ConstraintRows::Flexibility& g : flexibility) {
    const auto i = static_cast<std::size_t>(place[static_cast<std::size_t>(g.i)]),
               j = static_cast<std::size_t>(place[static_cast<std::size_t>(g.j)]);
    A[i * m + j] += g.value / step;
    if (i != j) A[j * m + i] += g.value / step;
  }
  const std::size_t c = bounded.size();
  A_reduced.resize(c * c), b_reduced.resize(c), ordered_b.resize(m);
  for (std::vector<double>* v : {&f_bounded, &lower_bounded, &upper_bounded, &held_impulse}) v->resize(c);
  friction.resize(cones);
  for (std::size_t i = 0; i < cones; ++i) friction[i] = laws[static_cast<std::size_t>(bounded[3 * i])].friction;
}

double IslandSolver::Impl::largest_change() const {
  double largest = 0.0;
  for (Index i = 0; i < rows.size(); ++i)
    largest = std::max(largest, std::abs(change[static_cast<std::size_t>(i)]) / rows.row(i).law.tolerance);
  return largest;
}

SolveStatus IslandSolver::Impl::iterate(const BodyStates& states, std::span<Constraint* const> constraints,
                                        const IslandOptions& options, IslandReport& report) {
  step = options.step;
  bodies.write_position_metric(step, theta, metric);
  bounded.clear();
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
    const double held = options.step * reaction[at];  // bounds are on the whole impulse
    lower[at] = law.lower - held, upper[at] = law.upper - held;
    compliance[at] = law.compliance;
    if (in_cone(law)) bounded.push_back(i);
  }
  cones = bounded.size() / 3;
  for (Index i = 0; i < rows.size(); ++i)
    if (!is_equality(rows.row(i).law) && !in_cone(rows.row(i).law)) bounded.push_back(i);
  constexpr int kIterationsUnsettled = 6, kIterationsOfStart = 30;
  factor();
  secant.begin(f.size());
  for (report.iterations = 1;; ++report.iterations) {
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
    const SolveStatus status = improve(report.iterations == 1);
    report.change = largest_change();
    if (report.change <= 1.0) return status;
    // Cones that do not come together give other impulses every time.
    const int most = status == SolveStatus::kIterationLimit ? std::min(kIterationsUnsettled, options.max_iterations)
                                                            : options.max_iterations;
    if (report.iterations > std::min(most, kIterationsOfStart) && can_differentiate())
      return differentiate(states, constraints, options, report);
    if (report.iterations > most) return take_best(states, constraints, options, report);
    for (std::size_t i = 0; i < f.size(); ++i) next_f[i] -= f[i];
    for (Index i = 0; i < rows.size(); ++i) change[static_cast<std::size_t>(i)] /= rows.row(i).law.tolerance;
    secant.advance(f, next_f, change);
    keep_within_bounds();
  }
}

void IslandSolver::Impl::keep_within_bounds() {
  for (std::size_t i = 0; i < f.size(); ++i) f[i] = std::clamp(f[i], lower[i], upper[i]);
  if (rule.friction == FrictionModel::kHeuristicNoSlip) return;
  for (std::size_t i = 0; i < cones; ++i) {
    const auto n = static_cast<std::size_t>(bounded[3 * i]), t = n + 1, u = n + 2;
    const double largest = friction[i] * (f[n] + step * reaction[n]);
    const double along = f[t] + step * reaction[t], across = f[u] + step * reaction[u];
    const double size = std::hypot(along, across);
    if (!(size > largest)) continue;
    f[t] += along * (largest / size - 1.0);
    f[u] += across * (largest / size - 1.0);
  }
}

/// Whether the island is small enough, and its rows have an interval each.
bool IslandSolver::Impl::can_differentiate() const {
  constexpr std::size_t kMostRows = 96;
  return f.size() <= kMostRows && cones == 0 && flexibility.empty() && rule.method != ContactMethod::kGapProgram;
}

/// From the best impulses seen, with the rows' true derivatives.
SolveStatus IslandSolver::Impl::differentiate(const BodyStates& states, std::span<Constraint* const> constraints,
                                              const IslandOptions& options, IslandReport& report) {
  const std::size_t m = f.size(), n = metric.size();
  take_best(states, constraints, options, report);
  slope.resize(m), tolerance.resize(m);
  for (std::size_t i = 0; i < m; ++i) {
    slope[i] = compliance[i];
    for (std::size_t j = 0; j < n; ++j) slope[i] += metric[j] * J[i * n + j] * J[i * n + j];
    tolerance[i] = laws[i].tolerance;
  }
  struct Context {
    Impl& solver;
    const BodyStates& states;
    std::span<Constraint* const> constraints;
    const IslandOptions& options;
    IslandReport& report;
  } context{*this, states, constraints, options, report};
  // One captured pointer fits in std::function's own storage, so this allocates nothing.
  const auto evaluate = [&context](std::span<const double> impulses, std::span<double> w) {
    Impl& s = context.solver;
    if (impulses.data() != s.f.data()) std::copy(impulses.begin(), impulses.end(), s.f.begin());
    s.predict(context.options);
    s.measure(context.states, StepTime::kEnd, context.constraints, s.gap);
    ++context.report.iterations;
    for (std::size_t i = 0; i < w.size(); ++i)
      w[i] = s.gap[i] - s.laws[i].offset + s.compliance[i] * (s.f[i] + s.step * s.reaction[i]);
  };
  report.change = newton.solve({.slope = slope, .tolerance = tolerance, .lower = lower, .upper = upper}, evaluate, f);
  return report.change <= 1.0 ? SolveStatus::kSolved : SolveStatus::kIterationLimit;
}

/// The best impulses seen, where Newton's method does not settle: steps in which bodies turn by a radian and more.
SolveStatus IslandSolver::Impl::take_best(const BodyStates& states, std::span<Constraint* const> constraints,
                                          const IslandOptions& options, IslandReport& report) {
  if (!(report.change <= secant.best())) {
    report.change = secant.best();
    std::copy(secant.best_iterate().begin(), secant.best_iterate().end(), f.begin());
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
  }
  return SolveStatus::kIterationLimit;
}

/// What it takes to lift all bodies of the island by a distance within a step. Rows that push overlapping bodies apart
/// may do no more, however hard they press against each other.
double IslandSolver::Impl::largest_recovery_work(double distance, const IslandOptions& options) const {
  const double speed = distance / options.step;
  double work = 0.0;
  for (Index local = 0; local < bodies.count(); ++local)
    work +=
        bodies.body(local).group->frame_constants().mass * (0.5 * speed * speed + options.gravity.norm() * distance);
  return work;
}

/// Σ f/Δt times the agents' displacements, what is negative not counted, and what the rows' springs give.
double IslandSolver::Impl::agent_work(const IslandOptions& options) const {
  double work = 0.0;
  double recovery_work = 0.0, recovery = 0.0;
  for (std::size_t i = 0; i < laws.size(); ++i) {
    const double given = std::max(0.0, (f[i] / options.step + reaction[i]) * laws[i].agent_displacement);
    if (laws[i].lower == 0.0) {
      recovery_work += given;
      recovery = std::max(recovery, laws[i].agent_displacement);
    } else {
      work += given;
    }
    // A spring with one bound pushes on one side alone.
    const double before = laws[i].lower == 0.0 ? std::min(start_gap[i], 0.0) : start_gap[i];
    const double after = laws[i].lower == 0.0 ? std::min(gap[i], 0.0) : gap[i];
    work += 0.5 * laws[i].stiffness * (before * before - after * after);
  }
  work += std::min(recovery_work, largest_recovery_work(recovery, options));
  work += stored_energy;
  for (const ConstraintRows::Flexibility& g : flexibility) {
    const auto i = static_cast<std::size_t>(g.i), j = static_cast<std::size_t>(g.j);
    work -= (i == j ? 0.5 : 1.0) * g.value * (f[i] / step + reaction[i]) * (f[j] / step + reaction[j]);
  }
  return work;
}

/// Whether only rows act that can neither give nor take energy: hard ones that no agent moves.
bool IslandSolver::Impl::is_workless() const {
  if (stored_energy > 0.0) return false;  // dents that let go
  for (std::size_t i = 0; i < laws.size(); ++i) {
    if (f[i] == 0.0 && reaction[i] == 0.0) continue;
    if (!is_equality(laws[i]) || laws[i].compliance > 0.0 || laws[i].agent_displacement != 0.0) return false;
  }
  return true;
}

/// Where not even standing still is enough, since the rows did not come together and have left bodies bent: less of the
/// impulses, in the end none. The free step has the energy it began with.
void IslandSolver::Impl::guard_energy(const BodyStates& states, std::span<Constraint* const> constraints,
                                      const IslandOptions& options, IslandReport& report) {
  constexpr int kHalvings = 12;
  bool give_back = options.undisturbed && report.status == SolveStatus::kSolved && is_workless();
  for (int halving = 0;; ++halving) {
    const IslandEnergy::Change done = energy.guard(bodies, rows, agent_work(options), give_back, options);
    report.energy_removed = done.removed;
    report.energy_surplus = done.surplus;
    if (!(done.left > 0.0) || halving == kHalvings) return;
    const bool last = halving + 1 == kHalvings;
    for (std::size_t i = 0; i < f.size(); ++i) {
      f[i] = last ? 0.0 : 0.5 * f[i];  // not times 0: they need not be finite
      reaction[i] = last ? 0.0 : 0.5 * reaction[i];
    }
    give_back = false;
    report.status = SolveStatus::kIterationLimit;
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
  }
}

IslandSolver::IslandSolver() : impl_(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

IslandReport IslandSolver::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  Impl& s = *impl_;
  IslandReport report{.bodies = static_cast<int>(members.size())};
  IslandOptions part = options;
  double left = options.step;
  bool begins = true;
  const bool may_cut = allows_cuts(table, members, constraints);
  for (int cut = 0; may_cut && cut < kMostCuts; ++cut) {
    const double time = s.next_cut(table, members, constraints, options.gravity, left);
    if (!(time > kShortestPart * options.step && left - time > kShortestPart * options.step)) break;
    part.step = time;
    s.take_part({table, members, constraints, begins, false}, part, options.step, report);
    part.energy_surplus = report.energy_surplus;
    left -= time;
    begins = false;
    ++report.cuts;
  }
  part.step = left;
  s.take_part({table, members, constraints, begins, true}, part, options.step, report);
  return report;
}

/// One step, or a part of one that is cut.
void IslandSolver::Impl::take_part(const Part& part, const IslandOptions& options, double whole_step,
                                   IslandReport& report) {
  const BodyStates states(part.table);
  rule = options.contact;
  gather(part.table, part.members, part.constraints, options);
  set_modal_steps(options.step, whole_step);
  IslandReport done;
  energy.begin(bodies, options.gravity);
  program_report = {};
  if (holds_contact_forces()) solve_touch(options, done.programs);
  find_reaction(StepTime::kStart, options, reaction);
  done.status = iterate(states, part.constraints, options, done);
  answer_at_end(states, part.constraints, options);
  const bool as_it_is = rule.is_program() && rule.guard == ProgramGuard::kNone;
  if (options.guard_energy && !as_it_is) guard_energy(states, part.constraints, options, done);
  for (Index local = 0; local < bodies.count(); ++local)
    bodies.body(local).group->commit(bodies.body(local).slot, part.begins, part.ends);
  for (std::size_t i = 0; i < f.size(); ++i) f[i] += options.step * reaction[i];
  for (std::size_t i = 0; holds_contact_forces() && i < f.size(); ++i) f[i] += touch_impulse[i];
  done.programs.add(program_report);
  report.programs.add(done.programs);
  for (std::size_t i = 0; i < part.constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(first_row[i]), end = static_cast<std::size_t>(first_row[i + 1]);
    part.constraints[i]->accept(states, std::span<const double>(f).subspan(begin, end - begin));
  }
  if (done.status != SolveStatus::kSolved) report.status = done.status;
  report.rows = rows.size();
  report.iterations = std::max(report.iterations, done.iterations);
  report.change = std::max(report.change, done.change);
  report.energy_removed += done.energy_removed;
  report.energy_surplus = done.energy_surplus;
}

/// The first time at which a constraint wants the step cut; all of what is left of it where none does.
double IslandSolver::Impl::next_cut(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                    std::span<Constraint* const> constraints, const Vec3& gravity, double left) {
  if (motions.size() < members.size()) motions.resize(members.size());
  for (std::size_t i = 0; i < members.size(); ++i) {
    const ConstrainedBody& body = table[static_cast<std::size_t>(members[i])];
    body.group->predict_motion(body.slot, gravity, left, motions[i]);
  }
  const FreeMotions free{members, std::span(motions).first(members.size())};
  for (Constraint* constraint : constraints) left = constraint->next_cut(BodyStates(table), free, left);
  return left;
}

/// Makes the modes go through a part of a step, or through an impact, in which all of them move: those that answer
/// statically would lose what they store, and no hand is there to whip them.
void IslandSolver::Impl::set_modal_steps(double length, double whole_step) {
  if (theta == 1.0 && length == whole_step) return;
  const auto count = static_cast<std::size_t>(bodies.count());
  if (modal_steps.size() < count) modal_steps.resize(count);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ModalModelData& data = bodies.body(local).group->model().data();
    modal_steps[static_cast<std::size_t>(local)].set(data.eigenvalues, data.decays, length,
                                                     theta < 1.0 ? ModalStep::kNone : std::numbers::pi / whole_step);
  }
  bodies.set_modal_steps(std::span(modal_steps).first(count));
}

}  // namespace limber
