#include "limber/mesh/closest_point.h"

#include <cmath>
#include <limits>

namespace limber {
namespace {

// Triangles whose height is below this part of their longest edge are segments.
constexpr double kFlat = 1e-13;

// Place of the foot of p on the line through s: 0 at s[0], 1 at s[1]; 0 for a segment without length.
double line_parameter(const Vec3& p, const SegmentPoints& s) {
  const Vec3 d = s[1] - s[0];
  const double length2 = d.squaredNorm();
  if (length2 == 0.0) return 0.0;
  return (p - s[0]).dot(d) / length2;
}

// The point of foot_at() alone.
Vec3 point_at(const SegmentPoints& s, double t) {
  if (!(t > 0.0)) return s[0];
  return t >= 1.0 ? s[1] : between(s, t);
}

// The longest edge of a triangle, from vertex a to b, and the height of the third vertex c over it.
struct Altitude {
  explicit Altitude(const TrianglePoints& t) {
    double longest = -1.0;
    for (std::size_t i = 0; i < 3; ++i)
      if (const double length = (t[(i + 1) % 3] - t[i]).squaredNorm(); length > longest) longest = length, a = i;
    b = (a + 1) % 3, c = (a + 2) % 3;
    edge = t[b] - t[a], edge2 = edge.squaredNorm();
    if (edge2 == 0.0) return;
    foot = (t[c] - t[a]).dot(edge) / edge2;
    height = t[c] - t[a] - foot * edge;
    height -= height.dot(edge) / edge2 * edge;
    height2 = height.squaredNorm();
    flat = !(height2 > kFlat * kFlat * edge2);
  }

  std::size_t a = 0, b = 1, c = 2;
  Vec3 edge = Vec3::Zero(), height = Vec3::Zero();
  double edge2 = 0.0, height2 = 0.0;
  double foot = 0.0;  // where the height stands on the edge: 0 at a, 1 at b
  bool flat = true;
};

}  // namespace

SurfaceFoot on_edge(const SurfaceFoot& foot, int edge) {
  using Kind = Feature::Kind;
  const auto first = static_cast<std::size_t>(edge), second = static_cast<std::size_t>((edge + 1) % 3);
  SurfaceFoot r{foot.point, {0.0, 0.0, 0.0}, {}};
  r.weight[first] = foot.weight[0], r.weight[second] = foot.weight[1];
  if (foot.feature.kind == Kind::kEdge)
    r.feature = {Kind::kEdge, static_cast<std::uint8_t>(first)};
  else
    r.feature = {Kind::kVertex, static_cast<std::uint8_t>(foot.feature.index == 0 ? first : second)};
  return r;
}

Vec3 unit_normal(const TrianglePoints& t) {
  const Altitude base(t);
  if (base.flat) return Vec3::Zero();
  return (base.edge / std::sqrt(base.edge2)).cross(base.height / std::sqrt(base.height2)).normalized();
}

SurfaceFoot closest_on_segment(const Vec3& p, const SegmentPoints& s) { return foot_at(s, line_parameter(p, s)); }

SurfaceFoot closest_on_triangle(const Vec3& p, const TrianglePoints& t) {
  const Altitude base(t);
  if (!base.flat) {
    // Along the longest edge first, then across: the two errors do not mix, however thin the triangle.
    const Vec3 r = p - t[base.a];
    const double along = r.dot(base.edge) / base.edge2;
    const double c = (r - along * base.edge).dot(base.height) / base.height2;
    const double b = along - c * base.foot, a = 1.0 - b - c;
    if (a > 0.0 && b > 0.0 && c > 0.0) {
      SurfaceFoot inside{t[base.a] + along * base.edge + c * base.height, {}, {Feature::Kind::kFace, 0}};
      inside.weight[base.a] = a, inside.weight[base.b] = b, inside.weight[base.c] = c;
      return inside;
    }
  }
  int nearest = 0;
  double parameter = 0.0, least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const SegmentPoints s = edge_of(t, i);
    const double along = line_parameter(p, s);
    const double d2 = (p - point_at(s, along)).squaredNorm();
    if (d2 < least) nearest = i, parameter = along, least = d2;
  }
  return on_edge(foot_at(edge_of(t, nearest), parameter), nearest);
}

}  // namespace limber
