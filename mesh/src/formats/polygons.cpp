#include "formats/polygons.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace limber::internal {
namespace {

struct Point {
  double x, y;
  friend bool operator==(const Point&, const Point&) = default;
};

/// Which side of the line from a to b the point c is on: 1 left, −1 right, 0 on it. Points count as on it within the
/// rounding of their coordinates, as flat triangles do everywhere in limber.
int side(const Point& a, const Point& b, const Point& c) {
  constexpr double kFlat = 1e-12;  // twice the area of a flat triangle, in squares of its longest edge
  const double ux = b.x - a.x, uy = b.y - a.y, vx = c.x - a.x, vy = c.y - a.y, wx = c.x - b.x, wy = c.y - b.y;
  const double area = ux * vy - uy * vx;
  const double longest = std::max({ux * ux + uy * uy, vx * vx + vy * vy, wx * wx + wy * wy});
  return area > kFlat * longest ? 1 : area < -kFlat * longest ? -1 : 0;
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
  flat.reserve(polygon.size());
  for (const Index corner : polygon) {
    const Vec3 p = vertices[static_cast<std::size_t>(corner)] - base;
    flat.push_back({sign * p[u], p[v]});
  }
  return flat;
}

/// Whether the triangles from the first corner cover the polygon: it turns left everywhere, seen from there too.
bool is_fan(const std::vector<Point>& p) {
  const std::size_t n = p.size();
  for (std::size_t i = 0; i < n; ++i)
    if (side(p[i], p[(i + 1) % n], p[(i + 2) % n]) <= 0) return false;
  for (std::size_t i = 1; i + 1 < n; ++i)
    if (side(p[0], p[i], p[i + 1]) <= 0) return false;
  return true;
}

/// Corners of a polygon by the squares of a grid, about one to a square.
class CornerGrid {
 public:
  explicit CornerGrid(const std::vector<Point>& points) : points_(points) {
    constexpr double kHuge = std::numeric_limits<double>::infinity();
    Point high{-kHuge, -kHuge};
    low_ = {kHuge, kHuge};
    for (const Point& p : points) {
      low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    const double extent = std::max(high.x - low_.x, high.y - low_.y);
    squares_ = static_cast<int>(std::clamp(std::sqrt(static_cast<double>(points.size())), 1.0, 1000.0));
    per_length_ = extent > 0.0 ? squares_ / extent : 0.0;
    first_.assign(static_cast<std::size_t>(squares_) * static_cast<std::size_t>(squares_), kNone);
    next_.assign(points.size(), kNone);
    for (std::size_t i = points.size(); i-- > 0;) next_[i] = std::exchange(first_[square(points[i])], i);
  }

  void remove(std::size_t corner) {
    std::size_t* at = &first_[square(points_[corner])];
    while (*at != corner) at = &next_[*at];
    *at = next_[corner];
  }

  /// Whether `test` holds for a corner in the box around three points.
  template <class Test>
  bool any_around(const Point& a, const Point& b, const Point& c, Test&& test) const {
    const int x0 = place(std::min({a.x, b.x, c.x}) - low_.x), x1 = place(std::max({a.x, b.x, c.x}) - low_.x);
    const int y0 = place(std::min({a.y, b.y, c.y}) - low_.y), y1 = place(std::max({a.y, b.y, c.y}) - low_.y);
    for (int y = y0; y <= y1; ++y)
      for (int x = x0; x <= x1; ++x)
        for (std::size_t i = first_[static_cast<std::size_t>(y * squares_ + x)]; i != kNone; i = next_[i])
          if (test(i)) return true;
    return false;
  }

 private:
  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  int place(double length) const {
    const double squares = length * per_length_;
    return squares < squares_ ? static_cast<int>(squares) : squares_ - 1;  // NaN too: readers check coordinates later
  }
  std::size_t square(const Point& p) const {
    return static_cast<std::size_t>(place(p.y - low_.y) * squares_ + place(p.x - low_.x));
  }

  const std::vector<Point>& points_;
  Point low_{};
  int squares_ = 1;
  double per_length_ = 0.0;
  std::vector<std::size_t> first_, next_;
};

/// Cuts ears off a polygon: a corner and its two neighbours, whose triangle lies inside and holds no other corner. The
/// polygon may touch itself: a bridge to a hole runs there and back through the same corners, which stand twice. A
/// corner on the rim of an ear is in its way only if the polygon goes on from there into the ear. See D. Eberly,
/// "Triangulation by Ear Clipping" (2002), for polygons that do not touch themselves.
class EarCutter {
 public:
  EarCutter(std::span<const Index> polygon, const std::vector<Point>& flat)
      : polygon_(polygon), points_(flat), grid_(flat), before_(flat.size()), after_(flat.size()) {
    for (std::size_t i = 0; i < flat.size(); ++i) {
      after_[i] = (i + 1) % flat.size();
      before_[after_[i]] = i;
    }
  }

