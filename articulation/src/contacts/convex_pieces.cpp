#include "contacts/convex_pieces.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "tuning.h"

namespace limber::internal {
namespace {

const Vec3& corner(const SurfaceMesh& surface, Index triangle, int k) {
  return surface.vertices[static_cast<std::size_t>(surface.triangles[static_cast<std::size_t>(triangle)][k])];
}

Vec3 centre(const SurfaceMesh& surface, Index t) {
  return (corner(surface, t, 0) + corner(surface, t, 1) + corner(surface, t, 2)) / 3.0;
}

/// How far corners stand out from the planes of triangles at most; a convex surface has 0. With many, every so-manieth
/// is looked at.
double concavity_of(const SurfaceMesh& surface, std::span<const Index> piece) {
  const std::size_t stride = 1 + piece.size() / tuning().contacts.inside.hull_compared;
  double most = 0.0;
  for (std::size_t i = 0; i < piece.size(); i += stride) {
    const Vec3& a = corner(surface, piece[i], 0);
    const Vec3 normal = (corner(surface, piece[i], 1) - a).cross(corner(surface, piece[i], 2) - a).stableNormalized();
    for (std::size_t j = 0; j < piece.size(); j += stride)
      for (int k = 0; k < 3; ++k) most = std::max(most, normal.dot(corner(surface, piece[j], k) - a));
  }
  return most;
}

/// Orders triangles along an axis; returns how many lie in the first half of their box.
std::size_t halve(const SurfaceMesh& surface, std::span<Index> piece, int axis) {
  double low = centre(surface, piece[0])[axis], high = low;
  for (const Index t : piece)
    low = std::min(low, centre(surface, t)[axis]), high = std::max(high, centre(surface, t)[axis]);
  const double middle = 0.5 * (low + high);
  const auto second =
      std::stable_partition(piece.begin(), piece.end(), [&](Index t) { return centre(surface, t)[axis] < middle; });
  return static_cast<std::size_t>(second - piece.begin());
}

/// Cuts where the two halves are the least concave. @return the size of the first; 0 if no cut parts the triangles
std::size_t best_cut(const SurfaceMesh& surface, std::span<Index> piece) {
  int best = -1;
  double least = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t first = halve(surface, piece, axis);
    if (first == 0 || first == piece.size()) continue;
    const double left = concavity_of(surface, piece.first(first)), right = concavity_of(surface, piece.subspan(first));
    if (best < 0 || left + right < least) best = axis, least = left + right;
  }
  return best < 0 ? 0 : halve(surface, piece, best);
}

/// By Gilbert's iteration (1966): the nearest point of the hull known so far moves toward the corner that lies furthest
/// on the way to p, until either bound of the distance tells.
bool within_hull(const Vec3& p, const std::vector<Vec3>& corners, double distance) {
  Vec3 nearest = corners.front();
  for (std::size_t step = 0; step < tuning().contacts.inside.hull_steps; ++step) {
    const Vec3 v = p - nearest;
    const double length = v.norm();
    if (length <= distance) return true;
    const Vec3* furthest = &corners.front();
    for (const Vec3& c : corners)
      if (v.dot(c) > v.dot(*furthest)) furthest = &c;
    if (v.dot(p - *furthest) > distance * length) return false;
    const Vec3 way = *furthest - nearest;
    const double squared = way.squaredNorm();
    if (!(squared > 0.0)) return false;
    nearest += std::clamp(v.dot(way) / squared, 0.0, 1.0) * way;
  }
  return true;  // the bounds have come close to each other, and so to the distance asked for
}

}  // namespace

ConvexPieces::ConvexPieces(const SurfaceMesh& surface, double concavity) {
  std::vector<Index> order(surface.triangles.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::vector<std::span<Index>> open{order};
  while (!open.empty()) {
    const std::span<Index> piece = open.back();
    open.pop_back();
    if (piece.empty()) continue;
    const std::size_t first =
        piece.size() > 1 && concavity_of(surface, piece) > concavity ? best_cut(surface, piece) : 0;
    if (first > 0) {
      open.push_back(piece.subspan(first));
      open.push_back(piece.first(first));
      continue;
    }
    std::vector<Index> used;
    for (const Index t : piece)
      for (const Index v : surface.triangles[static_cast<std::size_t>(t)]) used.push_back(v);
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    Piece made;
    for (const Index v : used) {
      made.corners.push_back(surface.vertices[static_cast<std::size_t>(v)]);
      made.box.extend(made.corners.back());
    }
    pieces_.push_back(std::move(made));
  }
}

bool ConvexPieces::hold(const Vec3& p, double growth) const {
  return std::any_of(pieces_.begin(), pieces_.end(), [&](const Piece& piece) {
    return piece.box.squaredExteriorDistance(p) <= growth * growth && within_hull(p, piece.corners, growth);
  });
}

}  // namespace limber::internal
