#include <algorithm>
#include <cmath>

#include "island_step.h"

namespace limber {

/// Whether blocks are worth it; linear programs need A in full.
bool IslandSolver::Impl::is_large() const {
  constexpr Index kMostDenseRows = 150;
  return rows.size() > kMostDenseRows && flexibility.empty() && !rule.is_program() &&
         rule.friction == FrictionModel::kCone &&
         std::ranges::any_of(laws, [](const RowLaw& law) { return !is_equality(law); });
}

std::size_t IslandSolver::Impl::node_width(Index local, bool frames_alone) const {
  const BodyResponse& r = bodies.response(local);
  return static_cast<std::size_t>(frames_alone ? r.translations + r.rotations : r.size());
}

/// The rows in the order of `order`, three of a cone as one unit; for the frames alone row by row.
void IslandSolver::Impl::place_coupling(SparseCoupling& into, bool frames_alone) {
  into.begin_structure();
  nodes.clear();
  for (Index local = 0; local < bodies.count(); ++local)
    nodes.push_back(into.add_node(node_width(local, frames_alone)));
  const std::size_t m = f.size();
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
    if (!frames_alone && row.law.compliance > 0.0) into.add_side(into.add_node(1));
  }
  into.end_structure();
}

/// J D^½, and a column for each compliance.
void IslandSolver::Impl::fill_coupling(SparseCoupling& into, bool frames_alone) {
  const std::size_t m = f.size();
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
        one_row.assign(static_cast<std::size_t>(bodies.response(local).size()), 0.0);
        bodies.response(local).add_row(side.linear, side.angular, rows.modal(side), one_row.data());
        const double* weight = metric.data() + bodies.first(local);
        for (std::size_t k = 0; k < width; ++k) to[k] += one_row[k] * std::sqrt(weight[k]);
      }
      if (!frames_alone && row.law.compliance > 0.0)
        into.values(next + sides++).row(r)[0] = std::sqrt(row.law.compliance);
      most = std::max(most, sides);
    }
    next += most;
  }
}

}  // namespace limber
