#include "limber/mesh/tet_locator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "limber/core/error.h"
#include "limber/mesh/closest_point.h"
#include "limber/mesh/corner_tree.h"

namespace limber {
namespace {

// Barycentric weights down to minus this count as inside: round-off in them is of the order of 1e-16 over the tet's
// relative height, and validate() lets flat tets pass down to 1e-12.
constexpr double kInside = 1e-10;
// Distances that differ by less, relative to themselves, are equal.
constexpr double kSameDistance = 1e-9;

using Corners = std::array<Vec3, 4>;
using Weights = std::array<double, 4>;

Weights barycentric(const Corners& x, const Vec3& p) {
  const Vec3 e1 = x[1] - x[0], e2 = x[2] - x[0], e3 = x[3] - x[0], d = p - x[0];
  const Vec3 n = e2.cross(e3);
  const double scale = 1.0 / e1.dot(n);
  const Vec3 m = d.cross(e1);
  const double w1 = d.dot(n) * scale, w2 = -m.dot(e3) * scale, w3 = m.dot(e2) * scale;
  return {1.0 - w1 - w2 - w3, w1, w2, w3};
}

struct Nearest {
  Weights weight{};
  double squared_distance = std::numeric_limits<double>::infinity();
};

/// The tet's point nearest to p outside it: on a face that p is on the far side of.
Nearest nearest_on_tet(const Corners& x, const Weights& weight_of_p, const Vec3& p) {
  Nearest best;
  for (int opposite = 0; opposite < 4; ++opposite) {
    if (weight_of_p[opposite] > kInside) continue;
    const int a = (opposite + 1) % 4, b = (opposite + 2) % 4, c = (opposite + 3) % 4;
    const SurfaceFoot foot = closest_on_triangle(p, {x[a], x[b], x[c]});
    const double squared = (foot.point - p).squaredNorm();
    if (squared >= best.squared_distance) continue;
    best.squared_distance = squared;
    best.weight = {};
    best.weight[a] = foot.weight[0], best.weight[b] = foot.weight[1], best.weight[c] = foot.weight[2];
  }
  return best;
}

double largest(const Weights& w) { return std::max({std::abs(w[0]), std::abs(w[1]), std::abs(w[2]), std::abs(w[3])}); }

}  // namespace

struct TetLocator::Tree : CornerTree<4> {};

TetLocator::TetLocator(const TetMesh& mesh) {
  if (mesh.tets.empty()) throw InvalidArgument("TetLocator: the mesh has no tetrahedra");
  std::vector<Corners> all;
  all.reserve(mesh.tets.size());
  for (const Tet& t : mesh.tets)
    all.push_back({mesh.nodes[t[0]], mesh.nodes[t[1]], mesh.nodes[t[2]], mesh.nodes[t[3]]});
  auto tree = std::make_unique<Tree>();
  tree->build(all);
  tree_ = std::move(tree);
}

TetLocator::~TetLocator() = default;
TetLocator::TetLocator(TetLocator&&) noexcept = default;
TetLocator& TetLocator::operator=(TetLocator&&) noexcept = default;

TetLocation TetLocator::locate(const Vec3& p) const {
  const Tree& tree = *tree_;
  TetLocation found;
  bool inside = false;
  double least = std::numeric_limits<double>::infinity();  // squared distance
  double smallest_weight = least;                          // largest weight of `found`, outside
  const auto bound = [&] { return inside ? 0.0 : least * (1.0 + kSameDistance); };
  const auto all_matter = [](std::size_t) { return true; };
  tree.search(p, bound, all_matter, [&](Index i) {
    const Weights w = barycentric(tree.corners(i), p);
    if (*std::min_element(w.begin(), w.end()) >= -kInside) {
      if (!inside || tree.element(i) < found.tet) found = {tree.element(i), 0.0, w, w};
      inside = true;
      return;
    }
    if (inside) return;
    const Nearest n = nearest_on_tet(tree.corners(i), w, p);
    if (n.squared_distance > bound()) return;
    const double weight = largest(w);
    const bool as_near = n.squared_distance >= least * (1.0 - kSameDistance);
    least = std::min(least, n.squared_distance);
    if (as_near && std::pair(weight, tree.element(i)) > std::pair(smallest_weight, found.tet)) return;
    smallest_weight = weight;
    found = {tree.element(i), std::sqrt(n.squared_distance), w, n.weight};
  });
  return found;
}

}  // namespace limber
