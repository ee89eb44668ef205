#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "limber/collision/closest_features.h"
#include "tuning.h"

namespace limber {
namespace {

// A vertex of the difference of two hulls, A − B, and where it comes from.
struct Vertex {
  Vec3 point;
  std::size_t a, b;
};

struct Simplex {
  std::array<Vertex, 4> vertices;
  std::size_t size = 0;

  bool has(const Vertex& v) const {
    return std::any_of(vertices.begin(), vertices.begin() + static_cast<std::ptrdiff_t>(size),
                       [&](const Vertex& w) { return w.a == v.a && w.b == v.b; });
  }
};

std::size_t farthest(std::span<const Vec3> points, const Vec3& direction) {
  std::size_t best = 0;
  double value = points[0].dot(direction);
  for (std::size_t i = 1; i < points.size(); ++i)
    if (const double d = points[i].dot(direction); d > value) best = i, value = d;
  return best;
}

// Of the simplex's at most three vertices, by `foot`'s weights; returns the point itself.
Vec3 reduce_to(Simplex& simplex, const std::array<std::size_t, 3>& of, const SurfaceFoot& foot) {
  Simplex kept;
  for (std::size_t i = 0; i < 3; ++i)
    if (foot.weight[i] > 0.0) kept.vertices[kept.size++] = simplex.vertices[of[i]];
  simplex = kept;
  return foot.point;
}

SurfaceFoot nearest_to_origin(const Simplex& s, const std::array<std::size_t, 3>& of) {
  return closest_on_triangle(Vec3::Zero(), {s.vertices[of[0]].point, s.vertices[of[1]].point, s.vertices[of[2]].point});
}

// Six times the volume of the tetrahedron with each vertex in turn at the origin; they sum to that of the whole, and
// have its sign where the origin is inside. A flat one has no inside: volumes that are the round-off of these products
// tell no sides, and the origin, off its plane, has some of either sign.
struct SplitVolumes {
  std::array<double, 4> part;
  double whole;

  explicit SplitVolumes(const Simplex& s) {
    const auto p = [&](std::size_t i) -> const Vec3& { return s.vertices[i].point; };
    part = {p(1).dot(p(2).cross(p(3))), -p(0).dot(p(2).cross(p(3))), p(0).dot(p(1).cross(p(3))),
            -p(0).dot(p(1).cross(p(2)))};
    whole = part[0] + part[1] + part[2] + part[3];
    double size = 0.0;
    for (const Vertex& v : s.vertices) size = std::max(size, v.point.cwiseAbs().maxCoeff());
    // Four triple products of six terms each, of three roundings and the sum's.
    constexpr double kRoundings = 4.0 * 6.0 * 8.0 * std::numeric_limits<double>::epsilon();
    if (std::abs(whole) <= kRoundings * size * size * size) whole = 0.0;
  }
  // Whether the origin is on the side of a vertex as seen from the face opposite to it.
  bool inner(std::size_t i) const { return (whole > 0.0 && part[i] >= 0.0) || (whole < 0.0 && part[i] <= 0.0); }
};

// The simplex's point nearest to the origin; leaves only the vertices it depends on. All four are left, and the origin
// itself is returned, where the origin is inside.
Vec3 shrink_to_nearest(Simplex& s) {
  if (s.size < 3)
    return reduce_to(s, {0, 1, 2},
                     closest_on_segment(Vec3::Zero(), {s.vertices[0].point, s.vertices[s.size - 1].point}));
  if (s.size == 3) return reduce_to(s, {0, 1, 2}, nearest_to_origin(s, {0, 1, 2}));
  constexpr std::array<std::array<std::size_t, 3>, 4> kFaces{{{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}}};
  const SplitVolumes volumes(s);
  bool inside = true;
  std::size_t best = 0;
  SurfaceFoot best_foot{};
  double best_distance = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 4; ++i) {
    if (volumes.inner(i)) continue;  // what is nearest on it is on another face too
    inside = false;
    const SurfaceFoot foot = nearest_to_origin(s, kFaces[i]);
    if (const double d = foot.point.norm(); d < best_distance) best = i, best_foot = foot, best_distance = d;
  }
  if (inside) return Vec3::Zero();
  return reduce_to(s, kFaces[best], best_foot);
}

ClosestPoints exchanged(ClosestPoints c) {
  std::swap(c.a, c.b);
  return c;
}

// The different vertices of one side of a simplex of up to three.
struct Corners {
  TrianglePoints points{};
  std::size_t count = 0;

