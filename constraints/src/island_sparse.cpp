#include <algorithm>
#include <cmath>

#include "island_step.h"

namespace limber {

/// Whether nothing but contacts acts, each of which may yield by itself, and no body yields to them all.
bool IslandSolver::Impl::is_pile() const {
  return std::ranges::all_of(laws, &RowLaw::contact) &&
         std::ranges::all_of(flexibility, [](const ConstraintRows::Flexibility& g) { return g.body < 0; });
}

/// Whether blocks are worth it: an elimination in them by bodies, whose contacts may yield to each other, against one
/// by rows. Linear programs need A in full, and impacts that hold their forces the answer to gravity by itself.
bool IslandSolver::Impl::is_large() {
  constexpr Index kMostDenseRows = 150;
  const auto m = static_cast<double>(rows.size());
  return rows.size() > kMostDenseRows && !rule.is_program() && rule.friction == FrictionModel::kCone &&
         std::ranges::none_of(laws, &RowLaw::strikes) &&
         std::ranges::any_of(laws, [](const RowLaw& law) { return !is_equality(law); }) &&
         work_in_blocks() < m * m * m / 3.0;
}

/// Whether the contacts of an island of few rows are solved for in blocks, as short loops over these are slower by the
/// number multiplied.
bool IslandSolver::Impl::blocks_pay() {
  constexpr double kWorthIt = 0.05;
  const auto m = static_cast<double>(order.size());
  return cones > 0 && bounded.size() == order.size() && !by_program() && work_in_blocks() < kWorthIt * m * m * m / 3.0;
}

/// Numbers multiplied where each body, with what its contacts yield to each other by, is eliminated against one other.
double IslandSolver::Impl::work_in_blocks() {
  widths.clear();
  for (Index local = 0; local < bodies.count(); ++local) widths.push_back(bodies.response(local).size());
  for (const ConstraintRows::Flexibility& g : flexibility)
    if (g.i == g.j && g.body >= 0) ++widths[static_cast<std::size_t>(bodies.local(g.body))];
  double work = 0.0;
  for (const double width : widths) work += 3.0 * width * width * width;
  return work;
}

std::size_t IslandSolver::Impl::node_width(Index local, bool frames_alone) const {
  const BodyResponse& r = bodies.response(local);
  if (frames_alone) return static_cast<std::size_t>(r.translations + r.rotations);
  return static_cast<std::size_t>(r.size()) + residual.rank(local);
}

/// The rows in the order of `order`, three of a cone as one unit; for the frames alone row by row.
void IslandSolver::Impl::place_coupling(SparseCoupling& into, bool frames_alone) {
  if (!frames_alone) residual.set(bodies, flexibility, place, order.size(), step);
  into.begin_structure();
  nodes.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    nodes.push_back(into.add_node(node_width(local, frames_alone)));
  const std::size_t m = frames_alone ? f.size() : order.size();
  for (std::size_t i = 0, count = 1; i < m; i += count) {
    count = !frames_alone && i < 3 * cones ? 3 : 1;
    into.add_unit(count);
    const ConstraintRows::Row& row = rows.row(frames_alone ? static_cast<Index>(i) : order[i]);
    Index last = -1;
    for (const ConstraintRows::Side& side : row.sides) {
      const Index local = bodies.local(side.body);
      if (local < 0 || local == last || node_width(local, frames_alone) == 0) continue;
      into.add_side(nodes[static_cast<std::size_t>(local)]);
      last = local;
    }
  }
  into.end_structure();
}

/// D^½
void IslandSolver::Impl::take_roots() {
  weighted.resize(metric.size());
  for (std::size_t i = 0; i < metric.size(); ++i) weighted[i] = std::sqrt(metric[i]);
}

/// Adds one side of a row of J D^½: the first of its degrees of freedom, the frame's before the modes.
void IslandSolver::Impl::add_weighted(const ConstraintRows::Side& side, Index local, std::size_t count, double* to) {
  const BodyResponse& r = bodies.response(local);
  one_row.assign(static_cast<std::size_t>(r.size()), 0.0);
  r.add_row(side.linear, side.angular, rows.modal(side), one_row.data());
  const double* root = weighted.data() + bodies.first(local);
  for (std::size_t k = 0; k < count; ++k) to[k] += one_row[k] * root[k];
}

/// J D^½, then the columns of what bodies yield beyond their modes; and what rows yield by themselves.
void IslandSolver::Impl::fill_coupling(SparseCoupling& into, bool frames_alone) {
  const std::size_t m = frames_alone ? f.size() : order.size();
  take_roots();
  into.clear_values();
  std::size_t next = 0;
  for (std::size_t i = 0, count = 1; i < m; i += count) {
    count = !frames_alone && i < 3 * cones ? 3 : 1;
    std::size_t most = 0;
    for (std::size_t r = 0; r < count; ++r) {
      const ConstraintRows::Row& row = rows.row(frames_alone ? static_cast<Index>(i + r) : order[i + r]);
      std::size_t sides = 0;
      Index last = -1;
      for (const ConstraintRows::Side& side : row.sides) {
        const Index local = bodies.local(side.body);
        const std::size_t width = local < 0 ? 0 : node_width(local, frames_alone);
        if (width == 0) continue;
        if (local != last) ++sides;
        last = local;
        double* to = into.values(next + sides - 1).row(r);
        const std::size_t own = frames_alone ? width : static_cast<std::size_t>(bodies.response(local).size());
        add_weighted(side, local, own, to);
        if (!frames_alone) std::ranges::copy(residual.row(local, i + r), to + own);
      }
      if (!frames_alone) into.compliance(i + r) = row.law.compliance;
      most = std::max(most, sides);
    }
    next += most;
  }
  for (const ConstraintRows::Flexibility& g : flexibility)
    if (const Index at = frames_alone || g.body >= 0 ? Index{-1} : place[static_cast<std::size_t>(g.i)]; at >= 0)
      into.compliance(static_cast<std::size_t>(at)) += g.value / step;
}

}  // namespace limber
