#include <algorithm>

#include "island_step.h"

namespace limber {
namespace {

bool in_cone(const RowLaw& law) { return law.slides || law.friction > 0.0; }

}  // namespace

/// Which rows have bounds, cones first, and what is left of the bounds, which are on the whole impulse.
void IslandSolver::Impl::sort_rows() {
  bounded.clear();
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = laws[at];
    const double held = step * reaction[at];
    lower[at] = law.lower - held, upper[at] = law.upper - held;
    compliance[at] = law.compliance;
    if (in_cone(law)) bounded.push_back(i);
  }
  cones = bounded.size() / 3;
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if (!is_equality(laws[at]) && !in_cone(laws[at])) bounded.push_back(i);
  }
}

/// Equality rows first, then those with bounds.
void IslandSolver::Impl::order_rows() {
  order.clear();
  for (Index i = 0; i < rows.size(); ++i)
    if (is_equality(laws[static_cast<std::size_t>(i)])) order.push_back(i);
  order.insert(order.end(), bounded.begin(), bounded.end());
  place.assign(f.size(), -1);
  for (std::size_t i = 0; i < order.size(); ++i) place[static_cast<std::size_t>(order[i])] = static_cast<Index>(i);
}

}  // namespace limber
