#include "parts/soup.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <span>

#include "limber/core/disjoint_sets.h"
#include "limber/mesh/mend_surface.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// One triangle at an edge.
struct SoupSide {
  Index low, high;  ///< the edge's vertices
  bool forward;     ///< whether the triangle runs from low to high
  Index triangle;
  Vec3 into;    ///< unit, in the triangle's plane, away from the edge
  Vec3 normal;  ///< outward, unit
};

std::vector<SoupSide> sides_of(const SurfaceMesh& surface) {
  std::vector<SoupSide> sides;
  for (std::size_t t = 0; t < surface.triangles.size(); ++t)
    for (std::size_t a = 0; a < 3; ++a) {
      const auto at = [&](std::size_t k) { return surface.triangles[t][(a + k) % 3]; };
      const Index i = at(0), j = at(1);
      if (i == j) continue;
      const Vec3 &p = surface.vertices[static_cast<std::size_t>(i)], &q = surface.vertices[static_cast<std::size_t>(j)],
                 &r = surface.vertices[static_cast<std::size_t>(at(2))];
      const Vec3 edge = (q - p).normalized();
      const Vec3 into = ((r - p) - edge * edge.dot(r - p)).normalized();
      sides.push_back({std::min(i, j), std::max(i, j), i < j, static_cast<Index>(t), into, edge.cross(into)});
    }
  std::stable_sort(sides.begin(), sides.end(), [](const SoupSide& a, const SoupSide& b) {
    return std::pair(a.low, a.high) < std::pair(b.low, b.high);
  });
  return sides;
}

/// The angle of the material between two triangles at an edge, 0 … 2π.
double material_angle(const SoupSide& from, const SoupSide& to) {
  const double angle = std::atan2(-to.into.dot(from.normal), to.into.dot(from.into));
  return angle < 0.0 ? angle + 2.0 * std::numbers::pi : angle;
}

/// Pairs the triangles at one edge so that each pair bounds the least wedge of material.
void join_at_edge(std::span<const SoupSide> sides, DisjointSets& sets) {
  struct Pair {
    double angle;
    std::size_t i, j;
  };
  const double fold = tuning().parts.soup_fold;
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < sides.size(); ++i)
    for (std::size_t j = i + 1; j < sides.size(); ++j) {
      const double angle = material_angle(sides[i], sides[j]);
      const bool folded = angle < fold || angle > 2.0 * std::numbers::pi - fold;
      if (sides[i].forward != sides[j].forward && !folded) pairs.push_back({angle, i, j});
    }
  std::stable_sort(pairs.begin(), pairs.end(), [](const Pair& a, const Pair& b) { return a.angle < b.angle; });
  std::vector<char> taken(sides.size(), 0);
  for (const Pair& p : pairs) {
    if (taken[p.i] || taken[p.j]) continue;
    taken[p.i] = taken[p.j] = 1;
    sets.join(sides[p.i].triangle, sides[p.j].triangle);
  }
}

}  // namespace

std::vector<Index> shells_of_soup(SurfaceMesh surface, double tolerance) {
  weld_within(surface, tolerance);
  const auto sides = sides_of(surface);
  DisjointSets sets(surface.triangles.size());
  for (std::size_t i = 0; i < sides.size();) {
    std::size_t j = i + 1;
    while (j < sides.size() && sides[j].low == sides[i].low && sides[j].high == sides[i].high) ++j;
    join_at_edge(std::span(sides).subspan(i, j - i), sets);
    i = j;
  }
  return sets.labels();
}

void propose_by_open_edges(Assembly& assembly) {
  // Open edges of every component by position, as bits of their end points.
  using Key = std::array<double, 6>;
  std::map<Key, std::vector<Index>> at;
  std::vector<Index> open_count(assembly.components.size(), 0);
  for (std::size_t c = 0; c < assembly.components.size(); ++c) {
    const Component& component = assembly.components[c];
    if (component.closed && component.caps.empty()) continue;
    std::map<std::pair<Index, Index>, int> uses;
    for (const Triangle& t : component.surface.triangles)
      for (int a = 0; a < 3; ++a) ++uses[std::minmax({t[a], t[(a + 1) % 3]})];
    for (const auto& [edge, count] : uses) {
      if (count != 1) continue;
      const Vec3 &p = component.surface.vertices[static_cast<std::size_t>(edge.first)],
                 &q = component.surface.vertices[static_cast<std::size_t>(edge.second)];
      Key forth = {p[0], p[1], p[2], q[0], q[1], q[2]}, back = {q[0], q[1], q[2], p[0], p[1], p[2]};
      at[std::min(forth, back)].push_back(static_cast<Index>(c));
      ++open_count[c];
    }
  }
  std::map<std::pair<Index, Index>, Index> shared;
  for (const auto& [key, owners] : at)
    if (owners.size() == 2 && owners[0] != owners[1]) ++shared[std::minmax(owners[0], owners[1])];
  for (const auto& [pair, count] : shared)
    if (2 * count >=
        std::min(open_count[static_cast<std::size_t>(pair.first)], open_count[static_cast<std::size_t>(pair.second)]))
      assembly.proposals.push_back(
          {{pair.first, pair.second}, std::to_string(count) + " open edges of the two lie on each other"});
}

}  // namespace limber::internal
