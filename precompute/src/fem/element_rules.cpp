#include "fem/element_rules.h"

#include <utility>

namespace limber::internal {
namespace {

std::vector<Barycentric> four_points() {
  constexpr double kFar = 0.58541019662496845446, kNear = 0.13819660112501051518;  // (5 + 3√5)/20, (5 − √5)/20
  std::vector<Barycentric> points(4, {kNear, kNear, kNear, kNear});
  for (std::size_t q = 0; q < 4; ++q) points[q][q] = kFar;
  return points;
}

/// Of the mass of a ten-node tet in parts of 1/420.
int parts_of_420(std::size_t a, std::size_t b) {
  if (a > b) std::swap(a, b);
  if (b < 4) return a == b ? 6 : 1;
  const auto ends = [](std::size_t edge, std::size_t corner) {
    return static_cast<std::size_t>(kTetEdges[edge - 4][0]) == corner ||
           static_cast<std::size_t>(kTetEdges[edge - 4][1]) == corner;
  };
  if (a < 4) return ends(b, a) ? -4 : -6;
  if (a == b) return 32;
  const bool meet =
      ends(b, static_cast<std::size_t>(kTetEdges[a - 4][0])) || ends(b, static_cast<std::size_t>(kTetEdges[a - 4][1]));
  return meet ? 16 : 8;
}

}  // namespace

const std::vector<Barycentric>& rule_points(std::size_t nodes_per_tet) {
  static const std::vector<Barycentric> kCentroid{{0.25, 0.25, 0.25, 0.25}}, kFour = four_points();
  return nodes_per_tet == 4 ? kCentroid : kFour;
}

double mass_share(std::size_t a, std::size_t b, std::size_t nodes_per_tet) {
  if (nodes_per_tet == 4) return a == b ? 0.1 : 0.05;
  return parts_of_420(a, b) / 420.0;
}

}  // namespace limber::internal
