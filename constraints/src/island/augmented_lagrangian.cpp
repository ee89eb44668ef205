#include "augmented_lagrangian.h"
#include "../tuning.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limber::internal {
/// All rows as one convex problem, linear about the motion under the impulses at hand, again and again until these
/// meet the rows' law at the true gaps: the method of multipliers, in which a row's spring yields from what it exerted.
void AugmentedLagrangian::solve(IslandStep& step, IslandReport& report) {
  place_units(step);
  fill_units(step);
  begin_units(step);
  secants_.begin(step.size());
  begun_ = false;
  report.iterations = 1;
  iterate(step, report);
}

void AugmentedLagrangian::take_again(IslandStep& step) {
  take_impulses(step);
  step.predict();
}

void AugmentedLagrangian::iterate(IslandStep& step, IslandReport& report) {
  report.accepted = true;
  for (;; ++report.iterations) {
    take_impulses(step);
    step.predict();
    const Distance left = find_starts(step, !begun_);
    report.change = left.from_law;
    // Joints and hands that contradict each other, or the ground, meet in the end where no gap moves any more.
    const bool at_rest = !step.contacts_alone && left.moved <= kConstraintsTuning.rounds.newton_left;
    if (left.from_law <= 1.0 || at_rest) return;
    if (report.iterations > step.part.options.max_iterations) break;
    const ConvexContactOptions within{
        .tolerance = kConstraintsTuning.rounds.newton_left,
        .max_iterations = kConstraintsTuning.rounds.most_newton_steps - report.newton_steps};
    const ConvexContactReport done = begun_ ? contacts_.solve_on(within) : contacts_.solve(within);
    begun_ = true;
    report.newton_steps += done.iterations;
    if (done.status != SolveStatus::kSolved) break;
    stiffen(step);
    advance_units(step);
  }
  end_at_limit(step, report);
}

/// Where rounds end before the rows' law is met: contacts alone stay as the last round left them, and are accepted.
/// What Newton's method left unsolved in the first of them is the motion that it found.
void AugmentedLagrangian::end_at_limit(IslandStep& step, IslandReport& report) {
  report.accepted = step.contacts_alone && report.iterations > 1;
  if (!step.contacts_alone) return take_best(step, report);
  if (report.accepted) return;
  for (std::size_t u = 0; u < units_.size(); ++u) units_[u].impulse = contacts_.impulse(u);
  take_impulses(step);
  take_motion(step);
  report.change = largest_distance(step);
}

void AugmentedLagrangian::take_best(IslandStep& step, IslandReport& report) {
  if (!(report.change <= secants_.best())) {
    take_whole(secants_.best_iterate());
    take_impulses(step);
    step.predict();
    report.change = largest_distance(step);
  }
}

/// Each contact a unit of its rows; what a body yields beyond its modes are further degrees of freedom of unit weight.
void AugmentedLagrangian::place_units(const IslandStep& step) {
  const IslandBodies& bodies = step.bodies;
  residual_.set(bodies, step.rows, step.length());
  contacts_.begin_structure();
  nodes_.clear(), units_.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    nodes_.push_back(
        contacts_.add_node(static_cast<std::size_t>(bodies.response(local).size()) + residual_.rank(local)));
  step.for_units([&](std::size_t first, std::size_t count) {
    contacts_.add_unit(count, set_of(step.law(first)), step.law(first).tolerance);
    units_.push_back({.first = first, .rows = count});
    step.for_bodies(first, [&](const ConstraintRows::Side&, Index local, bool again) {
      if (!again) contacts_.add_side(nodes_[static_cast<std::size_t>(local)]);
    });
  });
  contacts_.end_structure();
}

/// J D^½ before the columns of what the bodies yield.
void AugmentedLagrangian::fill_rows(const IslandStep& step) {
  const IslandBodies& bodies = step.bodies;
  fill_values(step, [&](const ConstraintRows::Side&, Index local, std::size_t, double* to) {
    std::fill_n(to, static_cast<std::size_t>(bodies.response(local).size()), 0.0);
  });
  fill_values(step, [&](const ConstraintRows::Side& side, Index local, std::size_t, double* to) {
    const BodyResponse& r = bodies.response(local);
    one_row_.assign(static_cast<std::size_t>(r.size()), 0.0);
    r.add_row(side.linear, side.angular, step.rows.modal(side), one_row_.data());
    const double* root = root_.data() + bodies.first(local);
    for (std::size_t k = 0; k < one_row_.size(); ++k) to[k] += one_row_[k] * root[k];
  });
}

