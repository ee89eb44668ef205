#include "types/mechanism.h"

#include <algorithm>
#include <cmath>

#include "limber/core/disjoint_sets.h"
#include "tuning.h"
#include "types/other_hypotheses.h"

namespace limber::internal {
namespace {

/// Whether nothing but this pair's contact leads from one of its parts to the other.
bool is_bridge(const Assembly& assembly, const std::vector<PairOfParts>& pairs, const PairOfParts& bridge) {
  DisjointSets groups(assembly.components.size());
  for (const PairOfParts& pair : pairs)
    if (&pair != &bridge) groups.join(pair.a(), pair.b());
  return groups.root(bridge.a()) != groups.root(bridge.b());
}

Vec3 normal_of(const PairOfParts& flat) { return flat.slippage.hypotheses.front().joint.frame.axes.col(2); }

}  // namespace

void explain_flanges(const Assembly& assembly, std::vector<PairOfParts>& pairs) {
  std::vector<PairOfParts*> flat;
  for (PairOfParts& pair : pairs)
    if (pair.is_flat() && is_bridge(assembly, pairs, pair)) flat.push_back(&pair);
  const auto looks_another_way = [&](const PairOfParts* pair) {
    return std::abs(normal_of(*pair).dot(normal_of(*flat.front()))) < tuning().types.line.one_way;
  };
  if (std::none_of(flat.begin(), flat.end(), looks_another_way)) return;
  for (PairOfParts* pair : flat) prefer_turn(pair->slippage);
}

}  // namespace limber::internal
