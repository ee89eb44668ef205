#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "island_step.h"

namespace limber {
namespace {

// Of what an impulse moves its own row by within the step, what the row yields to it by in the first round; and the
// least that it ever does, so that 1/c stays within the digits of the factor. The answer does not depend on them.
constexpr double kYield = 1e-3, kStiffest = 1e-6;
// How far from the law impulses may be: by what would move their own gap by so many tolerances.
constexpr double kFarthest = 30.0;
// Newton's steps in a step; and contacts solved for, each counted in each of them, after which rounds among contacts
// end: a few milliseconds.
constexpr int kMostNewtonSteps = 100, kMostSolved = 12000;

internal::ContactPotential potential_of(const RowLaw& law) {
  using Set = internal::ContactPotential::Set;
  if (law.radius > 0.0) return {.set = Set::kBall, .bound = law.radius};
  if (law.friction > 0.0) return {.set = Set::kCone, .bound = law.friction};
  return {.set = Set::kInterval, .lower = law.lower, .upper = law.upper};
}

}  // namespace

/// All rows as one convex problem, linear about the motion under the impulses at hand, again and again until these
/// meet the rows' law at the true gaps: the method of multipliers, in which a row's spring yields from what it exerted.
SolveStatus IslandSolver::Impl::solve_convex(const BodyStates& states, std::span<Constraint* const> constraints,
                                             const IslandOptions& options, IslandReport& report) {
  bodies.write_position_metric(step, theta, metric);
  place_units();
  fill_units();
  begin_units();
  secant.begin(f.size());
  internal::ConvexContactReport done;
  bool more = true;
  for (report.iterations = 1;; ++report.iterations) {
    take_impulses();
    predict(options);
    measure(states, StepTime::kEnd, constraints, gap);
    const Distance left = find_starts(report.iterations == 1);
    report.change = left.from_law;
    // Joints and hands that contradict each other, or the ground, meet in the end where no gap moves any more.
    if (!more && (left.from_law <= 1.0 || (!contacts_alone && left.moved <= 1.0))) return SolveStatus::kSolved;
    const bool tired = report.newton_steps * static_cast<int>(units.size()) >= kMostSolved;
    if (report.iterations > options.max_iterations || (contacts_alone && tired)) break;
    const internal::ConvexContactOptions within{.max_iterations = kMostNewtonSteps - report.newton_steps};
    done = report.iterations == 1 ? contacts.solve(within) : contacts.solve_on(within);
    report.newton_steps += done.iterations;
    if (done.status != SolveStatus::kSolved) break;
    stiffen();
    more = press_early();
    if (more) secant.begin(f.size());
    advance_units();
  }
  return end_unsettled(done.status, states, constraints, options, report);
}

/// Where rounds end before the rows' law is met: contacts alone stay as the last round left them. What Newton's method
/// left unsolved in the first of them is the motion that it found.
SolveStatus IslandSolver::Impl::end_unsettled(SolveStatus last, const BodyStates& states,
                                              std::span<Constraint* const> constraints, const IslandOptions& options,
                                              IslandReport& report) {
  if (!contacts_alone) return take_best(states, constraints, options, report);
  if (report.iterations > 1) return SolveStatus::kSolved;
  for (std::size_t u = 0; u < units.size(); ++u) units[u].impulse = contacts.impulse(u);
  take_impulses();
  take_motion(options);
  measure(states, StepTime::kEnd, constraints, gap);
  return last;
}

/// Each contact a unit of its rows; what a body yields beyond its modes are further degrees of freedom of unit weight.
void IslandSolver::Impl::place_units() {
  order.resize(f.size()), place.resize(f.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::iota(place.begin(), place.end(), Index{0});
  residual.set(bodies, flexibility, place, f.size(), step);
  contacts.begin_structure();
  nodes.clear(), units.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    nodes.push_back(contacts.add_node(static_cast<std::size_t>(bodies.response(local).size()) + residual.rank(local)));
  for (std::size_t i = 0, count = 1; i < f.size(); i += count) {
    count = static_cast<std::size_t>(contact_rows(laws[i]));
    contacts.add_unit(count, potential_of(laws[i]));
    units.push_back({.first = i, .rows = count});
    for_bodies(i, [&](const ConstraintRows::Side&, Index local, bool again) {
      if (!again) contacts.add_side(nodes[static_cast<std::size_t>(local)]);
    });
  }
  contacts.end_structure();
}

/// D^½
void IslandSolver::Impl::take_roots() {
  weighted.resize(metric.size());
  for (std::size_t i = 0; i < metric.size(); ++i) weighted[i] = std::sqrt(metric[i]);
}

/// J D^½, and what rows yield at first, before the columns of what the bodies do.
void IslandSolver::Impl::fill_units() {
  take_roots();
  fill_values([&](const ConstraintRows::Side& side, Index local, std::size_t, double* to) {
    const BodyResponse& r = bodies.response(local);
    one_row.assign(static_cast<std::size_t>(r.size()), 0.0);
    r.add_row(side.linear, side.angular, rows.modal(side), one_row.data());
    const double* root = weighted.data() + bodies.first(local);
    for (std::size_t k = 0; k < one_row.size(); ++k) to[k] += one_row[k] * root[k];
  });
  for (std::size_t u = 0; u < units.size(); ++u) {
    const RowLaw& law = laws[units[u].first];
    const Vec3 response = contacts.response(u);
    const double moved = law.radius > 0.0 ? response.mean() : response[0];
    units[u].response = moved;
    contacts.potential(u).compliance =
        law.compliance > 0.0 ? law.compliance
                             : std::max((law.contact ? kYield : kStiffest) * moved, std::numeric_limits<double>::min());
  }
  fill_values([&](const ConstraintRows::Side&, Index local, std::size_t row, double* to) {
    std::ranges::copy(residual.row(local, row), to + bodies.response(local).size());
  });
}

/// write(side, local, row, values) for each side of each row.
template <class Write>
void IslandSolver::Impl::fill_values(Write&& write) {
  std::size_t next_side = 0, sides = 0;
  for (const RowUnit& unit : units) {
    for (std::size_t r = 0; r < unit.rows; ++r) {
      sides = 0;
      for_bodies(unit.first + r, [&](const ConstraintRows::Side& side, Index local, bool again) {
        sides += again ? 0 : 1;
        write(side, local, unit.first + r, contacts.values(next_side + sides - 1).row(r));
      });
    }
    next_side += sides;
  }
}

/// From the motion without contacts; springs begin at the impulses of the last step.
void IslandSolver::Impl::begin_units() {
  for (std::size_t u = 0; u < units.size(); ++u) {
    RowUnit& unit = units[u];
    const RowLaw& law = laws[unit.first];
    for (std::size_t r = 0; r < unit.rows; ++r) {
      const auto axis = static_cast<int>(r);
      unit.impulse[axis] = step * reaction[unit.first + r];
      unit.anchor[axis] = law.contact ? step * laws[unit.first + r].last_force : unit.impulse[axis];
    }
    unit.anchor = contacts.potential(u).nearest(unit.anchor);
    unit.shift = law.shift;
    unit.dent = kUnbounded;
  }
}

/// f of the units' impulses, and the motion that they make in the problem.
void IslandSolver::Impl::take_impulses() {
  for (std::size_t u = 0; u < units.size(); ++u) {
    const RowUnit& unit = units[u];
    contacts.impulse(u) = unit.impulse;
    for (std::size_t r = 0; r < unit.rows; ++r)
      f[unit.first + r] = unit.impulse[static_cast<int>(r)] - step * reaction[unit.first + r];
  }
  contacts.set_motion();
}

/// u⁰: the rows' true gaps at the end of the motion that is predicted, less what they ask for, what is linear in the
/// impulses, and what the springs exert there already.
/// @return how far the impulses are from the rows' law at those gaps, and gaps from those of the last round, by
/// tolerance
IslandSolver::Impl::Distance IslandSolver::Impl::find_starts(bool first_round) {
  if (first_round) find_scale();
  Distance distance;
  for (std::size_t u = 0; u < units.size(); ++u) {
    RowUnit& unit = units[u];
    const RowLaw& law = laws[unit.first];
    Vec3 open = Vec3::Zero();
    for (std::size_t r = 0; r < unit.rows; ++r)
      open[static_cast<int>(r)] = gap[unit.first + r] - laws[unit.first + r].offset + dent_of(unit.first + r);
    distance.moved = first_round ? kUnbounded : std::max(distance.moved, (open - unit.end).norm() / law.tolerance);
    unit.end = open;
    if (law.friction > 0.0 && !first_round) unit.shift = law.friction * open.tail<2>().norm();
    open[0] += unit.shift;
    const internal::ContactPotential& potential = contacts.potential(u);
    Vec3 yields = potential.compliance * unit.anchor;
    if (law.compliance > 0.0) yields[0] = 0.0;  // a spring of its own
    const Vec3 from_law = unit.response / kFarthest * (potential.at(open - yields).impulse - unit.impulse);
    distance.from_law = std::max(distance.from_law, from_law.norm() / law.tolerance);
    unit.moved = contacts.moved(u);
    contacts.start(u) = open - yields - unit.moved;
    if (first_round) contacts.impulse(u) = unit.anchor;
  }
  return distance;
}

/// How the bodies move, by degree of freedom: what momenta are at hand.
void IslandSolver::Impl::find_scale() {
  for (Index local = 0; local < bodies.count(); ++local) {
    const auto& [group, slot, pose] = bodies.body(local);
    const BodyResponse& r = bodies.response(local);
    const RigidTransform &start = group->frame(slot).pose(), &end = group->predicted_frame(slot).pose();
    const Vec3 moved = end.p - start.p, turned = rotation_vector(end.q * start.q.conjugate());
    const std::span<const double> z0 = group->amplitudes(slot), z1 = group->predicted_amplitudes(slot);
    const std::span<double> y = contacts.free_motion(nodes[static_cast<std::size_t>(local)]);
    std::size_t k = 0;
    for (int i = 0; i < r.translations; ++i) y[k++] = moved[i];
    for (int i = 0; i < r.rotations; ++i) y[k++] = r.axes.col(i).dot(turned);
    for (std::size_t i = 0; i < z0.size(); ++i) y[k++] = z1[i] - z0[i];
    const double* root = weighted.data() + bodies.first(local);
    for (std::size_t i = 0; i < k; ++i) y[i] = root[i] > 0.0 ? y[i] / root[i] : 0.0;
  }
}

/// Springs become stiffer where they yielded by as much as in the round before.
void IslandSolver::Impl::stiffen() {
  constexpr double kSlow = 0.25, kStiffer = 0.1;
  for (std::size_t u = 0; u < units.size(); ++u) {
    RowUnit& unit = units[u];
    const RowLaw& law = laws[unit.first];
    if (law.compliance > 0.0) continue;
    double& c = contacts.potential(u).compliance;
    const double dent = c * (contacts.impulse(u) - unit.anchor).norm();
    if (dent > kSlow * unit.dent && dent > law.tolerance)
      c = std::max(kStiffer * c, std::min(c, kStiffest * unit.response));
    unit.dent = dent;
  }
}

/// The impulses of the next round: those found; beside joints with what secants tell of the rounds so far.
void IslandSolver::Impl::advance_units() {
  if (contacts_alone) {
    for (std::size_t u = 0; u < units.size(); ++u) units[u].impulse = units[u].anchor = contacts.impulse(u);
    return;
  }
  for (std::size_t u = 0; u < units.size(); ++u) {
    const RowUnit& unit = units[u];
    const Vec3 moved = contacts.moved(u) - unit.moved;
    for (std::size_t r = 0; r < unit.rows; ++r) {
      const auto axis = static_cast<int>(r);
      f[unit.first + r] = unit.impulse[axis];
      next_f[unit.first + r] = contacts.impulse(u)[axis] - unit.impulse[axis];
      change[unit.first + r] = moved[axis] / laws[unit.first].tolerance;
    }
  }
  secant.advance(f, next_f, change);
  take_whole(f);
}

/// Whole impulses by row, those nearest that rows may exert.
void IslandSolver::Impl::take_whole(std::span<const double> impulses) {
  for (std::size_t u = 0; u < units.size(); ++u) {
    Vec3 whole = Vec3::Zero();
    for (std::size_t r = 0; r < units[u].rows; ++r) whole[static_cast<int>(r)] = impulses[units[u].first + r];
    units[u].impulse = units[u].anchor = contacts.potential(u).nearest(whole);
  }
}

/// Bodies that something pressed on in the last step.
void IslandSolver::Impl::begin_early() {
  early.assign(static_cast<std::size_t>(bodies.count()), 0);
  contacts_alone = std::ranges::all_of(laws, &RowLaw::contact);
  all_early = false;
  if (!convex || theta < 1.0) return;
  for (std::size_t row = 0; row < laws.size(); ++row)
    if (laws[row].contact && laws[row].last_force != 0.0)
      for_bodies(row,
                 [&](const ConstraintRows::Side&, Index local, bool) { early[static_cast<std::size_t>(local)] = 1; });
  all_early = !contacts_alone && std::ranges::any_of(early, [](char c) { return c != 0; });
  if (all_early) std::ranges::fill(early, 1);
}

/// Where something presses, gravity and held forces come to the frame at the step's start, as contacts do: what rests
/// has no velocity then, and the work of all is that over one displacement. Bodies in flight fall exactly.
/// @return whether there are more of them
bool IslandSolver::Impl::press_early() {
  bool more = false;
  for (std::size_t u = 0; theta == 1.0 && u < contacts.units(); ++u) {
    if (!laws[units[u].first].contact || contacts.impulse(u).isZero(0.0)) continue;
    for_bodies(units[u].first, [&](const ConstraintRows::Side&, Index local, bool) {
      more = more || early[static_cast<std::size_t>(local)] == 0;
      early[static_cast<std::size_t>(local)] = 1;
    });
  }
  if (more && !contacts_alone && !all_early) {
    all_early = true;
    std::ranges::fill(early, 1);
    std::ranges::fill(reaction, 0.0);
  }
  return more;
}

/// What the bodies yield beyond their modes, in a row's gap.
double IslandSolver::Impl::dent_of(std::size_t row) {
  double sum = 0.0;
  for_bodies(row, [&](const ConstraintRows::Side&, Index local, bool) {
    const std::span<const double> columns = residual.row(local, row);
    const std::span<const double> y = contacts.motion(nodes[static_cast<std::size_t>(local)]);
    const auto own = static_cast<std::size_t>(bodies.response(local).size());
    for (std::size_t k = 0; k < columns.size(); ++k) sum += columns[k] * y[own + k];
  });
  return sum;
}

/// The motion found in place of that under the impulses found, which are not yet in balance with it.
void IslandSolver::Impl::take_motion(const IslandOptions& options) {
  sum_loads(f, 0.0, 0.0);
  for (Index local = 0; local < bodies.count(); ++local) {
    const BodyResponse& r = bodies.response(local);
    const std::span<const double> y = contacts.motion(nodes[static_cast<std::size_t>(local)]);
    const double* weight = weighted.data() + bodies.first(local);
    ConstraintLoad& load = loads[static_cast<std::size_t>(local)];
    std::size_t k = 0;
    for (int i = 0; i < r.translations; ++i, ++k) load.impulse[i] += theta * y[k] / weight[k];
    for (int i = 0; i < r.rotations; ++i, ++k) load.moment += theta * y[k] / weight[k] * r.axes.col(i);
    double* modal = modal_loads.data() + (load.modal.data() - modal_loads.data());
    for (int i = 0; i < r.modes; ++i, ++k)
      if (weight[k] > 0.0) modal[i] += y[k] / weight[k];
  }
  predict_under_loads(options);
}

}  // namespace limber
