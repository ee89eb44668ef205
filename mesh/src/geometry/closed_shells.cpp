#include "limber/mesh/closed_shells.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <utility>

#include "geometry/near_points.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/mesh/winding_number.h"

namespace limber {
namespace {

/// Per triangle the number of its shell. @param surface vertices at equal coordinates are one
std::vector<Index> shells_of(const SurfaceMesh& surface) {
  DisjointSets sets(surface.triangles.size());
  std::map<std::pair<Index, Index>, Index> triangle_at;  // per edge
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (int a = 0; a < 3; ++a) {
      const Triangle& t = surface.triangles[i];
      const auto [entry, is_new] = triangle_at.try_emplace(std::minmax({t[a], t[(a + 1) % 3]}), static_cast<Index>(i));
      if (!is_new) sets.join(static_cast<Index>(i), entry->second);
    }
  return sets.labels();
}

std::vector<SurfaceShell> closed_shells(const SurfaceMesh& surface) {
  std::vector<SurfaceShell> shells = split_into_shells(surface, shells_of(surface));
  std::erase_if(shells, [](const SurfaceShell& s) { return !surface_quality(s.surface).closed_manifold(); });
  return shells;
}

bool is_cavity(const SurfaceShell& shell, const std::vector<SurfaceShell>& shells) {
  const auto holders = std::count_if(
      shells.begin(), shells.end(), [&](const SurfaceShell& other) { return &other != &shell && holds(other, shell); });
  return holders % 2 == 1;
}

}  // namespace

std::vector<SurfaceShell> split_into_shells(const SurfaceMesh& surface, std::span<const Index> label) {
  if (label.size() != surface.triangles.size())
    throw InvalidArgument("split_into_shells: label has " + std::to_string(label.size()) +
                          " numbers, expected one for " + "each of " + std::to_string(surface.triangles.size()) +
                          " triangles");
  std::vector<SurfaceShell> shells;
  for (std::size_t i = 0; i < label.size(); ++i) {
    if (label[i] < 0)
      throw InvalidArgument("split_into_shells: label[" + std::to_string(i) + "] is " + std::to_string(label[i]) +
                            ", expected 0 or more");
    shells.resize(std::max(shells.size(), static_cast<std::size_t>(label[i]) + 1));
    shells[label[i]].triangles.push_back(static_cast<Index>(i));
  }
  std::vector<Index> own(surface.vertices.size(), -1);  // in the shell at hand
  for (SurfaceShell& shell : shells) {
    for (const Index i : shell.triangles) {
      Triangle t = surface.triangles[i];
      for (Index& v : t) {
        if (own[v] < 0) {
          own[v] = static_cast<Index>(shell.surface.vertices.size());
          shell.surface.vertices.push_back(surface.vertices[v]);
          shell.box.extend(surface.vertices[v]);
        }
        v = own[v];
      }
      shell.surface.triangles.push_back(t);
    }
    for (const Index i : shell.triangles)
      for (const Index v : surface.triangles[i]) own[v] = -1;
    shell.volume = enclosed_volume(shell.surface);
  }
  return shells;
}

bool holds(const SurfaceShell& outer, const SurfaceShell& inner) {
  return outer.box.contains(inner.box) && std::abs(winding_number(outer.surface, inner.surface.vertices.front())) > 0.5;
}

std::vector<std::array<Index, 2>> boundary_of(const SurfaceMesh& surface) {
  std::map<std::pair<Index, Index>, int> surplus;  // by (low, high): upward less downward
  for (const Triangle& t : surface.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Index a = t[k], b = t[(k + 1) % 3];
      surplus[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  std::vector<std::array<Index, 2>> out;
  for (const auto& [edge, count] : surplus)
    for (int i = 0; i < std::abs(count); ++i)
      out.push_back(count > 0 ? std::array{edge.first, edge.second} : std::array{edge.second, edge.first});
  return out;
}

Index turn_shells_outward(SurfaceMesh& surface) {
  if (surface.triangles.empty()) return 0;
  SurfaceMesh joined = surface;
  const std::vector<Index> of = internal::representatives(surface.vertices, 0.0);
  for (Triangle& t : joined.triangles)
    for (Index& v : t) v = of[v];
  const std::vector<SurfaceShell> shells = closed_shells(joined);
  Index turned = 0;
  for (const SurfaceShell& shell : shells) {
    if (shell.volume == 0.0 || (shell.volume < 0.0) == is_cavity(shell, shells)) continue;
    ++turned;
    for (const Index i : shell.triangles) std::swap(surface.triangles[i][1], surface.triangles[i][2]);
  }
  return turned;
}

}  // namespace limber
