#include "limber/constraints/island_solver.h"

#include <algorithm>
#include <cmath>

#include "island_energy.h"
#include "limber/constraints/contact_qp.h"
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
  for (int i = 0; i < r.rotations; ++i)
    a.angular += r.axes.col(i) * (r.inverse_moments[i] * r.axes.col(i).dot(torque));
  return a;
}

bool is_equality(const RowLaw& law) { return law.lower == -kUnbounded && law.upper == kUnbounded; }

/// Whether bodies lie still on a row of one sign, or one with a largest force: at its gap, and slower than held forces
/// make of rest within a step.
bool rests(const RowLaw& law, double gap, double speed, double speed_of_a_step) {
  return std::abs(gap - law.offset) <= 2.0 * law.tolerance && std::abs(speed) <= std::abs(speed_of_a_step);
}

}  // namespace

struct IslandSolver::Impl {
  IslandBodies bodies;
  ConstraintRows rows;
  std::vector<Index> first_row;  // per constraint, and the end
  std::vector<double> J, metric, G, weighted, gap, start_gap, b, lower, upper, compliance;
  std::vector<double> f, next_f, reaction, end_reaction, change;
  std::vector<ConstraintLoad> loads;
  std::vector<double> modal_loads;
  ContactQpSolver qp;
  SecantIteration secant;
  IslandEnergy energy;

  void gather(std::span<const ConstrainedBody> table, std::span<const Index> members,
              std::span<Constraint* const> constraints, const IslandOptions& options);
  void measure(const BodyStates& states, StepTime when, std::span<Constraint* const> constraints,
               std::vector<double>& into) const;
  void weigh();
  void find_reaction(StepTime when, const IslandOptions& options, std::vector<double>& answer);
  void answer_at_end(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options);
  SolveStatus iterate(const BodyStates& states, std::span<Constraint* const> constraints, const IslandOptions& options,
                      IslandReport& report);
  SolveStatus improve();
  double largest_change() const;
  SolveStatus take_best(const BodyStates& states, std::span<Constraint* const> constraints,
                        const IslandOptions& options, IslandReport& report);
  void predict(const IslandOptions& options);
  void sum_loads(std::span<const double> values, double scale);
  void add_loads(std::span<const double> values, double frame_scale, double modal_scale);
  double agent_work(const IslandOptions& options) const;
  bool is_workless() const;
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

/// What the rows that hold answer to held forces; the others have no row of G then.
void IslandSolver::Impl::find_reaction(StepTime when, const IslandOptions& options, std::vector<double>& answer) {
  bodies.write_frame_metric(metric);
  weigh();
  const std::size_t n = metric.size();
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
    double acceleration = 0.0, speed = 0.0;
    for (const ConstraintRows::Side& side : rows.row(i).sides) {
      const Index local = bodies.local(side.body);
      if (local < 0) continue;
      const ConstrainedBody& body = bodies.body(local);
      const FrameAcceleration a =
          held_acceleration(*body.group, body.slot, when, bodies.response(local), options.gravity);
      const RigidFrame& frame = frame_at(*body.group, body.slot, when);
      acceleration += side.linear.dot(a.linear) + side.angular.dot(a.angular);
      speed += side.linear.dot(frame.velocity()) +
               side.angular.dot(frame.angular_velocity(body.group->frame_constants()));
    }
    b[at] = acceleration;
    compliance[at] = 0.0;
    lower[at] = law.lower / options.step, upper[at] = law.upper / options.step;
    if (law.stiffness > 0.0) {  // a spring holds with the force that it has
      lower[at] = upper[at] = std::clamp(-law.stiffness * gap[at], lower[at], upper[at]);
    } else if (!(law.holds && (is_equality(law) || rests(law, gap[at], speed, acceleration * options.step)))) {
      lower[at] = upper[at] = b[at] = 0.0;
      std::fill_n(G.begin() + static_cast<std::ptrdiff_t>(at * n), n, 0.0);
    }
  }
  qp.solve(FactoredContactQp{.size = static_cast<int>(f.size()),
                             .dimension = static_cast<int>(n),
                             .G = G,
                             .D = compliance,
                             .b = b,
                             .lower = lower,
                             .upper = upper},
           answer);
}

/// The frames' second half of what holds them: at the step's end, by the rows there.
void IslandSolver::Impl::answer_at_end(const BodyStates& states, std::span<Constraint* const> constraints,
                                       const IslandOptions& options) {
  bodies.place(StepTime::kEnd);
  rows.clear();
  for (Constraint* constraint : constraints) constraint->add_rows(states, StepTime::kEnd, options.step, rows);
  bodies.write_jacobian(rows, J);
  find_reaction(StepTime::kEnd, options, end_reaction);
  sum_loads(end_reaction, 0.5 * options.step);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    const ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
    body.group->adjust_prediction(body.slot, load.impulse, load.moment, {});
  }
}

/// The bodies under f and the first half of the reaction at the step's start; their modes under all of both, held.
void IslandSolver::Impl::predict(const IslandOptions& options) {
  sum_loads(f, 1.0);
  add_loads(reaction, 0.5 * options.step, options.step);
  for (Index local = 0; local < bodies.count(); ++local) {
    const ConstrainedBody& body = bodies.body(local);
    body.group->predict(body.slot, options.gravity, loads[static_cast<std::size_t>(local)]);
  }
}

