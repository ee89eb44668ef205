#include "near_samples.h"

#include <algorithm>
#include <cmath>
#include <queue>

namespace limber {
namespace {

/// A part of a triangle.
struct Piece {
  double radius;  ///< about its centre
  Index triangle;
  std::array<Vec3, 3> corner;  ///< barycentric

  bool operator<(const Piece& o) const { return radius < o.radius; }
  Vec3 centre() const { return (corner[0] + corner[1] + corner[2]) / 3.0; }
  /// Of the whole triangle's area.
  double share() const {
    Mat3 m;
    m << corner[0], corner[1], corner[2];
    return std::abs(m.determinant());
  }
};

/// Cuts a surface down to what is near another.
class NearPart {
 public:
  NearPart(const SmoothSurface& surface, const SmoothSurface& other, double reach)
      : surface_(surface), other_(other), reach_(reach) {}

  std::vector<Piece> pieces(std::size_t most) {
    Eigen::AlignedBox3d box = other_.tree().box();
    box.min().array() -= reach_;
    box.max().array() += reach_;
    for (std::size_t t = 0; t < surface_.mesh().triangles.size(); ++t) {
      Eigen::AlignedBox3d own;
      for (const Index v : surface_.mesh().triangles[t])
        own.extend(surface_.mesh().vertices[static_cast<std::size_t>(v)]);
      if (!box.intersects(own)) continue;
      push(Piece{0.0, static_cast<Index>(t), {Vec3::UnitX(), Vec3::UnitY(), Vec3::UnitZ()}});
    }
    while (!queue_.empty() && queue_.size() < most && queue_.top().radius > 0.25 * reach_) {
      const Piece piece = queue_.top();
      queue_.pop();
      halve(piece);
    }
    std::vector<Piece> out;
    for (; !queue_.empty(); queue_.pop()) out.push_back(queue_.top());
    std::sort(out.begin(), out.end(), [](const Piece& a, const Piece& b) {
      if (a.triangle != b.triangle) return a.triangle < b.triangle;
      const Vec3 x = a.centre(), y = b.centre();
      return std::lexicographical_compare(x.begin(), x.end(), y.begin(), y.end());
    });
    return out;
  }

 private:
  /// Keeps the piece if some of it may be near enough and face the other surface.
  void push(Piece piece) {
    const Vec3 centre = surface_.point(piece.triangle, piece.centre());
    piece.radius = 0.0;
    for (const Vec3& c : piece.corner)
      piece.radius = std::max(piece.radius, (surface_.point(piece.triangle, c) - centre).norm());
    constexpr double kLooseFacing = -0.5;  // of facets; the smooth normals decide later
    if (other_.tree()
            .nearest(centre, reach_ + piece.radius, surface_.tree().normal(piece.triangle), kLooseFacing)
            .found())
      queue_.push(piece);
  }

  void halve(const Piece& piece) {
    std::size_t longest = 0;
    double most = -1.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double length =
          (surface_.point(piece.triangle, piece.corner[k]) - surface_.point(piece.triangle, piece.corner[(k + 1) % 3]))
              .squaredNorm();
      if (length > most) most = length, longest = k;
    }
    const std::size_t next = (longest + 1) % 3;
    const Vec3 middle = 0.5 * (piece.corner[longest] + piece.corner[next]);
    for (const std::size_t replaced : {longest, next}) {
      Piece half = piece;
      half.corner[replaced] = middle;
      push(half);
    }
  }

  const SmoothSurface& surface_;
  const SmoothSurface& other_;
  double reach_;
  std::priority_queue<Piece> queue_;
};

/// The i-th of a sequence that fills the unit square evenly (the plastic number's powers; Roberts 2018).
Eigen::Vector2d even_point(std::size_t i) {
  constexpr double kA = 0.7548776662466927, kB = 0.5698402909980532;
  const double x = 0.5 + kA * static_cast<double>(i + 1), y = 0.5 + kB * static_cast<double>(i + 1);
  return {x - std::floor(x), y - std::floor(y)};
}

Vec3 even_barycentric(const Piece& piece, std::size_t i) {
  Eigen::Vector2d u = even_point(i);
  if (u.sum() > 1.0) u = Eigen::Vector2d::Ones() - u;
  return piece.corner[0] + u[0] * (piece.corner[1] - piece.corner[0]) + u[1] * (piece.corner[2] - piece.corner[0]);
}

}  // namespace

std::vector<NearSample> near_samples(const SmoothSurface& surface, const SmoothSurface& other, double reach,
                                     double facing_cosine, int wanted) {
  const auto pieces = NearPart(surface, other, reach).pieces(static_cast<std::size_t>(wanted));
  double total = 0.0;
  std::vector<double> area;
  for (const Piece& p : pieces) area.push_back(p.share() * surface.area(p.triangle)), total += area.back();

  std::vector<NearSample> out;
  const double step = total / wanted;
  double covered = 0.0;
  std::size_t i = 0;
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    covered += area[p];
    for (; (static_cast<double>(i) + 0.5) * step < covered && i < static_cast<std::size_t>(wanted); ++i) {
      const Vec3 barycentric = even_barycentric(pieces[p], i);
      const Vec3 point = surface.point(pieces[p].triangle, barycentric);
      const Vec3 normal = surface.normal(pieces[p].triangle, barycentric);
      constexpr double kFacetFacing = -0.6;  // facets may bend from the smooth normals by half a segment on each side
      const auto facing = other.tree().nearest(point, reach, normal, kFacetFacing);
      if (!facing.found()) continue;
      const Vec3 facing_normal = other.normal(facing.triangle, facing.barycentric);
      if (normal.dot(facing_normal) > facing_cosine) continue;
      out.push_back({{point, normal, facing.point, facing_normal, step, (point - facing.point).dot(facing_normal)},
                     facing.distance,
                     std::max(surface.chord_error(pieces[p].triangle), other.chord_error(facing.triangle))});
    }
  }
  return out;
}

}  // namespace limber
