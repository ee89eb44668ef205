#include "manifold/mesh_facets.h"

#include <algorithm>

#include "limber/mesh/closest_point.h"
#include "tuning.h"

namespace limber::internal {
namespace {

TrianglePoints corners(const CollisionSurface& s, Index t) {
  const auto& [a, b, c] = s.triangle(t);
  return {s.rest(a), s.rest(b), s.rest(c)};
}

/// The facet of all, or −1.
template <class Triangles>
Index common_facet(const Triangles& triangles, const MeshFacets& facets) {
  if (triangles.empty()) return -1;
  const Index first = facets.facet(triangles.front());
  const bool one = std::all_of(triangles.begin(), triangles.end(), [&](Index t) { return facets.facet(t) == first; });
  return one ? first : -1;
}

}  // namespace

MeshFacets::MeshFacets(const CollisionSurface& surface) {
  normal_.reserve(static_cast<std::size_t>(surface.triangles()));
  for (Index t = 0; t < surface.triangles(); ++t) normal_.push_back(unit_normal(corners(surface, t)));
  grow_facets(surface);
  look_around(surface);
}

/// From each triangle that is in none over all neighbours in its plane, so that a surface that bends little by little
/// does not become one.
void MeshFacets::grow_facets(const CollisionSurface& s) {
  const double one_plane = collision_tuning().manifold.one_plane;
  facet_.assign(normal_.size(), -1);
  std::vector<Index> front;
  for (Index seed = 0; seed < s.triangles(); ++seed) {
    if (facet(seed) >= 0) continue;
    const Vec3 &n = normal_[static_cast<std::size_t>(seed)], x = corners(s, seed)[0];
    const auto in_plane = [&](Index t) {
      if (!((normal_[static_cast<std::size_t>(t)] - n).norm() <= one_plane)) return false;
      const TrianglePoints points = corners(s, t);
      return std::ranges::all_of(
          points, [&](const Vec3& p) { return std::abs(n.dot(p - x)) <= one_plane * (points[1] - points[0]).norm(); });
    };
    front.assign(1, seed);
    facet_[static_cast<std::size_t>(seed)] = seed;
    while (!front.empty()) {
      const Index t = front.back();
      front.pop_back();
      for (int c = 0; c < 3; ++c) {
        const Index next = s.neighbour(t, c);
        if (next < 0 || facet(next) >= 0 || !in_plane(next)) continue;
        facet_[static_cast<std::size_t>(next)] = seed;
        front.push_back(next);
      }
    }
  }
}

bool MeshFacets::is_active(const CollisionSurface& s, Index edge) const {
  const auto triangles = s.edge_triangles(edge);
  if (triangles.size() != 2) return true;
  if (facet(triangles[0]) == facet(triangles[1])) return false;
  const Vec3& on_edge = s.rest(s.edge(edge).vertices[0]);
  const Vec3& n = normal_[static_cast<std::size_t>(triangles[0])];
  const auto& other = s.triangle(triangles[1]);
  return std::ranges::all_of(other, [&](Index v) {
    const Vec3 d = s.rest(v) - on_edge;
    return n.dot(d) <= collision_tuning().manifold.one_plane * d.norm();
  });
}

void MeshFacets::look_around(const CollisionSurface& s) {
  rim_.assign(normal_.size(), 0);
  for (Index e = 0; e < s.edges(); ++e) {
    const auto triangles = s.edge_triangles(e);
    around_edge_.push_back(triangles.size() == 2 ? common_facet(triangles, *this) : -1);
    if (triangles.empty() || !is_active(s, e)) continue;
    for (const Index t : triangles)
      for (int c = 0; c < 3; ++c)
        if (s.edge_of(t, c) == e) rim_[static_cast<std::size_t>(t)] |= static_cast<std::uint8_t>(1 << c);
  }
  std::vector<std::uint8_t> at_end(static_cast<std::size_t>(s.vertices()), 0);
  for (Index e = 0; e < s.edges(); ++e)
    if (s.edge(e).boundary())
      for (const Index v : s.edge(e).vertices) at_end[static_cast<std::size_t>(v)] = 1;
  for (Index v = 0; v < s.vertices(); ++v)
    around_vertex_.push_back(at_end[static_cast<std::size_t>(v)] != 0 ? -1
                                                                      : common_facet(s.vertex_triangles(v), *this));
}

}  // namespace limber::internal
