#include <algorithm>

#include "island_step.h"

namespace limber {
namespace {

bool in_cone(const RowLaw& law) { return law.slides || law.friction > 0.0 || law.radius > 0.0; }

}  // namespace

/// Whether contacts that do nothing may be left out. Rules other than the complementary one count all of them, and few
/// rows are solved for sooner than gaps are measured once more.
bool IslandSolver::Impl::rows_may_wait() const {
  constexpr std::size_t kFewRows = 150;
  return laws.size() > kFewRows && rule.method == ContactMethod::kComplementary && !by_program();
}

/// Most contacts of bumpy bodies are found ahead and exert nothing in the step. Those that pressed in the last step, or
/// answer to held forces, are solved for; the others wait until the bodies would come through them (wake_rows()). Rows
/// are only added, so that this ends, with what all rows together would have given.
void IslandSolver::Impl::choose_rows() {
  waits.assign(laws.size(), 0);
  waiting = 0;
  if (!rows_may_wait()) return;
  for (std::size_t i = 0, count = 1; i < laws.size(); i += count) {
    count = static_cast<std::size_t>(contact_rows(laws[i]));
    if (!laws[i].contact || laws[i].radius > 0.0) continue;
    bool acts = false;
    for (std::size_t r = i; r < i + count; ++r) acts = acts || laws[r].last_force != 0.0 || reaction[r] != 0.0;
    if (acts) continue;
    std::fill_n(waits.begin() + static_cast<std::ptrdiff_t>(i), count, char{1});
    waiting += count;
  }
}

/// Contacts that wait and that the bodies come through under the impulses at hand, or would if what they lie on were
/// held where they fall freely. @return whether there are any
bool IslandSolver::Impl::wake_rows(const IslandOptions& options) {
  const double near = 0.5 * options.gravity.norm() * step * step;
  const std::size_t before = waiting;
  for (std::size_t i = 0, count = 1; waiting > 0 && i < laws.size(); i += count) {
    count = static_cast<std::size_t>(contact_rows(laws[i]));
    if (waits[i] == 0 || gap[i] - laws[i].offset >= near) continue;
    std::fill_n(waits.begin() + static_cast<std::ptrdiff_t>(i), count, char{0});
    waiting -= count;
  }
  return waiting < before;
}

/// Which rows have bounds, cones first, and what is left of the bounds, which are on the whole impulse.
void IslandSolver::Impl::sort_rows() {
  bounded.clear();
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const RowLaw& law = laws[at];
    const double held = step * reaction[at];
    lower[at] = law.lower - held, upper[at] = law.upper - held;
    compliance[at] = law.compliance;
    if (in_cone(law) && waits[at] == 0) bounded.push_back(i);
  }
  cones = bounded.size() / 3;
  for (Index i = 0; i < rows.size(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    if ((sparse || !is_equality(laws[at])) && !in_cone(laws[at]) && waits[at] == 0) bounded.push_back(i);
  }
}

/// Equality rows first, then those with bounds; no place for those that wait.
void IslandSolver::Impl::order_rows() {
  order.clear();
  for (Index i = 0; i < rows.size(); ++i)
    if (!sparse && is_equality(laws[static_cast<std::size_t>(i)])) order.push_back(i);
  order.insert(order.end(), bounded.begin(), bounded.end());
  place.assign(f.size(), -1);
  for (std::size_t i = 0; i < order.size(); ++i) place[static_cast<std::size_t>(order[i])] = static_cast<Index>(i);
}

}  // namespace limber
