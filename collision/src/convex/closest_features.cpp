#include "limber/collision/closest_features.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tuning.h"

namespace limber {
namespace {

using Kind = Feature::Kind;

constexpr double kDistanceRoundOff = 32 * std::numeric_limits<double>::epsilon();

SurfaceFoot at_vertex(const SegmentPoints& s, int i) { return foot_at(s, i); }

SurfaceFoot at_vertex(const TrianglePoints& t, int i) {
  const auto v = static_cast<std::size_t>(i);
  SurfaceFoot r{t[v], {0.0, 0.0, 0.0}, {Kind::kVertex, static_cast<std::uint8_t>(i)}};
  r.weight[v] = 1.0;
  return r;
}

void keep_nearer(ClosestPoints& best, const SurfaceFoot& a, const SurfaceFoot& b) {
  const double d = (a.point - b.point).norm();
  if (d < best.distance) best = {a, b, d};
}

ClosestPoints none_yet() { return {{}, {}, std::numeric_limits<double>::infinity()}; }

// The common point of a segment and a triangle that it pierces, or crosses at its rim; none if it lies in the plane.
struct Piercing {
  bool pierces = false;
  double parameter = 0.0;  // along the segment
  SurfaceFoot foot{};      // on the triangle
};

Piercing pierce(const SegmentPoints& s, const TrianglePoints& t) {
  const Vec3 n = unit_normal(t);
  const double h0 = n.dot(s[0] - t[0]), h1 = n.dot(s[1] - t[0]);
  if (h0 == h1 || (h0 > 0.0 && h1 > 0.0) || (h0 < 0.0 && h1 < 0.0)) return {};
  const double parameter = h0 / (h0 - h1);
  const Vec3 p = between(s, parameter);
  for (std::size_t i = 0; i < 3; ++i)
    if (n.dot((t[(i + 1) % 3] - t[i]).cross(p - t[i])) < 0.0) return {};
  // The plane of a sliver is round-off in one direction: what it says is taken only where the triangle is indeed met.
  const SurfaceFoot foot = closest_on_triangle(p, t);
  const double round_off = kDistanceRoundOff * (s[0].norm() + s[1].norm() + t[0].norm());
  return {(p - foot.point).norm() <= round_off, parameter, foot};
}

}  // namespace

ClosestPoints closest_points(const SegmentPoints& a, const SegmentPoints& b) {
  const Vec3 u = a[1] - a[0], v = b[1] - b[0], r = b[0] - a[0];
  const Vec3 n = u.cross(v);
  const double n2 = n.squaredNorm();
  const double parallel = internal::collision_tuning().convex.parallel_lines;
  if (n2 > parallel * parallel * u.squaredNorm() * v.squaredNorm()) {
    const double s = r.cross(v).dot(n) / n2, t = r.cross(u).dot(n) / n2;
    if (s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0) {
      const SurfaceFoot foot_b = closest_on_segment(between(a, s), b);
      const SurfaceFoot foot_a = closest_on_segment(foot_b.point, a);
      return {foot_a, foot_b, (foot_a.point - foot_b.point).norm()};
    }
  }
  ClosestPoints best = none_yet();
  for (int i = 0; i < 2; ++i) {
    keep_nearer(best, at_vertex(a, i), closest_on_segment(a[static_cast<std::size_t>(i)], b));
    keep_nearer(best, closest_on_segment(b[static_cast<std::size_t>(i)], a), at_vertex(b, i));
  }
  return best;
}

ClosestOrCrossing closest_points(const SegmentPoints& a, const TrianglePoints& b) {
  if (const Piercing hit = pierce(a, b); hit.pierces) {
    ClosestOrCrossing r;
    r.a = foot_at(a, hit.parameter), r.b = hit.foot;
    r.b.point = r.a.point;
    r.intersecting = true, r.crossing = {r.a.point, r.a.point};
    return r;
  }
  ClosestOrCrossing best{none_yet()};
  for (int i = 0; i < 2; ++i)
    keep_nearer(best, at_vertex(a, i), closest_on_triangle(a[static_cast<std::size_t>(i)], b));
  for (int i = 0; i < 3; ++i) {
    const ClosestPoints pair = closest_points(a, edge_of(b, i));
    keep_nearer(best, pair.a, on_edge(pair.b, i));
  }
  best.intersecting = best.distance == 0.0;
  best.crossing = {best.a.point, best.a.point};
  return best;
}

ClosestOrCrossing closest_points(const TrianglePoints& a, const TrianglePoints& b) {
  ClosestOrCrossing best{none_yet()};
  // What two crossing triangles share is a segment, whose ends are where an edge of one pierces the other.
  double longest = -1.0;
  std::array<ClosestPoints, 6> hits;
  std::size_t count = 0;
  for (int i = 0; i < 3; ++i) {
    if (const Piercing hit = pierce(edge_of(a, i), b); hit.pierces)
      hits[count++] = {on_edge(foot_at(edge_of(a, i), hit.parameter), i), hit.foot, 0.0};
    if (const Piercing hit = pierce(edge_of(b, i), a); hit.pierces)
      hits[count++] = {hit.foot, on_edge(foot_at(edge_of(b, i), hit.parameter), i), 0.0};
  }
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = i; j < count; ++j) {
      const double length = (hits[i].a.point - hits[j].a.point).norm();
      if (length <= longest) continue;
      longest = length;
      static_cast<ClosestPoints&>(best) = hits[i];
      best.crossing = {hits[i].a.point, hits[j].a.point};
    }
  if (count > 0) {
    best.b.point = best.a.point;
    best.intersecting = true;
    return best;
  }
  for (int i = 0; i < 3; ++i) {
    keep_nearer(best, at_vertex(a, i), closest_on_triangle(a[static_cast<std::size_t>(i)], b));
    keep_nearer(best, closest_on_triangle(b[static_cast<std::size_t>(i)], a), at_vertex(b, i));
    for (int j = 0; j < 3; ++j) {
      const ClosestPoints pair = closest_points(edge_of(a, i), edge_of(b, j));
      keep_nearer(best, on_edge(pair.a, i), on_edge(pair.b, j));
    }
  }
  best.intersecting = best.distance == 0.0;
  best.crossing = {best.a.point, best.a.point};
  return best;
}

}  // namespace limber
