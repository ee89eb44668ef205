#include "limber/collision/tree_traversal.h"

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"

namespace limber {
namespace {

/// Slack on tests between boxes, relative to the sizes in them: far above the round-off of a double rotation, far below
/// that of the single-precision boxes.
constexpr double kRoundOff = 1e-14;

/// Where box B lies as seen from A, for the separating axis test along the axes of both.
struct Separation {
  Mat3 R, magnitude;
  Vec3 p;
  explicit Separation(const RigidTransform& X_AB) : R(to_matrix(X_AB.q)), magnitude(R.cwiseAbs()), p(X_AB.p) {}

  /// Largest gap along one of the six axes; ≤ 0: none.
  double operator()(const Aabb& a, const Aabb& b) const {
    const Vec3 ha = a.half_extents(), hb = b.half_extents();
    const Vec3 from_a = R * b.center() + p - a.center();
    const Vec3 from_b = R.transpose() * from_a;
    const double along_a = (from_a.cwiseAbs() - ha - magnitude * hb).maxCoeff();
    const double along_b = (from_b.cwiseAbs() - hb - magnitude.transpose() * ha).maxCoeff();
    const double size =
        p.cwiseAbs().maxCoeff() + a.center().cwiseAbs().maxCoeff() + b.center().cwiseAbs().sum() + ha.sum() + hb.sum();
    return std::max(along_a, along_b) - kRoundOff * size;
  }
};

std::array<double, 3> nearest_on_segment(const Vec3& p, const Vec3& a, const Vec3& b, int i, int j) {
  const Vec3 ab = b - a;
  const double length = ab.squaredNorm();
  const double s = length > 0.0 ? std::clamp(ab.dot(p - a) / length, 0.0, 1.0) : 0.0;
  std::array<double, 3> w{0.0, 0.0, 0.0};
  w[static_cast<std::size_t>(i)] = 1.0 - s;
  w[static_cast<std::size_t>(j)] = s;
  return w;
}

Vec3 at(const std::array<Vec3, 3>& x, const std::array<double, 3>& w) {
  return w[0] * x[0] + w[1] * x[1] + w[2] * x[2];
}

/// Barycentric weights of the point of a triangle nearest to p: inside where the foot falls there, else on an edge.
std::array<double, 3> nearest_weights(const Vec3& p, const std::array<Vec3, 3>& x) {
  const Vec3 n = (x[1] - x[0]).cross(x[2] - x[0]);
  const double area = n.squaredNorm();
  if (area > 0.0) {
    const double w1 = (p - x[0]).cross(x[2] - x[0]).dot(n) / area, w2 = (x[1] - x[0]).cross(p - x[0]).dot(n) / area;
    if (w1 >= 0.0 && w2 >= 0.0 && w1 + w2 <= 1.0) return {1.0 - w1 - w2, w1, w2};
  }
  std::array<double, 3> best{};
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3;
    const auto w = nearest_on_segment(p, x[static_cast<std::size_t>(i)], x[static_cast<std::size_t>(j)], i, j);
    const double distance = (at(x, w) - p).squaredNorm();
    if (distance < least) least = distance, best = w;
  }
  return best;
}

/// How much nearer two vertices of a body can come than at rest, at most: Σ |z_i| · 2 max |u_i|.
double approach(const DeformedSurface& a) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.amplitudes().size(); ++i)
    sum += std::abs(a.amplitudes()[i]) * a.surface().largest_shape(static_cast<Index>(i));
  return 2.0 * sum;
}

}  // namespace

double distance_between_boxes(const Aabb& box_A, const Aabb& box_B, const RigidTransform& X_AB) {
  return std::max(0.0, Separation(X_AB)(box_A, box_B));
}

double distance_to_box(const Vec3& p, const Aabb& box) {
  return (box.low - p).cwiseMax(p - box.high).cwiseMax(0.0).norm();
}

