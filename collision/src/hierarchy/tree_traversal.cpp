#include "limber/collision/tree_traversal.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "hierarchy/branch_and_bound.h"
#include "hierarchy/deformed_scratch.h"
#include "limber/collision/closest_features.h"
#include "limber/core/error.h"

namespace limber {

using internal::boxes_within;
using internal::BoxFrames;
using internal::BoxReader;
using internal::NodeBox;

namespace {

/// Slack on tests between boxes, relative to the sizes in them: far above the round-off of a double rotation, far below
/// that of the single-precision boxes.
constexpr double kBoxRoundOff = 1e-14;

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
    return std::max(along_a, along_b) - kBoxRoundOff * size;
  }
};

double reach_of(const NodeBox& box) {  // from the origin to its farthest point, at most
  double sum = 0.0;
  for (int i = 0; i < 3; ++i) sum += std::max(std::abs(box.low[i]), std::abs(box.high[i]));
  return sum;
}

/// Error of the separating axis test in single precision: some thirty roundings of numbers up to `size`.
BoxFrames box_frames(const RigidTransform& X_AB, const Vec3& way_A, double margin, double size) {
  constexpr double kErrors = 64 * 0x1p-24;
  const Mat3 R = to_matrix(X_AB.q);
  BoxFrames frames{};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) frames.columns[j][i] = frames.rows[i][j] = static_cast<float>(R(i, j));
    frames.p[i] = static_cast<float>(X_AB.p[i] + 0.5 * way_A[i]);
  }
  const double slack = margin + kErrors * (size + margin) + internal::kBoxUnderflow;
  const Vec3 along_a = 0.5 * way_A.cwiseAbs(), along_b = 0.5 * (R.transpose() * way_A).cwiseAbs();
  for (int i = 0; i < 3; ++i) {
    frames.slack_a[i] = static_cast<float>(slack + along_a[i]);
    frames.slack_b[i] = static_cast<float>(slack + along_b[i]);
  }
  return frames;
}

Aabb box_of(const std::array<Vec3, 3>& x) {
  return {x[0].cwiseMin(x[1]).cwiseMin(x[2]), x[0].cwiseMax(x[1]).cwiseMax(x[2])};
}

/// Triangles of two leaves whose boxes come within reach: those of a that reach the leaf of b, with each of b's.
void append_leaf_pairs(BoxReader& a, BoxReader& b, Index m, Index n, const BoxFrames& frames,
                       std::vector<TrianglePair>& pairs) {
  const auto of_a = a.surface().node_triangles(m), of_b = b.surface().node_triangles(n);
  const NodeBox* boxes_a = a.triangle_boxes(m);
  std::uint64_t left_a = boxes_within(frames, b(n), boxes_a, of_a.size(), false);
  if (left_a == 0) return;
  const NodeBox* boxes_b = b.triangle_boxes(n);
  for (; left_a != 0; left_a &= left_a - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(left_a));
    for (std::uint64_t left_b = boxes_within(frames, boxes_a[i], boxes_b, of_b.size(), true); left_b != 0;
         left_b &= left_b - 1)
      pairs.push_back({of_a[i], of_b[static_cast<std::size_t>(std::countr_zero(left_b))]});
  }
}

/// One leaf with itself or another of the same surface.
void append_self(DeformedSurface& a, Index m, Index n, double margin, std::vector<TrianglePair>& pairs) {
  const CollisionSurface& surface = a.surface();
  for (const Index t : surface.node_triangles(m)) {
    const Aabb box = box_of(a.triangle(t)).grown(margin);
    for (const Index u : surface.node_triangles(n)) {
      if ((m == n && u <= t) || surface.adjacent(t, u) || !box.overlaps(box_of(a.triangle(u)))) continue;
      pairs.push_back({std::min(t, u), std::max(t, u)});
    }
  }
}

}  // namespace

double distance_to_box(const Vec3& p, const Aabb& box) {
  return (box.low - p).cwiseMax(p - box.high).cwiseMax(0.0).norm();
}

