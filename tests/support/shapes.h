// Surfaces of known volume, for tests.
#pragma once

#include <cmath>
#include <map>
#include <utility>

#include "limber/mesh/surface_mesh.h"

namespace limber::shapes {

/// A box between two corners: 8 vertices, 12 triangles, outward.
inline SurfaceMesh box(const Vec3& low, const Vec3& high) {
  SurfaceMesh s;
  for (int i = 0; i < 8; ++i)
    s.vertices.emplace_back((i & 1 ? high : low).x(), (i & 2 ? high : low).y(), (i & 4 ? high : low).z());
  constexpr Index kFaces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& f : kFaces) {
    s.triangles.push_back({f[0], f[1], f[2]});
    s.triangles.push_back({f[0], f[2], f[3]});
  }
  return s;
}

/// A sphere: an octahedron whose triangles are split in four `splits` times, outward. Its own volume is a little less
/// than the ball's; enclosed_volume() tells.
inline SurfaceMesh sphere(const Vec3& center, double radius, int splits) {
  SurfaceMesh s;
  s.vertices = {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
  s.triangles = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  for (int i = 0; i < splits; ++i) {
    std::map<std::pair<Index, Index>, Index> middle;
    const auto between = [&](Index a, Index b) {
      const auto [entry, fresh] = middle.try_emplace(std::minmax(a, b), static_cast<Index>(s.vertices.size()));
      if (fresh) {
        const Vec3 m = (s.vertices[a] + s.vertices[b]).normalized();
        s.vertices.push_back(m);
      }
      return entry->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : s.triangles) {
      const Index ab = between(a, b), bc = between(b, c), ca = between(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    s.triangles = std::move(finer);
  }
  for (Vec3& v : s.vertices) v = center + radius * v;
  return s;
}

/// The same triangles seen from the other side.
inline SurfaceMesh turned(SurfaceMesh s) {
  for (Triangle& t : s.triangles) std::swap(t[1], t[2]);
  return s;
}

/// Adds the triangles of one surface to another; no vertex is shared.
inline void append(const SurfaceMesh& part, SurfaceMesh& whole) {
  const auto base = static_cast<Index>(whole.vertices.size());
  whole.vertices.insert(whole.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const Triangle& t : part.triangles) whole.triangles.push_back({base + t[0], base + t[1], base + t[2]});
}

}  // namespace limber::shapes
