#include "shells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace limber::assemblies {
namespace {

using Point = Eigen::Vector2d;

double turn(const Point& a, const Point& b, const Point& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

bool cross(const Point& a, const Point& b, const Point& c, const Point& d) {
  const double ab_c = turn(a, b, c), ab_d = turn(a, b, d), cd_a = turn(c, d, a), cd_b = turn(c, d, b);
  return ab_c * ab_d < 0.0 && cd_a * cd_b < 0.0;
}

/// Indices of an outline with bridges to its holes: one loop that visits the bridges' ends twice.
std::vector<int> bridged(const std::vector<Point>& points, const std::vector<std::vector<int>>& loops) {
  std::vector<int> outline = loops[0];
  for (std::size_t h = 1; h < loops.size(); ++h) {
    const auto& hole = loops[h];
    double best = std::numeric_limits<double>::infinity();
    std::size_t best_i = 0, best_j = 0;
    const auto blocked = [&](const Point& p, const Point& q) {
      const auto by = [&](const std::vector<int>& loop) {
        for (std::size_t k = 0; k < loop.size(); ++k)
          if (cross(p, q, points[loop[k]], points[loop[(k + 1) % loop.size()]])) return true;
        return false;
      };
      return by(outline) || std::any_of(loops.begin() + 1, loops.end(), by);
    };
    for (std::size_t i = 0; i < outline.size(); ++i)
      for (std::size_t j = 0; j < hole.size(); ++j) {
        const double d = (points[outline[i]] - points[hole[j]]).norm();
        if (d < best && !blocked(points[outline[i]], points[hole[j]])) best = d, best_i = i, best_j = j;
      }
    std::vector<int> detour;
    for (std::size_t k = 0; k <= hole.size(); ++k)
      detour.push_back(hole[(best_j + hole.size() - k) % hole.size()]);  // holes are run through clockwise
    detour.push_back(outline[best_i]);
    outline.insert(outline.begin() + static_cast<std::ptrdiff_t>(best_i) + 1, detour.begin(), detour.end());
  }
  return outline;
}

std::vector<Triangle> ears(const std::vector<Point>& points, std::vector<int> left) {
  std::vector<Triangle> out;
  while (left.size() > 2) {
    const std::size_t n = left.size();
    std::size_t ear = n;
    double best = -1.0;
    for (std::size_t i = 0; i < n; ++i) {  // of all ears the roundest
      const int a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
      const double area = turn(points[a], points[b], points[c]);
      if (area <= 0.0) continue;
      const double longest = std::max({(points[a] - points[b]).squaredNorm(), (points[b] - points[c]).squaredNorm(),
                                       (points[c] - points[a]).squaredNorm()});
      if (area / longest <= best) continue;
      const bool empty = std::none_of(left.begin(), left.end(), [&](int q) {
        if (points[q] == points[a] || points[q] == points[b] || points[q] == points[c]) return false;
        return turn(points[a], points[b], points[q]) >= 0.0 && turn(points[b], points[c], points[q]) >= 0.0 &&
               turn(points[c], points[a], points[q]) >= 0.0;
      });
      if (empty) best = area / longest, ear = i;
    }
    if (ear == n) throw std::logic_error("ears: the outline crosses itself");
    out.push_back({left[(ear + n - 1) % n], left[ear], left[(ear + 1) % n]});
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(ear));
  }
  return out;
}

}  // namespace

Shell Shell::placed(const Mat3& R, const Vec3& t) const {
  Shell out = *this;
  for (Vec3& v : out.vertices) v = R * v + t;
  return out;
}

Shell lathe(const Loop& profile, int segments, double phase, const std::vector<char>& idle) {
  Shell out;
  std::vector<std::vector<Index>> ring(profile.size());
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const bool on_axis = profile[i].x() == 0.0;
    const auto first = static_cast<Index>(out.vertices.size());
    for (int s = 0; s < segments; ++s) {
      ring[i].push_back(on_axis ? first : first + s);
      if (on_axis && s > 0) continue;
      const double angle = 2.0 * kPi * (s + phase) / segments;
      out.vertices.emplace_back(profile[i].x() * std::cos(angle), profile[i].x() * std::sin(angle), profile[i].y());
    }
  }
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const std::size_t j = (i + 1) % profile.size();
    for (int s = 0; s < segments; ++s) {
      const int n = (s + 1) % segments;
      const Index a = ring[i][s], b = ring[i][n], c = ring[j][n], d = ring[j][s];
      for (const Triangle& t : {Triangle{a, b, c}, Triangle{a, c, d}}) {
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
        out.triangles.push_back(t);
        out.idle.push_back(i < idle.size() ? idle[i] : 0);
      }
    }
  }
  return out;
}

