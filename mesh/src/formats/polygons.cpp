#include "formats/polygons.h"

#include <cmath>

namespace limber::internal {
namespace {

struct Point {
  double x, y;
};

/// Twice the signed area of a triangle.
double turn(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// The polygon seen along the coordinate axis nearest to its normal (Newell's), counter-clockwise.
std::vector<Point> flattened(std::span<const Index> polygon, std::span<const Vec3> vertices) {
  Vec3 normal = Vec3::Zero();
  const Vec3& base = vertices[static_cast<std::size_t>(polygon[0])];
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vec3 a = vertices[static_cast<std::size_t>(polygon[i])] - base;
    const Vec3 b = vertices[static_cast<std::size_t>(polygon[(i + 1) % polygon.size()])] - base;
    normal += a.cross(b);
  }
  int drop = 0;
  normal.cwiseAbs().maxCoeff(&drop);
  const int u = (drop + 1) % 3, v = (drop + 2) % 3;
  const double sign = normal[drop] < 0.0 ? -1.0 : 1.0;
  std::vector<Point> flat;
  for (const Index corner : polygon) {
    const Vec3 p = vertices[static_cast<std::size_t>(corner)] - base;
    flat.push_back({sign * p[u], p[v]});
  }
  return flat;
}

bool is_convex(const std::vector<Point>& p) {
  for (std::size_t i = 0; i < p.size(); ++i)
    if (turn(p[i], p[(i + 1) % p.size()], p[(i + 2) % p.size()]) < 0.0) return false;
  return true;
}

bool is_ear(const std::vector<Point>& p, const std::vector<std::size_t>& left, std::size_t at) {
  const std::size_t n = left.size();
  const Point &a = p[left[(at + n - 1) % n]], &b = p[left[at]], &c = p[left[(at + 1) % n]];
  if (turn(a, b, c) <= 0.0) return false;
  for (std::size_t k = 2; k < n - 1; ++k) {
    const Point& q = p[left[(at + k) % n]];
    if (turn(a, b, q) >= 0.0 && turn(b, c, q) >= 0.0 && turn(c, a, q) >= 0.0) return false;
  }
  return true;
}

void push_fan(std::span<const Index> polygon, std::vector<Triangle>& out) {
  for (std::size_t i = 2; i < polygon.size(); ++i) out.push_back({polygon[0], polygon[i - 1], polygon[i]});
}

void push_ears(std::span<const Index> polygon, const std::vector<Point>& flat, std::vector<Triangle>& out) {
  std::vector<std::size_t> left(polygon.size());
  for (std::size_t i = 0; i < left.size(); ++i) left[i] = i;
  while (left.size() > 3) {
    std::size_t ear = 0;
    while (ear < left.size() && !is_ear(flat, left, ear)) ++ear;
    if (ear == left.size()) break;  // crossing or degenerate: what is left becomes a fan
    const std::size_t n = left.size();
    out.push_back({polygon[left[(ear + n - 1) % n]], polygon[left[ear]], polygon[left[(ear + 1) % n]]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  std::vector<Index> rest;
  rest.reserve(left.size());
  for (const std::size_t i : left) rest.push_back(polygon[i]);
  push_fan(rest, out);
}

}  // namespace

std::vector<Triangle> triangulated(const Polygons& polygons, std::span<const Vec3> vertices) {
  constexpr std::size_t kMostEars = 512;  // the cut takes a time that grows with the cube; larger ones become fans
  std::vector<Triangle> out;
  out.reserve(polygons.size());
  for (std::size_t i = 0; i < polygons.size(); ++i) {
    const auto polygon = polygons[i];
    if (polygon.size() <= 3 || polygon.size() > kMostEars) {
      push_fan(polygon, out);
      continue;
    }
    const auto flat = flattened(polygon, vertices);
    if (is_convex(flat))
      push_fan(polygon, out);
    else
      push_ears(polygon, flat, out);
  }
  return out;
}

}  // namespace limber::internal
