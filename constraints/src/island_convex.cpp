#include <algorithm>
#include <cmath>

#include "island_step.h"

namespace limber {
namespace {

// Of what an impulse moves its own contact by within the step, what the contact yields to it by.
constexpr double kRegularisation = 1e-3;

internal::ContactPotential potential_of(const RowLaw& law) {
  using Set = internal::ContactPotential::Set;
  if (law.radius > 0.0) return {.set = Set::kBall, .bound = law.radius};
  if (law.friction > 0.0) return {.set = Set::kCone, .bound = law.friction};
  return {.set = Set::kInterval, .lower = law.lower, .upper = law.upper};
}

}  // namespace

/// The contacts of a large island of nothing else: one convex problem, linear in the free motion of the step.
SolveStatus IslandSolver::Impl::solve_convex(const BodyStates& states, std::span<Constraint* const> constraints,
                                             const IslandOptions& options, IslandReport& report) {
  constexpr internal::ConvexContactOptions kOptions{};
  bodies.write_position_metric(step, theta, metric);
  predict(options);  // without contacts
  place_contacts();
  fill_contacts();
  fill_free_motion();
  start_contacts();
  internal::ConvexContactReport done = contacts.solve(kOptions);
  report.newton_steps = done.iterations;
  while (done.status == SolveStatus::kSolved && stiffen_pressed()) {
    done = contacts.solve_on({.max_iterations = kOptions.max_iterations - report.newton_steps});
    report.newton_steps += done.iterations;
  }
  report.iterations = 1;
  report.change = done.residual / kOptions.tolerance;
  for (std::size_t u = 0; u < contacts.units(); ++u) {
    const std::size_t first = unit_rows[u];
    const auto count = static_cast<std::size_t>(contact_rows(laws[first]));
    const Vec3& impulse = contacts.impulse(u);
    const double c = contacts.potential(u).compliance;
    for (std::size_t r = 0; r < count; ++r) {
      f[first + r] = impulse[static_cast<int>(r)];
      give[first + r] = c * step;
    }
    // The spring's own part of the slip comes back; the rest is gone.
    if (count == 3 && impulse[0] > 0.0) slip[first] = (contacts.end(u) + c * impulse).tail<2>().norm();
  }
  std::erase_if(flexibility, [](const ConstraintRows::Flexibility& g) { return g.body < 0; });
  for (std::size_t i = 0; i < give.size(); ++i)
    flexibility.push_back({static_cast<Index>(i), static_cast<Index>(i), give[i], -1});
  if (done.status == SolveStatus::kSolved)
    predict(options);
  else
    take_motion(options);
  measure(states, StepTime::kEnd, constraints, gap);
  return done.status;
}

/// Each contact a unit of its rows.
void IslandSolver::Impl::place_contacts() {
  contacts.begin_structure();
  nodes.clear(), unit_rows.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    nodes.push_back(contacts.add_node(static_cast<std::size_t>(bodies.response(local).size())));
  for (std::size_t i = 0, count = 1; i < f.size(); i += count) {
    count = static_cast<std::size_t>(contact_rows(laws[i]));
    contacts.add_unit(count, potential_of(laws[i]));
    unit_rows.push_back(i);
    Index last = -1;
    for (const ConstraintRows::Side& side : rows.row(static_cast<Index>(i)).sides) {
      const Index local = bodies.local(side.body);
      if (local >= 0 && local != last) contacts.add_side(nodes[static_cast<std::size_t>(local)]);
      last = local;
    }
  }
  contacts.end_structure();
}

/// J D^½
void IslandSolver::Impl::fill_contacts() {
  take_roots();
  std::size_t next_side = 0;
  for (const std::size_t first : unit_rows) {
    std::size_t sides = 0;
    for (Index r = 0; r < contact_rows(laws[first]); ++r) {
      sides = 0;
      Index last = -1;
      for (const ConstraintRows::Side& side : rows.row(static_cast<Index>(first) + r).sides) {
        const Index local = bodies.local(side.body);
        if (local < 0) continue;
        sides += local != last ? 1 : 0;
        last = local;
        add_weighted(side, local, static_cast<std::size_t>(bodies.response(local).size()),
                     contacts.values(next_side + sides - 1).row(static_cast<std::size_t>(r)));
      }
    }
    next_side += sides;
  }
}

/// How the bodies move without contacts, as they are predicted: D^−½ of it, by degree of freedom.
void IslandSolver::Impl::fill_free_motion() {
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
    const double* weight = weighted.data() + bodies.first(local);
    for (k = 0; k < y.size(); ++k) y[k] = weight[k] > 0.0 ? y[k] / weight[k] : 0.0;
  }
}

/// u⁰: where the free motion takes each contact, less what it asks for; compliances; last impulses.
void IslandSolver::Impl::start_contacts() {
  give.assign(f.size(), 0.0), slip.assign(f.size(), 0.0);
  for (const ConstraintRows::Flexibility& g : flexibility)
    if (g.body < 0) give[static_cast<std::size_t>(g.i)] = g.value;
  for (std::size_t u = 0; u < contacts.units(); ++u) {
    const std::size_t first = unit_rows[u];
    const RowLaw& law = laws[first];
    Vec3 start = contacts.moved_freely(u), impulse = Vec3::Zero();
    for (int r = 0; r < contact_rows(law); ++r) {
      const RowLaw& own = laws[first + static_cast<std::size_t>(r)];
      start[r] += own.start_gap - own.offset;
      impulse[r] = step * own.last_force;
    }
    start[0] += law.shift;
    const Vec3 response = contacts.response(u);
    double compliance = kRegularisation * (law.radius > 0.0 ? response.mean() : response[0]);
    if (law.largest_yield > 0.0 && compliance * impulse[0] > law.largest_yield)
      compliance = law.largest_yield / impulse[0];
    contacts.potential(u).compliance = std::max(give[first] / step, compliance);
    contacts.start(u) = start, contacts.impulse(u) = impulse;
  }
}

/// Contacts that a load presses in farther than it may are made stiffer. @return whether there are any
bool IslandSolver::Impl::stiffen_pressed() {
  constexpr double kTooFar = 1.5;
  bool any = false;
  for (std::size_t u = 0; u < contacts.units(); ++u) {
    const RowLaw& law = laws[unit_rows[u]];
    double& c = contacts.potential(u).compliance;
    const double pressed = contacts.impulse(u)[0];
    if (!(law.largest_yield > 0.0) || c * pressed <= kTooFar * law.largest_yield) continue;
    c = law.largest_yield / pressed;
    any = true;
  }
  return any;
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