/// The rows, what they yield at first, and the columns of what the bodies do.
void AugmentedLagrangian::fill_units(const IslandStep& step) {
  const IslandBodies& bodies = step.bodies;
  root_.resize(static_cast<std::size_t>(bodies.degrees_of_freedom()));
  bodies.write_position_metric(step.length(), 1.0, root_);
  for (double& weight : root_) weight = std::sqrt(weight);
  fill_rows(step);
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const RowParameters& law = step.law(units_[u].first);
    const Vec3 response = contacts_.response(u);
    const double moved = law.radius > 0.0 ? response.mean() : response[0];
    units_[u].response = moved;
    contacts_.potential(u).compliance =
        law.compliance > 0.0
            ? law.compliance
            : std::max((law.contact ? kConstraintsTuning.rounds.yield : kConstraintsTuning.rounds.stiffest) * moved,
                       std::numeric_limits<double>::min());
  }
  fill_values(step, [&](const ConstraintRows::Side&, Index local, std::size_t row, double* to) {
    std::ranges::copy(residual_.row(local, row), to + bodies.response(local).size());
  });
}

/// write(side, local, row, values) for each side of each row.
template <class Write>
void AugmentedLagrangian::fill_values(const IslandStep& step, Write&& write) {
  std::size_t next_side = 0, sides = 0;
  for (const Unit& unit : units_) {
    for (std::size_t r = 0; r < unit.rows; ++r) {
      sides = 0;
      step.for_bodies(unit.first + r, [&](const ConstraintRows::Side& side, Index local, bool again) {
        sides += again ? 0 : 1;
        write(side, local, unit.first + r, contacts_.values(next_side + sides - 1).row(r));
      });
    }
    next_side += sides;
  }
}

/// From the motion without contacts; springs begin at the impulses of the last step.
void AugmentedLagrangian::begin_units(const IslandStep& step) {
  for (std::size_t u = 0; u < units_.size(); ++u) {
    Unit& unit = units_[u];
    const RowParameters& law = step.law(unit.first);
    for (std::size_t r = 0; r < unit.rows; ++r) {
      if (law.contact) unit.anchor[static_cast<int>(r)] = step.length() * step.law(unit.first + r).last_force;
    }
    unit.anchor = contacts_.potential(u).nearest(unit.anchor);
    unit.shift = law.shift;
    unit.changed = kUnbounded;
  }
}

/// f of the units' impulses, and the motion that they make in the problem.
void AugmentedLagrangian::take_impulses(IslandStep& step) {
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const Unit& unit = units_[u];
    contacts_.impulse(u) = unit.impulse;
    for (std::size_t r = 0; r < unit.rows; ++r) step.f[unit.first + r] = unit.impulse[static_cast<int>(r)];
  }
  contacts_.set_motion();
}

/// The natural residual |F − P(F − u/ρ)| ρ, ρ what an impulse moves its own gap by: a distance, 0 where the impulse is
/// the law's at the gap u.
double AugmentedLagrangian::distance_from_law(const Unit& unit, const RowParameters& law,
                                              const ContactPotential& potential, Vec3 gap) {
  ContactPotential natural = potential;
  natural.compliance = std::max(unit.response, std::numeric_limits<double>::min());
  if (law.compliance > 0.0) gap[0] += law.compliance * unit.impulse[0];
  return unit.response * (natural.natural(gap, unit.impulse) - unit.impulse).norm();
}

/// u⁰: the rows' true gaps at the end of the motion that is predicted, less what they ask for, what is linear in the
/// impulses, and what the springs exert there already.
/// @return how far the impulses are from the rows' law at those gaps, and gaps from those of the last round, by
/// tolerance
AugmentedLagrangian::Distance AugmentedLagrangian::find_starts(const IslandStep& step, bool first_round) {
  Distance distance;
  for (std::size_t u = 0; u < units_.size(); ++u) {
    Unit& unit = units_[u];
    const RowParameters& law = step.law(unit.first);
    Vec3 open = open_gap(step, unit);
    distance.moved = first_round ? kUnbounded : std::max(distance.moved, (open - unit.end).norm() / law.tolerance);
    unit.end = open;
    if (law.friction > 0.0 && !first_round) unit.shift = law.friction * open.tail<2>().norm();
    open[0] += unit.shift;
    const ContactPotential& potential = contacts_.potential(u);
    Vec3 yields = potential.compliance * unit.anchor;
    if (law.compliance > 0.0) yields[0] = 0.0;  // a spring of its own
    unit.moved = contacts_.moved(u);
    distance.from_law = std::max(distance.from_law, distance_from_law(unit, law, potential, open) / law.tolerance);
    contacts_.start(u) = open - yields - unit.moved;
    if (first_round) contacts_.impulse(u) = unit.anchor;
  }
  return distance;
}

/// Less what the rows ask for.
Vec3 AugmentedLagrangian::open_gap(const IslandStep& step, const Unit& unit) {
  Vec3 open = Vec3::Zero();
  for (std::size_t r = 0; r < unit.rows; ++r)
    open[static_cast<int>(r)] =
        step.gap[unit.first + r] - step.law(unit.first + r).offset + indentation_of(step, unit.first + r);
  return open;
}

