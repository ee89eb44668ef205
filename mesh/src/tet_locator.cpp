#include "limber/mesh/tet_locator.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "limber/core/error.h"

namespace limber {
namespace {

// Barycentric weights down to minus this count as inside: round-off in them is of the order of 1e-16 over the tet's
// relative height, and validate() lets flat tets pass down to 1e-12.
constexpr double kInside = 1e-10;
// Distances that differ by less, relative to themselves, are equal.
constexpr double kSameDistance = 1e-9;
constexpr std::size_t kLeafSize = 2;

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

/// Weights of the point of triangle abc nearest to p: the Voronoi regions of its corners and edges in turn
/// (Ericson, Real-Time Collision Detection, section 5.1.5).
std::array<double, 3> nearest_on_triangle(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& p) {
  const Vec3 ab = b - a, ac = c - a;
  const double d1 = ab.dot(p - a), d2 = ac.dot(p - a);
  if (d1 <= 0.0 && d2 <= 0.0) return {1, 0, 0};
  const double d3 = ab.dot(p - b), d4 = ac.dot(p - b);
  if (d3 >= 0.0 && d4 <= d3) return {0, 1, 0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    const double s = d1 / (d1 - d3);
    return {1 - s, s, 0};
  }
  const double d5 = ab.dot(p - c), d6 = ac.dot(p - c);
  if (d6 >= 0.0 && d5 <= d6) return {0, 0, 1};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    const double s = d2 / (d2 - d6);
    return {1 - s, 0, s};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double s = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - s, s};
  }
  const double v = vb / (va + vb + vc), w = vc / (va + vb + vc);
  return {1 - v - w, v, w};
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
    const auto [wa, wb, wc] = nearest_on_triangle(x[a], x[b], x[c], p);
    const double squared = (wa * x[a] + wb * x[b] + wc * x[c] - p).squaredNorm();
    if (squared >= best.squared_distance) continue;
    best.squared_distance = squared;
    best.weight = {};
    best.weight[a] = wa, best.weight[b] = wb, best.weight[c] = wc;
  }
  return best;
}

double largest(const Weights& w) { return std::max({std::abs(w[0]), std::abs(w[1]), std::abs(w[2]), std::abs(w[3])}); }

struct Box {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  void extend(const Vec3& p) { low = low.cwiseMin(p), high = high.cwiseMax(p); }
  double squared_distance(const Vec3& p) const {
    return (low - p).cwiseMax(p - high).cwiseMax(Vec3::Zero()).squaredNorm();
  }
};

}  // namespace

/// Nodes in depth-first order: an inner node's first child follows it.
struct TetLocator::Tree {
  struct Node {
    Box box;
    Index second_child = 0;      ///< inner nodes
    Index first = 0, count = 0;  ///< leaves: their tets; count 0 for inner nodes
  };
  std::vector<Node> nodes;
  std::vector<Corners> corners;  ///< in the order of the leaves
  std::vector<Index> tet;        ///< which each is in the mesh

  void build(const std::vector<Corners>& all, std::span<Index> part, Index first) {
    const auto self = nodes.size();
    nodes.emplace_back();
    Box box, centers;
    for (const Index t : part) {
      for (const Vec3& x : all[t]) box.extend(x);
      centers.extend(all[t][0] + all[t][1] + all[t][2] + all[t][3]);
    }
    nodes[self].box = box;
    if (part.size() <= kLeafSize) {
      nodes[self].first = first;
      nodes[self].count = static_cast<Index>(part.size());
      return;
    }
    int axis = 0;
    (centers.high - centers.low).maxCoeff(&axis);
    const std::size_t half = part.size() / 2;
    const auto center = [&](Index t) { return all[t][0][axis] + all[t][1][axis] + all[t][2][axis] + all[t][3][axis]; };
    std::nth_element(part.begin(), part.begin() + static_cast<std::ptrdiff_t>(half), part.end(),
                     [&](Index a, Index b) { return std::pair(center(a), a) < std::pair(center(b), b); });
    build(all, part.first(half), first);
    nodes[self].second_child = static_cast<Index>(nodes.size());
    build(all, part.subspan(half), first + static_cast<Index>(half));
  }

  /// Calls visit(i) for the tets of leaves whose boxes lie within sqrt(bound()) of p, nearer boxes first.
  template <class Bound, class Visit>
  void search(const Vec3& p, const Bound& bound, const Visit& visit) const {
    struct Waiting {
      Index node;
      double squared_distance;
    };
    std::array<Waiting, 64> stack;  // a halving tree over 2³¹ tets is 31 deep
    std::size_t size = 0;
    stack[size++] = {0, nodes[0].box.squared_distance(p)};
    while (size > 0) {
      const Waiting w = stack[--size];
      if (w.squared_distance > bound()) continue;
      const Node& node = nodes[w.node];
      for (Index i = node.first; i < node.first + node.count; ++i) visit(i);
      if (node.count > 0) continue;
      Waiting near{w.node + 1, nodes[w.node + 1].box.squared_distance(p)};
      Waiting far{node.second_child, nodes[node.second_child].box.squared_distance(p)};
      if (far.squared_distance < near.squared_distance) std::swap(near, far);
      stack[size++] = far;
      stack[size++] = near;
    }
  }
};

TetLocator::TetLocator(const TetMesh& mesh) {
  if (mesh.tets.empty()) throw InvalidArgument("TetLocator: the mesh has no tetrahedra");
  std::vector<Corners> all;
  all.reserve(mesh.tets.size());
  for (const Tet& t : mesh.tets)
    all.push_back({mesh.nodes[t[0]], mesh.nodes[t[1]], mesh.nodes[t[2]], mesh.nodes[t[3]]});
  auto tree = std::make_unique<Tree>();
  tree->tet.resize(all.size());
  std::iota(tree->tet.begin(), tree->tet.end(), Index{0});
  tree->build(all, tree->tet, 0);
  tree->corners.reserve(all.size());
  for (const Index t : tree->tet) tree->corners.push_back(all[t]);
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
  tree.search(p, bound, [&](Index i) {
    const Weights w = barycentric(tree.corners[i], p);
    if (*std::min_element(w.begin(), w.end()) >= -kInside) {
      if (!inside || tree.tet[i] < found.tet) found = {tree.tet[i], 0.0, w, w};
      inside = true;
      return;
    }
    if (inside) return;
    const Nearest n = nearest_on_tet(tree.corners[i], w, p);
    if (n.squared_distance > bound()) return;
    const double weight = largest(w);
    const bool as_near = n.squared_distance >= least * (1.0 - kSameDistance);
    least = std::min(least, n.squared_distance);
    if (as_near && std::pair(weight, tree.tet[i]) > std::pair(smallest_weight, found.tet)) return;
    smallest_weight = weight;
    found = {tree.tet[i], std::sqrt(n.squared_distance), w, n.weight};
  });
  return found;
}

}  // namespace limber
