#include "ranges/orbit_samples.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "constants.h"
#include "limber/mesh/closest_point.h"
#include "tuning.h"

namespace limber::internal {
namespace {

/// Area that can touch.
double area(const OrbitFace& f) {
  if (f.cap) return 0.0;
  return 0.5 * (f.corners[1] - f.corners[0]).cross(f.corners[2] - f.corners[0]).norm();
}

Vec3 nearest_point(const OrbitFace& f, const Vec3& q) { return closest_on_triangle(q, f.corners).point; }

/// Running sums of a measure, for points at even distances along it.
template <class Items, class Measure>
std::vector<double> running_sums(const Items& items, Measure&& measure) {
  std::vector<double> sums;
  sums.reserve(items.size());
  double sum = 0.0;
  for (const auto& item : items) sums.push_back(sum += measure(item));
  return sums;
}

std::size_t at_measure(const std::vector<double>& sums, double measure) {
  const auto found = std::upper_bound(sums.begin(), sums.end(), measure);
  return std::min(static_cast<std::size_t>(found - sums.begin()), sums.size() - 1);
}

}  // namespace

SampledSurface::SampledSurface(std::span<const OrbitBody> bodies, std::vector<OrbitFace> faces, int count)
    : faces_(std::move(faces)) {
  if (faces_.empty()) return;
  around_ = FacesAround(faces_);
  add_face_points(count);
  add_edge_points(sharp_edges(bodies), std::max(count / static_cast<int>(tuning().ranges.points.edge_points), 1));
}

Vec3 SampledSurface::corner(Index face, Index vertex) const {
  const OrbitFace& f = faces_[static_cast<std::size_t>(face)];
  return f
      .corners[static_cast<std::size_t>(std::find(f.vertices.begin(), f.vertices.end(), vertex) - f.vertices.begin())];
}

std::vector<SampledSurface::Edge> SampledSurface::sharp_edges(std::span<const OrbitBody> bodies) const {
  std::vector<Edge> sharp;
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    if (faces_[f].cap) continue;
    const OrbitBody& body = bodies[static_cast<std::size_t>(faces_[f].body)];
    const Triangle& own = body.triangle(static_cast<std::size_t>(faces_[f].triangle));
    const auto number = [&](Index vertex) {
      const auto i = static_cast<std::size_t>(std::find(own.begin(), own.end(), vertex) - own.begin());
      return faces_[f].vertices[faces_[f].flipped && i > 0 ? 3 - i : i];
    };
    const auto& edges = *body.sharp;
    for (auto e = std::lower_bound(edges.begin(), edges.end(), faces_[f].triangle,
                                   [](const SharpEdge&x, Index triangle) { return x.triangle < triangle; });
         e != edges.end() && e->triangle == faces_[f].triangle; ++e) {
      const auto [a, b] = std::minmax({number(e->a), number(e->b)});
      sharp.push_back({a, b, static_cast<Index>(f)});
    }
  }
  std::sort(sharp.begin(), sharp.end(),
            [](const Edge& x, const Edge& y) { return std::tie(x.a, x.b, x.face) < std::tie(y.a, y.b, y.face); });
  const auto same = [](const Edge& x, const Edge& y) { return x.a == y.a && x.b == y.b; };
  sharp.erase(std::unique(sharp.begin(), sharp.end(), same), sharp.end());
  return sharp;
}

void SampledSurface::add_face_points(int count) {
  const std::vector<double> sums = running_sums(faces_, area);
  const double total = sums.back();
  spacing_ = std::sqrt(total / count);
  // The R2 sequence covers a square evenly; folding the square covers a triangle.
  for (int i = 0; i < count && total > 0.0; ++i) {
    const std::size_t f = at_measure(sums, total * (i + 0.5) / count);
    double u = std::fmod((i + 1) * kEvenFirst, 1.0), v = std::fmod((i + 1) * kEvenSecond, 1.0);
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    const auto& c = faces_[f].corners;
    points_.push_back({c[0] + u * (c[1] - c[0]) + v * (c[2] - c[0]), static_cast<Index>(f)});
  }
}

void SampledSurface::add_edge_points(const std::vector<Edge>& edges, int count) {
  if (edges.empty()) return;
  const auto ends = [&](const Edge& e) { return std::pair(corner(e.face, e.a), corner(e.face, e.b)); };
  const std::vector<double> sums = running_sums(edges, [&](const Edge& e) {
    const auto [a, b] = ends(e);
    return (b - a).norm();
  });
  for (int i = 0; i < count; ++i) {
    const double along = sums.back() * (i + 0.5) / count;
    const std::size_t k = at_measure(sums, along);
    const auto [a, b] = ends(edges[k]);
    const double length = (b - a).norm();
    points_.push_back({length > 0.0 ? Vec3(b + (along - sums[k]) / length * (b - a)) : a, edges[k].face});
  }
  add_corner_points(edges, static_cast<int>(tuning().ranges.points.corner_points) * count);
}

void SampledSurface::add_corner_points(const std::vector<Edge>& edges, int most) {
  std::vector<std::pair<Index, Index>> corners;  // vertex and face
  for (const Edge& e : edges) corners.insert(corners.end(), {{e.a, e.face}, {e.b, e.face}});
  std::sort(corners.begin(), corners.end());
  const auto same = [](const auto& x, const auto& y) { return x.first == y.first; };
  corners.erase(std::unique(corners.begin(), corners.end(), same), corners.end());
  const std::size_t stride = 1 + corners.size() / static_cast<std::size_t>(most);
  for (std::size_t k = 0; k < corners.size(); k += stride)
    points_.push_back({corner(corners[k].second, corners[k].first), corners[k].second});
}

SurfaceSample SampledSurface::walk(const SurfaceSample& start, const Vec3& target) const {
  SurfaceSample here{nearest_point(faces_[static_cast<std::size_t>(start.face)], target), start.face};
  for (std::size_t step = 0; step < tuning().ranges.points.walked_faces; ++step) {
    SurfaceSample best = here;
    for (const Index v : faces_[static_cast<std::size_t>(here.face)].vertices)
      for (const Index f : around_.of(v)) {
        const Vec3 p = nearest_point(faces_[static_cast<std::size_t>(f)], target);
        if ((p - target).squaredNorm() < (best.p - target).squaredNorm()) best = {p, f};
      }
    if (best.face == here.face) break;
    here = best;
  }
  return here;
}

}  // namespace limber::internal