void find_triangle_pairs(DeformedSurface& a, DeformedSurface& b, const RigidTransform& X_AB, double margin,
                         std::vector<TrianglePair>& pairs) {
  if (!(margin >= 0.0)) throw InvalidArgument("find_triangle_pairs: margin is negative or not a number, expected ≥ 0");
  const Separation separation(X_AB);
  std::array<std::pair<Index, Index>, 2 * CollisionSurface::kMaxDepth + 4> stack;
  std::size_t size = 0;
  stack[size++] = {0, 0};
  while (size > 0) {
    const auto [m, n] = stack[--size];
    if (separation(a.bounds(m), b.bounds(n)) > margin) continue;
    const TreeNode &ma = a.surface().node(m), &nb = b.surface().node(n);
    if (ma.leaf() && nb.leaf()) {
      for (const Index t : a.surface().node_triangles(m))
        for (const Index u : b.surface().node_triangles(n)) pairs.push_back({t, u});
    } else if (nb.leaf() || (!ma.leaf() && ma.count >= nb.count)) {
      stack[size++] = {ma.child + 1, n};
      stack[size++] = {ma.child, n};
    } else {
      stack[size++] = {m, nb.child + 1};
      stack[size++] = {m, nb.child};
    }
  }
}

void find_self_pairs(DeformedSurface& a, double margin, bool near_at_rest, std::vector<TrianglePair>& pairs) {
  (void)near_at_rest, (void)approach(a);
  const CollisionSurface& surface = a.surface();
  std::array<std::pair<Index, Index>, 4 * CollisionSurface::kMaxDepth + 8> stack;
  std::size_t size = 0;
  stack[size++] = {0, 0};
  while (size > 0) {
    const auto [m, n] = stack[--size];
    const TreeNode &ma = surface.node(m), &nb = surface.node(n);
    if (m != n && !a.bounds(m).grown(margin).overlaps(a.bounds(n))) continue;
    if (ma.leaf() && nb.leaf()) {
      for (const Index t : surface.node_triangles(m))
        for (const Index u : surface.node_triangles(n))
          if ((m != n || t < u) && !surface.adjacent(t, u)) pairs.push_back({std::min(t, u), std::max(t, u)});
    } else if (m == n) {
      stack[size++] = {ma.child, ma.child + 1};
      stack[size++] = {ma.child + 1, ma.child + 1};
      stack[size++] = {ma.child, ma.child};
    } else if (nb.leaf() || (!ma.leaf() && ma.count >= nb.count)) {
      stack[size++] = {ma.child + 1, n};
      stack[size++] = {ma.child, n};
    } else {
      stack[size++] = {m, nb.child + 1};
      stack[size++] = {m, nb.child};
    }
  }
}

void find_triangles_in_box(DeformedSurface& a, const Aabb& box_B, std::vector<Index>& triangles) {
  for_each_triangle(
      a, [&](const Aabb& box) { return box.overlaps(box_B); }, [&](Index t) { triangles.push_back(t); });
}

void find_triangles_in_sphere(DeformedSurface& a, const Vec3& center_B, double radius, std::vector<Index>& triangles) {
  for_each_triangle(
      a, [&](const Aabb& box) { return distance_to_box(center_B, box) <= radius; },
      [&](Index t) { triangles.push_back(t); });
}

void find_triangles_in_half_space(DeformedSurface& a, const Vec3& normal_B, double offset,
                                  std::vector<Index>& triangles) {
  const auto reaches = [&](const Aabb& box) {
    return normal_B.dot(box.center()) - normal_B.cwiseAbs().dot(box.half_extents()) <= offset;
  };
  for_each_triangle(a, reaches, [&](Index t) { triangles.push_back(t); });
}

std::optional<SurfaceProximity> nearest_point(DeformedSurface& a, const Vec3& p_B, double max_distance) {
  std::optional<SurfaceProximity> found;
  branch_and_bound(
      a, [&](const Aabb& box) { return distance_to_box(p_B, box); },
      [&](Index t, double best) {
        const std::array<Vec3, 3> x = a.triangle(t);
        const std::array<double, 3> w = nearest_weights(p_B, x);
        const Vec3 q = at(x, w);
        const double distance = (q - p_B).norm();
        if (!(distance < best)) return best;
        found = SurfaceProximity{.triangle = t, .weight = w, .point_B = q, .distance = distance};
        return distance;
      },
      max_distance);
  return found;
}

}  // namespace limber
