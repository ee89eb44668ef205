#include "types/mechanism.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tuning.h"
#include "types/bridges.h"
#include "types/other_hypotheses.h"

namespace limber::internal {
namespace {

/// Flat contacts that alone lead from one of their parts to the other.
std::vector<PairOfParts*> flat_bridges(const Assembly& assembly, std::vector<PairOfParts>& pairs) {
  std::vector<std::pair<Index, Index>> edges;
  for (const PairOfParts& pair : pairs) edges.emplace_back(pair.a(), pair.b());
  const std::vector<bool> is_bridge = find_bridges(static_cast<Index>(assembly.components.size()), edges);
  std::vector<PairOfParts*> out;
  for (std::size_t p = 0; p < pairs.size(); ++p)
    if (is_bridge[p] && pairs[p].is_flat()) out.push_back(&pairs[p]);
  return out;
}

Vec3 normal_of(const PairOfParts& flat) { return flat.slippage.hypotheses.front().joint.frame.axes.col(2); }

}  // namespace

void explain_flanges(const Assembly& assembly, std::vector<PairOfParts>& pairs) {
  const std::vector<PairOfParts*> flat = flat_bridges(assembly, pairs);
  const auto look_one_way = [](const PairOfParts* x, const PairOfParts* y) {
    return std::abs(normal_of(*x).dot(normal_of(*y))) >= tuning().types.line.one_way;
  };
  const auto looks_as_all = [&](const PairOfParts* x) {
    return std::all_of(flat.begin(), flat.end(), [&](const PairOfParts* y) { return look_one_way(x, y); });
  };
  if (std::all_of(flat.begin(), flat.end(), looks_as_all)) return;
  for (PairOfParts* pair : flat) prefer_turn(pair->slippage);
}

}  // namespace limber::internal
