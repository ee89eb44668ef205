#include "query/convex_cast.h"

#include <algorithm>
#include <cmath>

namespace limber::internal {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The roots of a f² + 2 b f + c, without cancellation: their product is c/a. Not a number where there are none.
std::array<double, 2> roots(double a, double b, double c) {
  const double q = -(b + std::copysign(std::sqrt(b * b - a * c), b));
  return {q / a, q == 0.0 ? q / a : c / q};
}

}  // namespace

double enters_box(const Vec3& from, const Vec3& way, double limit, const Aabb& box) {
  double in = 0.0, out = limit;
  for (int i = 0; i < 3; ++i) {
    if (way[i] == 0.0) {
      if (from[i] < box.low[i] || from[i] > box.high[i]) return kInfinity;
      continue;
    }
    const double a = (box.low[i] - from[i]) / way[i], b = (box.high[i] - from[i]) / way[i];
    in = std::max(in, std::min(a, b));
    out = std::min(out, std::max(a, b));
  }
  // Rounding of the quotients must not lose a box that is grazed.
  constexpr double kRounding = 1.0 + 8.0 * std::numeric_limits<double>::epsilon();
  return in <= out * kRounding ? in : kInfinity;
}

std::optional<TriangleHit> meet(const Vec3& from, const Vec3& way, const TrianglePoints& x) {
  // Signed volumes over the edges, which two triangles that share an edge reckon from the same numbers: a ray cannot
  // slip between them.
  const Vec3 a = x[0] - from, b = x[1] - from, c = x[2] - from;
  const double u = way.dot(b.cross(c)), v = way.dot(c.cross(a)), w = way.dot(a.cross(b));
  if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return {};
  const double sum = u + v + w;
  if (sum == 0.0) return {};
  const std::array<double, 3> weight{u / sum, v / sum, w / sum};
  const Vec3 at = weight[0] * a + weight[1] * b + weight[2] * c;
  const double fraction = at.dot(way) / way.squaredNorm();
  if (fraction < 0.0) return {};
  return TriangleHit{fraction, weight};
}

std::optional<double> meet_capsule(const Vec3& from, const Vec3& way, const SegmentPoints& core, double radius) {
  const Vec3 axis = core[1] - core[0];
  const double length = axis.norm();
  const Vec3 unit = length > 0.0 ? Vec3(axis / length) : Vec3(Vec3::Zero());
  double first = kInfinity;
  // Each part of the surface counts where it is no part of the inside: caps beyond their ends, the tube between.
  const auto part = [&](const Vec3& along, const Vec3& offset, double low, double high) {
    for (const double f : roots(along.squaredNorm(), along.dot(offset), offset.squaredNorm() - radius * radius)) {
      const double s = (from + f * way - core[0]).dot(unit);
      if (f >= 0.0 && s >= low && s <= high) first = std::min(first, f);
    }
  };
  const Vec3 d = from - core[0];
  part(way, d, -kInfinity, 0.0);
  part(way, from - core[1], length, kInfinity);
  if (length > 0.0) part(way - way.dot(unit) * unit, d - d.dot(unit) * unit, 0.0, length);
  if (first == kInfinity) return {};
  return first;
}

void ConvexCast::start(const ConvexSolid& moving, const Vec3& way, double tolerance) {
  moving_ = moving;
  way_ = way;
  tolerance_ = tolerance;
}

std::optional<Touch> ConvexCast::touch(const ConvexSolid& standing, double limit) {
  Touch at;
  for (;;) {
    shifted_.clear();
    for (const Vec3& p : standing.points) shifted_.push_back(p - at.fraction * way_);
    const ConvexDistance d = distance(moving_, {shifted_, standing.radius});
    if (!d.cores_intersect && (at.fraction > 0.0 || d.distance > 0.0)) at.normal = d.normal;
    at.point = d.b + at.fraction * way_;
    if (d.cores_intersect || d.distance <= tolerance_) return at;
    const double closing = -d.normal.dot(way_);
    if (!(closing > 0.0)) return {};
    // To half the tolerance, so that the root itself is never passed.
    const double next = at.fraction + (d.distance - 0.5 * tolerance_) / closing;
    if (next > limit) return {};
    if (next == at.fraction) return at;
    at.fraction = next;
  }
}

}  // namespace limber::internal