  Corners(const Simplex& s, std::span<const Vec3> of, std::size_t Vertex::*side) {
    std::array<std::size_t, 3> used{};
    for (std::size_t i = 0; i < s.size; ++i) {
      const auto end = used.begin() + static_cast<std::ptrdiff_t>(count);
      const std::size_t v = s.vertices[i].*side;
      if (std::find(used.begin(), end, v) == end) points[count] = of[v], used[count++] = v;
    }
  }
  SegmentPoints segment() const { return {points[0], points[1]}; }
};

// Of two features, by as many corners as each has; the first has no fewer. Distance 0: they intersect.
ClosestPoints closest_of(const Corners& a, const Corners& b) {
  if (b.count == 3) return closest_points(a.points, b.points);
  if (a.count == 3 && b.count == 2) return exchanged(closest_points(b.segment(), a.points));
  if (b.count == 2) return closest_points(a.segment(), b.segment());
  const Vec3& p = b.points[0];
  ClosestPoints pair{{a.points[0], {}, {}}, {p, {}, {}}};
  if (a.count > 1) pair.a = a.count == 3 ? closest_on_triangle(p, a.points) : closest_on_segment(p, a.segment());
  pair.distance = (pair.a.point - p).norm();
  return pair;
}

ConvexDistance intersecting(const Vec3& common, double radii) { return {common, common, Vec3::Zero(), -radii, true}; }

}  // namespace

ConvexDistance distance(const ConvexSolid& a, const ConvexSolid& b, double most) {
  const double radii = a.radius + b.radius;
  Simplex simplex;
  simplex.vertices[simplex.size++] = {a.points[0] - b.points[0], 0, 0};
  Vec3 nearest = simplex.vertices[0].point;
  const internal::ConvexTuning& tuning = internal::collision_tuning().convex;
  for (int i = 0; i < tuning.gjk_iterations; ++i) {
    const double squared = nearest.squaredNorm();
    if (squared == 0.0) return intersecting(a.points[simplex.vertices[0].a], radii);
    Vertex next{Vec3::Zero(), farthest(a.points, -nearest), farthest(b.points, nearest)};
    next.point = a.points[next.a] - b.points[next.b];
    const Vec3 n = nearest / std::sqrt(squared);
    if (const double apart = n.dot(next.point) - radii; apart > most)
      return {a.points[next.a] - a.radius * n, b.points[next.b] + b.radius * n, n, apart, false};
    if (simplex.has(next) || squared - nearest.dot(next.point) <= tuning.gjk_progress * squared) break;
    Simplex larger = simplex;
    larger.vertices[larger.size++] = next;
    const Vec3 nearer = shrink_to_nearest(larger);
    if (larger.size < 4 && nearer.squaredNorm() >= squared) break;
    simplex = larger, nearest = nearer;
  }
  const Corners of_a(simplex, a.points, &Vertex::a), of_b(simplex, b.points, &Vertex::b);
  const ClosestPoints pair = of_a.count < of_b.count ? exchanged(closest_of(of_b, of_a)) : closest_of(of_a, of_b);
  if (pair.distance == 0.0) return intersecting(pair.a.point, radii);
  const Vec3 n = (pair.a.point - pair.b.point) / pair.distance;
  return {pair.a.point - a.radius * n, pair.b.point + b.radius * n, n, pair.distance - radii, false};
}

}  // namespace limber