void find_triangle_pairs(DeformedSurface& a, DeformedSurface& b, const RigidTransform& X_AB, double margin,
                         std::vector<TrianglePair>& pairs, const Vec3& way_A) {
  if (!(margin >= 0.0)) throw InvalidArgument("find_triangle_pairs: margin is negative or not a number, expected ≥ 0");
  const double way = way_A.norm();
  if (Separation(X_AB)(a.bounds(0), b.bounds(0)) > margin + way) return;
  BoxReader boxes_a(a), boxes_b(b);
  const BoxFrames frames =
      box_frames(X_AB, way_A, margin, reach_of(boxes_a(0)) + reach_of(boxes_b(0)) + X_AB.p.norm() + way);
  std::array<std::pair<Index, Index>, 2 * CollisionSurface::kMaxDepth + 4> stack;
  std::size_t count = 0;
  stack[count++] = {0, 0};
  while (count > 0) {
    const auto [m, n] = stack[--count];
    const TreeNode &ma = a.surface().node(m), &nb = b.surface().node(n);
    if (ma.leaf() && nb.leaf()) {
      append_leaf_pairs(boxes_a, boxes_b, m, n, frames, pairs);
    } else if (nb.leaf() || (!ma.leaf() && ma.count > nb.count)) {
      const std::uint64_t within = boxes_within(frames, boxes_b(n), boxes_a.siblings(ma.child), 2, false);
      if (within & 2u) stack[count++] = {ma.child + 1, n};
      if (within & 1u) stack[count++] = {ma.child, n};
    } else {
      const std::uint64_t within = boxes_within(frames, boxes_a(m), boxes_b.siblings(nb.child), 2, true);
      if (within & 2u) stack[count++] = {m, nb.child + 1};
      if (within & 1u) stack[count++] = {m, nb.child};
    }
  }
}

void find_self_pairs(DeformedSurface& a, double margin, std::vector<TrianglePair>& pairs) {
  if (!(margin >= 0.0)) throw InvalidArgument("find_self_pairs: margin is negative or not a number, expected ≥ 0");
  const CollisionSurface& surface = a.surface();
  BoxReader boxes(a);
  // Two parts that are farther apart at rest than both can move are apart: no box of this state is needed.
  const double kept_apart = margin + 2.0 * boxes.farthest();
  const auto apart = [&](Index m, Index n) {
    return !boxes.rest_box(m).grown(kept_apart).overlaps(boxes.rest_box(n)) ||
           !a.bounds(m).grown(margin).overlaps(a.bounds(n));
  };
  std::array<std::pair<Index, Index>, 4 * CollisionSurface::kMaxDepth + 8> stack;
  std::size_t count = 0;
  stack[count++] = {0, 0};
  while (count > 0) {
    const auto [m, n] = stack[--count];
    const TreeNode &ma = surface.node(m), &nb = surface.node(n);
    if (m != n && apart(m, n)) continue;
    if (ma.leaf() && nb.leaf()) {
      append_self(a, m, n, margin, pairs);
    } else if (m == n) {
      stack[count++] = {ma.child, ma.child + 1};
      stack[count++] = {ma.child + 1, ma.child + 1};
      stack[count++] = {ma.child, ma.child};
    } else if (nb.leaf() || (!ma.leaf() && ma.count >= nb.count)) {
      stack[count++] = {ma.child + 1, n};
      stack[count++] = {ma.child, n};
    } else {
      stack[count++] = {m, nb.child + 1};
      stack[count++] = {m, nb.child};
    }
  }
}

namespace {

// Depth first, first child first: visits each triangle whose nodes' boxes all pass.
// @param enter (const Aabb& box_B) → bool: whether anything in the box can matter
// @param visit (Index triangle)
template <class Enter, class Visit>
void for_each_triangle(DeformedSurface& a, const Enter& enter, const Visit& visit) {
  std::array<Index, CollisionSurface::kMaxDepth + 2> stack;
  std::size_t size = 0;
  stack[size++] = 0;
  while (size > 0) {
    const Index n = stack[--size];
    if (!enter(a.bounds(n))) continue;
    const TreeNode& node = a.surface().node(n);
    if (node.leaf()) {
      for (const Index t : a.surface().node_triangles(n)) visit(t);
    } else {
      stack[size++] = node.child + 1;
      stack[size++] = node.child;
    }
  }
}

}  // namespace

void find_triangles_in_box(DeformedSurface& a, const Aabb& box_B, std::vector<Index>& triangles) {
  for_each_triangle(
      a, [&](const Aabb& box) { return box.overlaps(box_B); }, [&](Index t) { triangles.push_back(t); });
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
  internal::branch_and_bound(
      a, [&](const Aabb& box) { return distance_to_box(p_B, box); },
      [&](Index t, double best) {
        const SurfaceFoot foot = closest_on_triangle(p_B, a.triangle(t));
        const double distance = (foot.point - p_B).norm();
        if (!(distance < best)) return best;
        found = SurfaceProximity{.triangle = t, .weight = foot.weight, .point_B = foot.point, .distance = distance};
        return distance;
      },
      max_distance);
  return found;
}

}  // namespace limber
