#include "parts/triangle_tree.h"

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

TriangleTree::Placed TriangleTree::placed(const SurfaceMesh& surface, const Triangle& triangle, Index number) {
  const auto corner = [&](int k) -> const Vec3& { return surface.vertices[static_cast<std::size_t>(triangle[k])]; };
  const Vec3 &p = corner(0), &q = corner(1), &r = corner(2);
  return {p, q, r, (q - p).cross(r - p).stableNormalized(), number};
}

TriangleTree::TriangleTree(const SurfaceMesh& surface, std::span<const Triangle> caps) {
  const std::size_t count = surface.triangles.size();
  std::vector<Index> order(count);
  std::iota(order.begin(), order.end(), Index{0});
  std::vector<Placed> all;
  std::vector<Vec3> centres;
  all.reserve(count), centres.reserve(count), normals_.reserve(count);
  for (std::size_t t = 0; t < count; ++t) {
    all.push_back(placed(surface, surface.triangles[t], static_cast<Index>(t)));
    centres.push_back((all.back().a + all.back().b + all.back().c) / 3.0);
    normals_.push_back(all.back().normal);
  }
  nodes_.emplace_back();
  split(0, 0, static_cast<Index>(count), order, all, centres);
  placed_.reserve(count);
  for (const Index t : order) placed_.push_back(all[static_cast<std::size_t>(t)]);
  for (const Triangle& cap : caps) caps_.push_back(placed(surface, cap, -1));
}

void TriangleTree::split(Index node, Index begin, Index end, std::vector<Index>& order,
                         const std::vector<Placed>& placed, const std::vector<Vec3>& centres) {
  Eigen::AlignedBox3d middle;
  Node& own = nodes_[static_cast<std::size_t>(node)];
  for (Index i = begin; i < end; ++i) {
    const auto t = static_cast<std::size_t>(order[static_cast<std::size_t>(i)]);
    own.box.extend(placed[t].a).extend(placed[t].b).extend(placed[t].c);
    own.normals.extend(placed[t].normal);
    middle.extend(centres[t]);
  }
  if (end - begin <= kLeaf) {
    own.first = begin;
    own.count = end - begin;
    return;
  }
  int axis = 0;
  middle.sizes().maxCoeff(&axis);
  const Index half = begin + (end - begin) / 2;
  std::nth_element(order.begin() + begin, order.begin() + half, order.begin() + end, [&](Index i, Index j) {
    const double x = centres[static_cast<std::size_t>(i)][axis], y = centres[static_cast<std::size_t>(j)][axis];
    return x < y || (x == y && i < j);
  });
  const auto left = static_cast<Index>(nodes_.size());
  own.first = left;
  nodes_.emplace_back();
  nodes_.emplace_back();
  split(left, begin, half, order, placed, centres);
  split(left + 1, half, end, order, placed, centres);
}

bool TriangleTree::Node::may_face(const Vec3& direction, double cosine) const {
  double least = 0.0;
  for (int k = 0; k < 3; ++k) least += direction[k] * (direction[k] > 0.0 ? normals.min()[k] : normals.max()[k]);
  constexpr double kRounding = 1e-12;
  return least <= cosine + kRounding;
}

template <class Nearer>
void TriangleTree::search(const Vec3& p, double& squared_limit, const Vec3& direction, double cosine,
                          Nearer&& nearer) const {
  struct Entry {
    Index node;
    double squared;
  };
  std::array<Entry, 128> stack;  // a tree over 2³¹ triangles is 31 deep and leaves one entry a level
  int size = 0;
  const auto visit = [&](Index node, double squared) {
    if (squared <= squared_limit && nodes_[static_cast<std::size_t>(node)].may_face(direction, cosine))
      stack[size++] = {node, squared};
  };
  visit(0, squared_distance(nodes_[0].box, p));
  while (size > 0) {
    const auto [index, squared] = stack[--size];
    if (squared > squared_limit) continue;
    const Node& node = nodes_[static_cast<std::size_t>(index)];
    if (node.count == 0) {
      const double left = squared_distance(nodes_[static_cast<std::size_t>(node.first)].box, p);
      const double right = squared_distance(nodes_[static_cast<std::size_t>(node.first) + 1].box, p);
      const bool left_first = left <= right;  // the nearer is looked at first: it goes on the stack last
      visit(left_first ? node.first + 1 : node.first, left_first ? right : left);
      visit(left_first ? node.first : node.first + 1, left_first ? left : right);
      continue;
    }
    for (Index i = node.first; i < node.first + node.count; ++i) {
      const Placed& t = placed_[static_cast<std::size_t>(i)];
      if (t.normal.dot(direction) > cosine) continue;
      constexpr double kRounding = 1.0 - 1e-9;
      const double above = t.normal.dot(p - t.a);  // of the plane: no point of the triangle is nearer
      if (kRounding * above * above > squared_limit) continue;
      const Vec3 weights = nearest_on_triangle(p, t.a, t.b, t.c);
      const Vec3 q = weights[0] * t.a + weights[1] * t.b + weights[2] * t.c;
      if (!nearer(t, q, weights, (q - p).squaredNorm())) return;
    }
  }
}

TriangleTree::Nearest TriangleTree::nearest(const Vec3& p, double limit, const Vec3& direction, double cosine) const {
  Nearest best;
  double squared_limit = limit * limit;
  search(p, squared_limit, direction, cosine, [&](const Placed& t, const Vec3& q, const Vec3& weights, double squared) {
    if (squared < squared_limit || (squared <= squared_limit && !best.found())) {
      squared_limit = squared;
      best = {t.triangle, q, weights, 0.0};
    }
    return true;
  });
  best.distance = std::sqrt(squared_limit);
  return best;
}

std::optional<double> TriangleTree::some_within(const Vec3& p, double limit, const Vec3& direction,
                                                double cosine) const {
  std::optional<double> found;
  double squared_limit = limit * limit;
  search(p, squared_limit, direction, cosine, [&](const Placed&, const Vec3&, const Vec3&, double squared) {
    if (squared <= squared_limit) found = std::sqrt(squared);
    return !found;
  });
  return found;
}

bool TriangleTree::meets(const Placed& triangle, const Vec3& p, const Vec3& direction, double longest, bool& leaving) {
  const Vec3 &a = triangle.a, ab = triangle.b - a, ac = triangle.c - a, h = direction.cross(ac);
  const double det = ab.dot(h);
  if (det == 0.0) return false;
  const Vec3 s = p - a, q = s.cross(ab);
  const double u = s.dot(h) / det, v = direction.dot(q) / det, t = ac.dot(q) / det;
  leaving = det < 0.0;
  return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= longest;
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
      bool leaving = false;
      if (meets(placed_[static_cast<std::size_t>(i)], p, direction, longest, leaving) && hit(leaving)) return true;
    }
  }
  return false;
}

int TriangleTree::winding(const Vec3& p) const {
  // An odd direction hits no edge of a drawn shape.
  static const Vec3 kRay = Vec3(0.5377, 0.3129, 0.7829).normalized();
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  int count = 0;
  bool leaving = false;
  const auto add = [&](bool outward) {
    count += outward ? 1 : -1;
    return false;
  };
  cast(p, kRay, kEndless, add);
  for (const Placed& cap : caps_)
    if (meets(cap, p, kRay, kEndless, leaving)) add(leaving);
  return count;
}

bool TriangleTree::crosses(const Vec3& p, const Vec3& q) const {
  return cast(p, q - p, 1.0, [](bool) { return true; });
}

}  // namespace limber
