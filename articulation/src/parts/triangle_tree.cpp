#include "parts/triangle_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/mesh/closest_point.h"

namespace limber::internal {
namespace {

constexpr std::size_t kLeaf = 4;  // triangles

CornerTree<3>::Corners corners_of(const SurfaceMesh& surface, const Triangle& t) {
  return {surface.vertices[static_cast<std::size_t>(t[0])], surface.vertices[static_cast<std::size_t>(t[1])],
          surface.vertices[static_cast<std::size_t>(t[2])]};
}

/// True if some unit normal m in a box may have direction·m ≤ cosine.
bool may_face(const Eigen::AlignedBox3d& normals, const Vec3& direction, double cosine) {
  constexpr double kRounding = 1e-12;
  double least = 0.0;
  for (int k = 0; k < 3; ++k) least += direction[k] * (direction[k] > 0.0 ? normals.min()[k] : normals.max()[k]);
  return least <= cosine + kRounding;
}

/// True if the line p + t·direction meets the triangle at t in [0, longest]; then `leaving` tells which way.
bool meets(const CornerTree<3>::Corners& triangle, const Vec3& p, const Vec3& direction, double longest,
           bool& leaving) {
  const Vec3 &a = triangle[0], ab = triangle[1] - a, ac = triangle[2] - a, h = direction.cross(ac);
  const double det = ab.dot(h);
  if (det == 0.0) return false;
  const Vec3 s = p - a, q = s.cross(ab);
  const double u = s.dot(h) / det, v = direction.dot(q) / det, t = ac.dot(q) / det;
  leaving = det < 0.0;
  return u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= longest;
}

}  // namespace

TriangleTree::TriangleTree(const SurfaceMesh& surface, std::span<const Triangle> caps) {
  std::vector<Corners> all;
  all.reserve(surface.triangles.size()), normals_.reserve(surface.triangles.size());
  for (const Triangle& t : surface.triangles) {
    const Corners& c = all.emplace_back(corners_of(surface, t));
    normals_.push_back((c[1] - c[0]).cross(c[2] - c[0]).stableNormalized());
  }
  for (const Triangle& cap : caps) caps_.push_back(corners_of(surface, cap));
  if (all.empty()) return;
  tree_.build(all, kLeaf);
  box_ = tree_.box(0);
  for (std::size_t place = 0; place < all.size(); ++place)
    normals_at_.push_back(normal(tree_.element(static_cast<Index>(place))));
  normals_of_nodes_.resize(tree_.nodes());
  tree_.fill_upward(
      [&](std::size_t node, Index first, Index end) {
        for (Index i = first; i < end; ++i) normals_of_nodes_[node].extend(normals_at_[static_cast<std::size_t>(i)]);
      },
      [&](std::size_t node, std::size_t one, std::size_t other) {
        normals_of_nodes_[node] = normals_of_nodes_[one].merged(normals_of_nodes_[other]);
      });
}

template <class Nearer>
void TriangleTree::search(const Vec3& p, double& squared_limit, const Vec3& direction, double cosine,
                          Nearer&& nearer) const {
  if (normals_.empty()) return;
  bool wanted = true;
  const auto bound = [&] { return wanted ? squared_limit : -1.0; };
  const auto faces = [&](std::size_t node) { return may_face(normals_of_nodes_[node], direction, cosine); };
  tree_.search(p, bound, faces, [&](Index place) {
    const Vec3& own = normals_at_[static_cast<std::size_t>(place)];
    if (!wanted || own.dot(direction) > cosine) return;
    constexpr double kRounding = 1.0 - 1e-9;
    const Corners& corners = tree_.corners(place);
    const double above = own.dot(p - corners[0]);  // of the plane: no point of the triangle is nearer
    if (kRounding * above * above > squared_limit) return;
    const SurfaceFoot foot = closest_on_triangle(p, corners);
    wanted = nearer(place, foot, (foot.point - p).squaredNorm());
  });
}

TriangleTree::Nearest TriangleTree::nearest(const Vec3& p, double limit, const Vec3& direction, double cosine) const {
  Nearest best;
  double squared_limit = limit * limit;
  search(p, squared_limit, direction, cosine, [&](Index place, const SurfaceFoot& foot, double squared) {
    if (squared < squared_limit || (squared <= squared_limit && !best.found())) {
      squared_limit = squared;
      best = {tree_.element(place), foot.point, {foot.weight[0], foot.weight[1], foot.weight[2]}, 0.0};
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
  search(p, squared_limit, direction, cosine, [&](Index, const SurfaceFoot&, double squared) {
    if (squared <= squared_limit) found = std::sqrt(squared);
    return !found;
  });
  return found;
}

template <class Hit>
bool TriangleTree::cast(const Vec3& p, const Vec3& direction, double longest, Hit&& hit) const {
  if (normals_.empty()) return false;
  const Eigen::Array3d inverse = direction.array().inverse();
  const auto is_hit = [&](std::size_t node) {
    // A zero times an infinite inverse is not a number, which min and max pass over in favour of the other.
    const Eigen::AlignedBox3d& box = tree_.box(node);
    double in = 0.0, out = longest;
    for (int k = 0; k < 3; ++k) {
      const double t0 = (box.min()[k] - p[k]) * inverse[k], t1 = (box.max()[k] - p[k]) * inverse[k];
      in = std::max(in, std::min(t0, t1));
      out = std::min(out, std::max(t0, t1));
    }
    return out >= in;
  };
  return tree_.any_leaf(is_hit, [&](Index first, Index end) {
    for (Index i = first; i < end; ++i)
      if (bool leaving = false; meets(tree_.corners(i), p, direction, longest, leaving) && hit(leaving)) return true;
    return false;
  });
}

int TriangleTree::winding(const Vec3& p) const {
  // An odd direction hits no edge of a drawn shape.
  static const Vec3 kRay = Vec3(0.5377, 0.3129, 0.7829).normalized();
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  int count = 0;
  const auto add = [&](bool leaving) {
    count += leaving ? 1 : -1;
    return false;
  };
  cast(p, kRay, kEndless, add);
  for (const Corners& cap : caps_)
    if (bool leaving = false; meets(cap, p, kRay, kEndless, leaving)) add(leaving);
  return count;
}

bool TriangleTree::crosses(const Vec3& p, const Vec3& q) const {
  return cast(p, q - p, 1.0, [](bool) { return true; });
}

}  // namespace limber::internal