Shell extrusion(const Loop& outline, const std::vector<Loop>& holes, double z0, double z1) {
  std::vector<Point> points;
  std::vector<std::vector<int>> loops;
  const auto add = [&](const Loop& loop) {
    loops.emplace_back();
    for (const Point& p : loop) {
      loops.back().push_back(static_cast<int>(points.size()));
      points.push_back(p);
    }
  };
  add(outline);
  for (const Loop& hole : holes) add(hole);
  const int n = static_cast<int>(points.size());

  Shell out;
  for (const double z : {z0, z1})
    for (const Point& p : points) out.vertices.emplace_back(p.x(), p.y(), z);
  for (const Triangle& t : ears(points, bridged(points, loops))) {
    out.triangles.push_back({t[0], t[2], t[1]});
    out.triangles.push_back({t[0] + n, t[1] + n, t[2] + n});
  }
  for (std::size_t l = 0; l < loops.size(); ++l)
    for (std::size_t k = 0; k < loops[l].size(); ++k) {
      int a = loops[l][k], b = loops[l][(k + 1) % loops[l].size()];
      if (l > 0) std::swap(a, b);
      out.triangles.push_back({a, b, b + n});
      out.triangles.push_back({a, b + n, a + n});
    }
  out.idle.assign(out.triangles.size(), 0);
  return out;
}

Shell box(const Vec3& low, const Vec3& high) {
  return extrusion(rectangle(low[0], low[1], high[0], high[1]), {}, low[2], high[2]);
}

Shell sphere(double radius, int segments, double phase) {
  Loop profile;
  const int steps = segments / 2;
  for (int i = 0; i <= steps; ++i) {
    const double angle = -kPi / 2.0 + kPi * i / steps;
    profile.emplace_back(i == 0 || i == steps ? 0.0 : radius * std::cos(angle), radius * std::sin(angle));
  }
  return lathe(profile, segments, phase);
}

namespace {

/// Corners of a thread's section on one side of the axis, from the lower end to the upper.
struct ThreadColumn {
  std::vector<Index> vertex;
  std::vector<int> helix;  ///< which helix each lies on: even the crests, odd the roots; the ends: kLower, kUpper
  static constexpr int kLower = std::numeric_limits<int>::min(), kUpper = std::numeric_limits<int>::max();
};

/// Closes the strip between two columns; what lies on the same helix is joined. @param shift of b's numbers
template <class Push>
void zip(const ThreadColumn& a, const ThreadColumn& b, int shift, Push&& push) {
  const auto number = [shift](const ThreadColumn& c, std::size_t i, bool shifted) {
    const bool end = c.helix[i] == ThreadColumn::kLower || c.helix[i] == ThreadColumn::kUpper;
    return end || !shifted ? c.helix[i] : c.helix[i] + shift;
  };
  std::size_t i = 0, k = 0;
  while (i + 1 < a.vertex.size() || k + 1 < b.vertex.size()) {
    const int next_a = number(a, std::min(i + 1, a.vertex.size() - 1), false),
              next_b = number(b, std::min(k + 1, b.vertex.size() - 1), true);
    if (next_b <= next_a && k + 1 < b.vertex.size()) push(a.vertex[i], b.vertex[k], b.vertex[k + 1]), ++k;
    if (next_a <= next_b && i + 1 < a.vertex.size()) push(a.vertex[i], b.vertex[k], a.vertex[i + 1]), ++i;
  }
}

}  // namespace

