#include "types/common_line.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "tuning.h"

namespace limber::internal {
namespace {

using Flat = Eigen::Vector2d;

/// A bend seen along the direction: its normal's line in the plane.
struct NormalLine {
  Flat point, across;  // across the normal, unit
  double weight = 0.0;

  double distance(const Flat& c) const { return across.dot(c - point); }
};

/// The heaviest lines of what lies near. A bend weighs by how far it looks across the line: a face that looks along it
/// tells nothing of it.
std::vector<NormalLine> lines_near(const std::vector<Bend>& bends, const Eigen::Matrix<double, 3, 2>& plane,
                                   const Vec3& middle, double radius) {
  const std::size_t most = tuning().types.line.compared;
  std::vector<NormalLine> out;
  for (const Bend& bend : bends) {
    const Vec3 from = bend.point - middle;
    const Flat n = plane.transpose() * bend.normal;
    if (from.squaredNorm() > radius * radius || n.isZero()) continue;
    out.push_back({plane.transpose() * from, Flat(-n.y(), n.x()) / n.norm(), bend.weight * n.squaredNorm()});
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const NormalLine& x, const NormalLine& y) { return x.weight > y.weight; });
  if (out.size() > most) out.resize(most);
  return out;
}

/// What of the lines passes a point.
struct Passing {
  double weight = 0.0;
  Eigen::Matrix2d across = Eigen::Matrix2d::Zero();  // Σ w across acrossᵀ
  Flat along = Flat::Zero();                         // Σ w across (across · point)

  void add(const NormalLine& line) {
    weight += line.weight;
    across += line.weight * line.across * line.across.transpose();
    along += line.weight * line.across * line.across.dot(line.point);
  }
  /// Whether the lines come from sides that differ enough to tell where they meet.
  bool tells() const {
    const Flat parts =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>().computeDirect(across, Eigen::EigenvaluesOnly).eigenvalues();
    return parts[0] > tuning().types.line.least_turn * weight;
  }
};

Passing passing(const std::vector<NormalLine>& lines, const Flat& c, double off) {
  Passing out;
  for (const NormalLine& line : lines)
    if (std::abs(line.distance(c)) < off) out.add(line);
  return out;
}

std::optional<Flat> crossing(const NormalLine& x, const NormalLine& y) {
  Eigen::Matrix2d rows;
  rows << x.across.transpose(), y.across.transpose();
  const double sine = rows.determinant();
  if (sine == 0.0) return std::nullopt;
  return Flat(rows.inverse() * Flat(x.across.dot(x.point), y.across.dot(y.point)));
}

}  // namespace

std::vector<Bend> bends_of(const SurfaceMesh& surface, double crease_angle) {
  struct Side {
    Index low, high, triangle;
  };
  std::vector<Side> sides;
  std::vector<Vec3> normals;
  for (const Triangle& t : surface.triangles) {
    const Vec3 &p = surface.vertices[t[0]], &q = surface.vertices[t[1]], &r = surface.vertices[t[2]];
    const auto triangle = static_cast<Index>(normals.size());
    normals.push_back(0.5 * (q - p).cross(r - p));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [low, high] = std::minmax(t[k], t[(k + 1) % 3]);
      sides.push_back({low, high, triangle});
    }
  }
  std::stable_sort(sides.begin(), sides.end(),
                   [](const Side& x, const Side& y) { return std::pair(x.low, x.high) < std::pair(y.low, y.high); });
  std::vector<Bend> out;
  for (std::size_t i = 1; i < sides.size(); ++i) {
    const Side &x = sides[i - 1], &y = sides[i];
    if (x.low != y.low || x.high != y.high) continue;
    const Vec3 &m = normals[static_cast<std::size_t>(x.triangle)], &n = normals[static_cast<std::size_t>(y.triangle)];
    if (m.isZero() || n.isZero()) continue;
    const double bent = std::atan2(m.cross(n).norm(), m.dot(n));
    if (!(bent > 0.0) || bent > crease_angle) continue;
    out.push_back({0.5 * (surface.vertices[x.low] + surface.vertices[x.high]),
                   (m.normalized() + n.normalized()).normalized(), bent * (m.norm() + n.norm())});
  }
  return out;
}

std::optional<Vec3> common_line(const std::vector<Bend>& a, const std::vector<Bend>& b, const Vec3& direction,
                                const Vec3& middle, double radius) {
  Eigen::Matrix<double, 3, 2> plane;
  plane.col(0) = direction.unitOrthogonal();
  plane.col(1) = direction.cross(plane.col(0));
  const std::array lines{lines_near(a, plane, middle, radius), lines_near(b, plane, middle, radius)};
  const double off = tuning().types.line.off * radius;
  double most = 0.0;
  std::optional<Flat> found;  // the point from which the squares of distances to these lines are least
  for (const auto& some : lines)
    for (std::size_t i = 0; i < std::min(some.size(), tuning().types.line.paired); ++i)
      for (std::size_t j = 0; j < i; ++j) {
        const auto c = crossing(some[i], some[j]);
        if (!c) continue;
        const Passing on_a = passing(lines[0], *c, off);
        if (on_a.weight <= most || !on_a.tells()) continue;
        const Passing on_b = passing(lines[1], *c, off);
        if (on_b.weight <= most || !on_b.tells()) continue;
        most = std::min(on_a.weight, on_b.weight);
        found = (on_a.across + on_b.across).ldlt().solve(on_a.along + on_b.along);
      }
  if (!found) return std::nullopt;
  return Vec3(middle + plane * *found);
}

}  // namespace limber::internal