void IslandSolver::Impl::sum_loads(std::span<const double> values, double scale) {
  loads.assign(static_cast<std::size_t>(bodies.count()), {});
  modal_loads.assign(metric.size(), 0.0);
  for (Index local = 0; local < bodies.count(); ++local)
    loads[static_cast<std::size_t>(local)].modal = {modal_loads.data() + bodies.first(local) +
                                                        bodies.response(local).size() - bodies.response(local).modes,
                                                    static_cast<std::size_t>(bodies.response(local).modes)};
  add_loads(values, scale, scale);
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
SolveStatus IslandSolver::Impl::improve() {
  const auto m = static_cast<Eigen::Index>(f.size()), n = static_cast<Eigen::Index>(metric.size());
  const Eigen::Map<const RowMajor> B(G.data(), m, n);
  Eigen::Map<Eigen::VectorXd> x(weighted.data(), n);  // G's weights are no longer needed
  x.noalias() = B.transpose() * as_vector(f);
  Eigen::Map<Eigen::VectorXd>(change.data(), m).noalias() = B * x;
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
    b[at] = gap[at] - law.offset - change[at];  // w = A f' + compliance f' + b
  }
  next_f = f;
  const ContactQpResult result = qp.solve(FactoredContactQp{.size = static_cast<int>(m),
                                                            .dimension = static_cast<int>(n),
                                                            .G = G,
                                                            .D = compliance,
                                                            .b = b,
                                                            .lower = lower,
                                                            .upper = upper},
                                          next_f);
  x.noalias() = B.transpose() * (as_vector(next_f) - as_vector(f));
  Eigen::Map<Eigen::VectorXd>(change.data(), m).noalias() = B * x;
  return result.status;
}

double IslandSolver::Impl::largest_change() const {
  double largest = 0.0;
  for (Index i = 0; i < rows.size(); ++i)
    largest = std::max(largest, std::abs(change[static_cast<std::size_t>(i)]) / rows.row(i).law.tolerance);
  return largest;
}

SolveStatus IslandSolver::Impl::iterate(const BodyStates& states, std::span<Constraint* const> constraints,
                                        const IslandOptions& options, IslandReport& report) {
  bodies.write_position_metric(options.step, metric);
  weigh();
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = rows.row(i).law;
    const double held = options.step * reaction[at];  // bounds are on the whole impulse
    lower[at] = law.lower - held, upper[at] = law.upper - held;
    compliance[at] = law.compliance;
  }
  secant.begin(f.size());
  for (report.iterations = 1;; ++report.iterations) {
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
    const SolveStatus status = improve();
    report.change = largest_change();
    if (report.change <= 1.0) return status;
    if (report.iterations > options.max_iterations) return take_best(states, constraints, options, report);
    for (std::size_t i = 0; i < f.size(); ++i) next_f[i] -= f[i];
    for (Index i = 0; i < rows.size(); ++i) change[static_cast<std::size_t>(i)] /= rows.row(i).law.tolerance;
    secant.advance(f, next_f, change);
    for (std::size_t i = 0; i < f.size(); ++i) f[i] = std::clamp(f[i], lower[i], upper[i]);
  }
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

/// Σ f/Δt times the agents' displacements, what is negative not counted.
double IslandSolver::Impl::agent_work(const IslandOptions& options) const {
  double work = 0.0;
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    work += std::max(0.0, (f[at] / options.step + reaction[at]) * rows.row(i).law.agent_displacement);
    const double before = start_gap[at], after = gap[at];
    work += 0.5 * rows.row(i).law.stiffness * (before * before - after * after);  // given by the row's spring
  }
  return work;
}

/// Whether only rows act that can neither give nor take energy: hard ones that no agent moves.
bool IslandSolver::Impl::is_workless() const {
  for (Index i = 0; i < rows.size(); ++i) {
    const RowLaw& law = rows.row(i).law;
    if (f[static_cast<std::size_t>(i)] == 0.0 && reaction[static_cast<std::size_t>(i)] == 0.0) continue;
    if (!is_equality(law) || law.compliance > 0.0 || law.agent_displacement != 0.0) return false;
  }
  return true;
}

IslandSolver::IslandSolver() : impl_(std::make_unique<Impl>()) {}
IslandSolver::~IslandSolver() = default;
IslandSolver::IslandSolver(IslandSolver&&) noexcept = default;
IslandSolver& IslandSolver::operator=(IslandSolver&&) noexcept = default;

IslandReport IslandSolver::step(std::span<const ConstrainedBody> table, std::span<const Index> members,
                                std::span<Constraint* const> constraints, const IslandOptions& options) {
  Impl& s = *impl_;
  const BodyStates states(table);
  s.gather(table, members, constraints, options);
  IslandReport report{.bodies = s.bodies.count(), .rows = s.rows.size()};
  s.energy.begin(s.bodies, options.gravity);
  s.find_reaction(StepTime::kStart, options, s.reaction);
  report.status = s.iterate(states, constraints, options, report);
  const double work = s.agent_work(options);
  s.answer_at_end(states, constraints, options);
  if (options.guard_energy)
    report.energy_removed = s.energy.guard(s.bodies, s.rows, work, s.is_workless(), options);
  report.energy_credit = options.energy_credit + report.energy_removed;
  for (Index local = 0; local < s.bodies.count(); ++local) s.bodies.body(local).group->commit(s.bodies.body(local).slot);
  for (std::size_t i = 0; i < s.f.size(); ++i) s.f[i] += options.step * s.reaction[i];
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    const auto begin = static_cast<std::size_t>(s.first_row[i]), end = static_cast<std::size_t>(s.first_row[i + 1]);
    constraints[i]->accept(states, std::span<const double>(s.f).subspan(begin, end - begin));
  }
  return report;
}

}  // namespace limber