Shell thread(double radius, double depth, double pitch, double z0, double z1, int segments, double phase, bool nut,
             double outer) {
  // Flanks between helices, as a CAD program meshes them: every edge along the thread lies on a crest or a root.
  const double lead = 2.0 * kPi * std::abs(pitch);
  Shell out;
  std::vector<ThreadColumn> columns;
  for (int s = 0; s < segments; ++s) {
    const double angle = 2.0 * kPi * (s + phase) / segments;
    ThreadColumn& column = columns.emplace_back();
    const auto add = [&](double z, int helix) {
      const double u = (z - pitch * angle) / lead, saw = u - std::floor(u);
      const double r = radius + depth * (std::abs(2.0 * saw - 1.0) - 0.5);
      column.vertex.push_back(static_cast<Index>(out.vertices.size()));
      column.helix.push_back(helix);
      out.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    };
    const double sliver = 1e-3;  // of half a lead
    const double low = 2.0 * (z0 - pitch * angle) / lead + sliver, high = 2.0 * (z1 - pitch * angle) / lead - sliver;
    add(z0, ThreadColumn::kLower);
    for (int j = static_cast<int>(std::ceil(low)); j < high; ++j) add(0.5 * j * lead + pitch * angle, j);
    add(z1, ThreadColumn::kUpper);
  }
  const auto push = [&](Index a, Index b, Index c) {
    out.triangles.push_back(nut ? Triangle{a, c, b} : Triangle{a, b, c});
  };
  const auto column = [&](int s) -> const ThreadColumn& { return columns[static_cast<std::size_t>(s % segments)]; };
  for (int s = 0; s < segments; ++s)  // after a full turn the helices are one thread further
    zip(column(s), column(s + 1), s + 1 < segments ? 0 : (pitch > 0.0 ? -2 : 2), push);
  const auto low = [&](int s) { return column(s).vertex.front(); };
  const auto high = [&](int s) { return column(s).vertex.back(); };
  const auto far = [&](double z, double r) {
    const auto first = static_cast<Index>(out.vertices.size());
    for (int s = 0; s < segments; ++s) {
      const double angle = 2.0 * kPi * (s + phase) / segments;
      out.vertices.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
    }
    return first;
  };
  if (nut) {  // flat ends and an outer wall, which look outward as they stand
    const Index below = far(z0, outer), above = far(z1, outer);
    for (int k = 0; k < segments; ++k) {
      const int n = (k + 1) % segments;
      const Index quads[3][4] = {{low(k), low(n), below + n, below + k},
                                 {high(n), high(k), above + k, above + n},
                                 {below + k, below + n, above + n, above + k}};
      for (const auto& q : quads) {
        out.triangles.push_back({q[0], q[1], q[2]});
        out.triangles.push_back({q[0], q[2], q[3]});
      }
    }
  } else {
    const auto centre = static_cast<Index>(out.vertices.size());
    out.vertices.emplace_back(0.0, 0.0, z0);
    out.vertices.emplace_back(0.0, 0.0, z1);
    for (int s = 0; s < segments; ++s) {
      push(centre, low(s + 1), low(s));
      push(centre + 1, high(s), high(s + 1));
    }
  }
  out.idle.assign(out.triangles.size(), 0);
  return out;
}

Loop circle(double radius, int segments, double phase, const Eigen::Vector2d& centre) {
  Loop out;
  for (int s = 0; s < segments; ++s) {
    const double angle = 2.0 * kPi * (s + phase) / segments;
    out.push_back(centre + radius * Point(std::cos(angle), std::sin(angle)));
  }
  return out;
}

Loop rectangle(double x0, double y0, double x1, double y1) { return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}; }

Loop stadium(double radius, double x0, double x1, int segments) {
  Loop out;
  for (int s = 0; s <= segments / 2; ++s) {
    const double angle = -kPi / 2.0 + 2.0 * kPi * s / segments;
    out.push_back(Point(x1, 0.0) + radius * Point(std::cos(angle), std::sin(angle)));
  }
  for (int s = 0; s <= segments / 2; ++s) {
    const double angle = kPi / 2.0 + 2.0 * kPi * s / segments;
    out.push_back(Point(x0, 0.0) + radius * Point(std::cos(angle), std::sin(angle)));
  }
  return out;
}

}  // namespace limber::assemblies
