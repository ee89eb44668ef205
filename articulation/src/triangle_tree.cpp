#include "triangle_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace limber {
namespace {

constexpr Index kLeaf = 4;  // triangles

double squared_distance(const Eigen::AlignedBox3d& box, const Vec3& p) { return box.squaredExteriorDistance(p); }

}  // namespace

Vec3 nearest_on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  // Which of the triangle's seven regions (corners, edges, inside) p projects to.
  const Vec3 ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0.0 && d2 <= 0.0) return {1.0, 0.0, 0.0};
  const Vec3 bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0.0 && d4 <= d3) return {0.0, 1.0, 0.0};
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
    const double t = d1 == d3 ? 0.0 : d1 / (d1 - d3);
    return {1.0 - t, t, 0.0};
  }
  const Vec3 cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0.0 && d5 <= d6) return {0.0, 0.0, 1.0};
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
    const double t = d2 == d6 ? 0.0 : d2 / (d2 - d6);
    return {1.0 - t, 0.0, t};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
    const double sum = (d4 - d3) + (d5 - d6), t = sum == 0.0 ? 0.0 : (d4 - d3) / sum;
    return {0.0, 1.0 - t, t};
  }
  const double sum = va + vb + vc;
  return {va / sum, vb / sum, vc / sum};
}

TriangleTree::TriangleTree(const SurfaceMesh& surface) : surface_(surface), order_(surface.triangles.size()) {
  std::iota(order_.begin(), order_.end(), Index{0});
  std::vector<Vec3> centres;
  centres.reserve(order_.size());
  normals_.reserve(order_.size());
  for (std::size_t t = 0; t < order_.size(); ++t) {
    const auto [a, b, c] = corners(static_cast<Index>(t));
    centres.push_back((a + b + c) / 3.0);
    normals_.push_back((b - a).cross(c - a).stableNormalized());
  }
  nodes_.emplace_back();
  split(0, 0, static_cast<Index>(order_.size()), centres);
}

std::array<Vec3, 3> TriangleTree::corners(Index triangle) const {
  const Triangle& t = surface_.triangles[static_cast<std::size_t>(triangle)];
  const auto at = [&](int k) -> const Vec3& { return surface_.vertices[static_cast<std::size_t>(t[k])]; };
  return {at(0), at(1), at(2)};
}

void TriangleTree::split(Index node, Index begin, Index end, const std::vector<Vec3>& centres) {
  Eigen::AlignedBox3d box, middle;
  for (Index i = begin; i < end; ++i) {
    for (const Vec3& p : corners(order_[static_cast<std::size_t>(i)])) box.extend(p);
    middle.extend(centres[static_cast<std::size_t>(order_[static_cast<std::size_t>(i)])]);
  }
  nodes_[static_cast<std::size_t>(node)].box = box;
  if (end - begin <= kLeaf) {
    nodes_[static_cast<std::size_t>(node)].first = begin;
    nodes_[static_cast<std::size_t>(node)].count = end - begin;
    return;
  }
  int axis = 0;
  middle.sizes().maxCoeff(&axis);
  const Index half = begin + (end - begin) / 2;
  std::nth_element(order_.begin() + begin, order_.begin() + half, order_.begin() + end, [&](Index i, Index j) {
    const double x = centres[static_cast<std::size_t>(i)][axis], y = centres[static_cast<std::size_t>(j)][axis];
    return x < y || (x == y && i < j);
  });
  const auto left = static_cast<Index>(nodes_.size());
  nodes_[static_cast<std::size_t>(node)].first = left;
  nodes_.emplace_back();
  nodes_.emplace_back();
  split(left, begin, half, centres);
  split(left + 1, half, end, centres);
}

TriangleTree::Nearest TriangleTree::nearest(const Vec3& p, double limit, const Vec3& direction, double cosine) const {
  Nearest best;
  double best_squared = limit * limit;
  struct Entry {
    Index node;
    double squared;
  };
  std::array<Entry, 128> stack;  // a tree over 2³¹ triangles is 31 deep and leaves one entry a level
  int size = 0;
  stack[size++] = {0, squared_distance(nodes_[0].box, p)};
  while (size > 0) {
    const auto [index, squared] = stack[--size];
    if (squared > best_squared) continue;
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.count > 0) {
      for (Index i = node.first; i < node.first + node.count; ++i) {
        const Index t = order_[static_cast<std::size_t>(i)];
        if (normal(t).dot(direction) > cosine) continue;
        const auto [a, b, c] = corners(t);
        const Vec3 weights = nearest_on_triangle(p, a, b, c);
        const Vec3 q = weights[0] * a + weights[1] * b + weights[2] * c;
        const double d = (q - p).squaredNorm();
        if (d < best_squared || (d <= best_squared && !best.found())) {
          best_squared = d;
          best = {t, q, weights, 0.0};
        }
      }
      continue;
    }
    const double left = squared_distance(nodes_[static_cast<std::size_t>(node.first)].box, p);
    const double right = squared_distance(nodes_[static_cast<std::size_t>(node.first) + 1].box, p);
    const bool left_first = left <= right;  // the nearer is looked at first: it goes on the stack last
    stack[size++] = left_first ? Entry{node.first + 1, right} : Entry{node.first, left};
    stack[size++] = left_first ? Entry{node.first, left} : Entry{node.first + 1, right};
  }
  best.distance = std::sqrt(best_squared);
  return best;
}

template <class Hit>
bool TriangleTree::cast(const Vec3& p, const Vec3& direction, double longest, Hit&& hit) const {
  const Eigen::Array3d inverse = direction.array().inverse();
  std::array<Index, 128> stack;
  int size = 0;
  stack[size++] = 0;
  while (size > 0) {
    const Node& node = nodes_[static_cast<std::size_t>(stack[--size])];
    // A zero times an infinite inverse is not a number, which min and max pass over in favour of the other.
    double in = 0.0, out = longest;
    for (int k = 0; k < 3; ++k) {
      const double t0 = (node.box.min()[k] - p[k]) * inverse[k], t1 = (node.box.max()[k] - p[k]) * inverse[k];
      in = std::max(in, std::min(t0, t1));
      out = std::min(out, std::max(t0, t1));
    }
    if (out < in) continue;
    if (node.count == 0) {
      stack[size++] = node.first;
      stack[size++] = node.first + 1;
      continue;
    }
    for (Index i = node.first; i < node.first + node.count; ++i) {
      const auto [a, b, c] = corners(order_[static_cast<std::size_t>(i)]);
      const Vec3 ab = b - a, ac = c - a, h = direction.cross(ac);
      const double det = ab.dot(h);
      if (det == 0.0) continue;
      const Vec3 s = p - a, q = s.cross(ab);
      const double u = s.dot(h) / det, v = direction.dot(q) / det, t = ac.dot(q) / det;
      if (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= longest && hit(det < 0.0)) return true;
    }
  }
  return false;
}

int TriangleTree::winding(const Vec3& p) const {
  // An odd direction hits no edge of a drawn shape.
  static const Vec3 kRay = Vec3(0.5377, 0.3129, 0.7829).normalized();
  int count = 0;
  cast(p, kRay, std::numeric_limits<double>::infinity(), [&](bool leaving) {
    count += leaving ? 1 : -1;
    return false;
  });
  return count;
}

bool TriangleTree::crosses(const Vec3& p, const Vec3& q) const {
  return cast(p, q - p, 1.0, [](bool) { return true; });
}

}  // namespace limber