/// By tolerance, of the impulses at hand from the rows' law at the gaps as they are.
double AugmentedLagrangian::largest_distance(const IslandStep& step) {
  double largest = 0.0;
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const RowParameters& law = step.law(units_[u].first);
    Vec3 open = open_gap(step, units_[u]);
    if (law.friction > 0.0) open[0] += law.friction * open.tail<2>().norm();
    largest = std::max(largest, distance_from_law(units_[u], law, contacts_.potential(u), open) / law.tolerance);
  }
  return largest;
}

/// Springs become stiffer where impulses changed by as much as in the round before, and by more than the law leaves
/// them; beside joints, where secants follow such changes, where springs yielded by that.
void AugmentedLagrangian::stiffen(const IslandStep& step) {
  constexpr const RoundsTuning& tuning = kConstraintsTuning.rounds;
  for (std::size_t u = 0; u < units_.size(); ++u) {
    Unit& unit = units_[u];
    const RowParameters& law = step.law(unit.first);
    if (law.compliance > 0.0) continue;
    double& c = contacts_.potential(u).compliance;
    const double changed = (step.contacts_alone ? unit.response : c) * (contacts_.impulse(u) - unit.anchor).norm();
    if (changed > tuning.slow * unit.changed && changed > law.tolerance)
      c = std::max(tuning.stiffer * c, std::min(c, tuning.stiffest * unit.response));
    unit.changed = changed;
  }
}

/// The impulses of the next round: those found; beside joints with what secants tell of the rounds so far.
void AugmentedLagrangian::advance_units(const IslandStep& step) {
  if (step.contacts_alone) {
    for (std::size_t u = 0; u < units_.size(); ++u) units_[u].impulse = units_[u].anchor = contacts_.impulse(u);
    return;
  }
  for (std::vector<double>* v : {&at_, &next_, &change_}) v->resize(step.size());
  for (std::size_t u = 0; u < units_.size(); ++u) {
    const Unit& unit = units_[u];
    const Vec3 moved = contacts_.moved(u) - unit.moved;
    for (std::size_t r = 0; r < unit.rows; ++r) {
      const auto axis = static_cast<int>(r);
      at_[unit.first + r] = unit.impulse[axis];
      next_[unit.first + r] = contacts_.impulse(u)[axis] - unit.impulse[axis];
      change_[unit.first + r] = moved[axis] / step.law(unit.first).tolerance;
    }
  }
  secants_.advance(at_, next_, change_);
  take_whole(at_);
}

/// Whole impulses by row, those nearest that rows may exert.
void AugmentedLagrangian::take_whole(std::span<const double> impulses) {
  for (std::size_t u = 0; u < units_.size(); ++u) {
    Vec3 whole = Vec3::Zero();
    for (std::size_t r = 0; r < units_[u].rows; ++r) whole[static_cast<int>(r)] = impulses[units_[u].first + r];
    units_[u].impulse = units_[u].anchor = contacts_.potential(u).nearest(whole);
  }
}

/// What the bodies yield beyond their modes, in a row's gap.
double AugmentedLagrangian::indentation_of(const IslandStep& step, std::size_t row) {
  double sum = 0.0;
  step.for_bodies(row, [&](const ConstraintRows::Side&, Index local, bool) {
    const std::span<const double> columns = residual_.row(local, row);
    const std::span<const double> y = contacts_.motion(nodes_[static_cast<std::size_t>(local)]);
    const auto own = static_cast<std::size_t>(step.bodies.response(local).size());
    for (std::size_t k = 0; k < columns.size(); ++k) sum += columns[k] * y[own + k];
  });
  return sum;
}

/// The motion found in place of that under the impulses found, which are not yet in balance with it.
void AugmentedLagrangian::take_motion(IslandStep& step) {
  const IslandBodies& bodies = step.bodies;
  step.loads.clear(bodies);
  for (Index local = 0; local < bodies.count(); ++local) {
    const BodyResponse& r = bodies.response(local);
    const std::span<const double> y = contacts_.motion(nodes_[static_cast<std::size_t>(local)]);
    const double* weight = root_.data() + bodies.first(local);
    ConstraintLoad& load = step.loads.frames[static_cast<std::size_t>(local)];
    double* modal = step.loads.modal(local);
    std::size_t k = 0;
    for (int i = 0; i < r.translations; ++i, ++k) load.impulse[i] += y[k] / weight[k];
    for (int i = 0; i < r.rotations; ++i, ++k) load.moment += y[k] / weight[k] * r.axes.col(i);
    for (int i = 0; i < r.modes; ++i, ++k)
      if (weight[k] > 0.0) modal[i] += y[k] / weight[k];
  }
  step.predict_under_loads();
}

void AugmentedLagrangian::write_slip(const IslandStep& step, std::span<double> slip) const {
  for (const Unit& unit : units_)
    if (step.law(unit.first).friction > 0.0 && unit.impulse[0] > 0.0) slip[unit.first] = unit.end.tail<2>().norm();
}

}  // namespace limber::internal