  /// @return false if the polygon crosses itself; what is left of it then is a fan
  bool cut(std::vector<Triangle>& out) {
    std::size_t left = points_.size(), at = 0, passed = 0;
    bool flat_too = false;  // flat ears only where there are no others: no other triangle then has their edge
    while (left > 3) {
      if (is_ear(at, flat_too)) {
        push(at, out);
        grid_.remove(at);
        after_[before_[at]] = after_[at];
        before_[after_[at]] = before_[at];
        at = after_[after_[at]];  // ears side by side would make a fan of slivers
        --left;
        passed = 0;
        flat_too = false;
        continue;
      }
      at = after_[at];
      if (++passed < left) continue;
      if (flat_too) break;
      flat_too = true;
      passed = 0;
    }
    const bool whole = left == 3 && side(points_[before_[at]], points_[at], points_[after_[at]]) >= 0;
    for (; left >= 3; --left) {
      push(at, out);
      after_[before_[at]] = after_[at];
      before_[after_[at]] = before_[at];
      at = after_[at];
    }
    return whole;
  }

 private:
  void push(std::size_t at, std::vector<Triangle>& out) const {
    out.push_back({polygon_[before_[at]], polygon_[at], polygon_[after_[at]]});
  }

  bool is_ear(std::size_t at, bool flat_too) const {
    const std::size_t from = before_[at], to = after_[at];
    const Point &a = points_[from], &b = points_[at], &c = points_[to];
    const int turn = side(a, b, c);
    if (flat_too && turn == 0) return true;
    if (turn <= 0) return false;
    return !grid_.any_around(a, b, c, [&](std::size_t i) { return i != at && is_in_way(i, a, b, c, flat_too); });
  }

  /// Whether the triangle a b c cannot be cut off because of corner i. @pre a b c turns left
  bool is_in_way(std::size_t i, const Point& a, const Point& b, const Point& c, bool touching_too) const {
    const Point& p = points_[i];
    if (p == a) return enters(i, c, b);
    if (p == b) return enters(i, a, c);
    if (p == c) return enters(i, b, a);
    const int ab = side(a, b, p), bc = side(b, c, p), ca = side(c, a, p);
    if (ab < 0 || bc < 0 || ca < 0) return false;
    if (ca == 0) return !touching_too || enters(i, c, a);
    if (ab == 0) return enters(i, a, b);
    if (bc == 0) return enters(i, b, c);
    return true;
  }

  /// Whether the polygon goes from corner i, before it or after it, into the open angle that lies left of the direction
  /// to `right` and right of the direction to `left`.
  bool enters(std::size_t i, const Point& left, const Point& right) const {
    return lies_between(points_[before_[i]], points_[i], left, right) ||
           lies_between(points_[after_[i]], points_[i], left, right);
  }
  static bool lies_between(const Point& q, const Point& at, const Point& left, const Point& right) {
    if (side(left, at, right) == 0) return side(left, right, q) > 0;  // `at` is on the edge from left to right
    return side(at, right, q) > 0 && side(at, left, q) < 0;
  }

  std::span<const Index> polygon_;
  const std::vector<Point>& points_;
  CornerGrid grid_;  ///< corners that are left
  std::vector<std::size_t> before_, after_;
};

}  // namespace

Triangulation triangulated(const Polygons& polygons, std::span<const Vec3> vertices) {
  Triangulation out;
  out.triangles.reserve(polygons.size());
  for (std::size_t i = 0; i < polygons.size(); ++i) {
    const auto polygon = polygons[i];
    if (polygon.size() < 3) continue;
    const auto flat = polygon.size() == 3 ? std::vector<Point>() : flattened(polygon, vertices);
    if (polygon.size() == 3 || is_fan(flat)) {
      for (std::size_t c = 2; c < polygon.size(); ++c)
        out.triangles.push_back({polygon[0], polygon[c - 1], polygon[c]});
    } else if (!EarCutter(polygon, flat).cut(out.triangles)) {
      ++out.crossing_polygons;
    }
  }
  return out;
}

}  // namespace limber::internal
