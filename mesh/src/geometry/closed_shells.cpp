#include "limber/mesh/closed_shells.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "geometry/near_points.h"
#include "limber/core/disjoint_sets.h"
#include "limber/mesh/winding_number.h"

namespace limber {
namespace {

struct Shell {
  SurfaceMesh surface;          // with vertices of its own
  std::vector<Index> triangle;  // of the whole
  Eigen::AlignedBox3d box;
  double volume = 0.0;  // signed
};

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

std::vector<Shell> closed_shells(const SurfaceMesh& surface) {
  const std::vector<Index> label = shells_of(surface);
  std::vector<Shell> shells(1 + *std::max_element(label.begin(), label.end()));
  for (std::size_t i = 0; i < label.size(); ++i) shells[label[i]].triangle.push_back(static_cast<Index>(i));
  std::vector<Index> own(surface.vertices.size(), -1);  // in the shell at hand
  for (Shell& shell : shells) {
    for (const Index i : shell.triangle) {
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
    for (const Index i : shell.triangle)
      for (const Index v : surface.triangles[i]) own[v] = -1;
    shell.volume = enclosed_volume(shell.surface);
  }
  std::erase_if(shells, [](const Shell& s) { return !surface_quality(s.surface).closed_manifold(); });
  return shells;
}

bool is_cavity(const Shell& shell, const std::vector<Shell>& shells) {
  const Vec3& p = shell.surface.vertices.front();
  bool inside = false;
  for (const Shell& other : shells)
    if (&other != &shell && other.box.contains(shell.box) && std::abs(winding_number(other.surface, p)) > 0.5)
      inside = !inside;
  return inside;
}

}  // namespace

Index turn_shells_outward(SurfaceMesh& surface) {
  if (surface.triangles.empty()) return 0;
  SurfaceMesh joined = surface;
  const std::vector<Index> of = internal::representatives(surface.vertices, 0.0);
  for (Triangle& t : joined.triangles)
    for (Index& v : t) v = of[v];
  const std::vector<Shell> shells = closed_shells(joined);
  Index turned = 0;
  for (const Shell& shell : shells) {
    if (shell.volume == 0.0 || (shell.volume < 0.0) == is_cavity(shell, shells)) continue;
    ++turned;
    for (const Index i : shell.triangle) std::swap(surface.triangles[i][1], surface.triangles[i][2]);
  }
  return turned;
}

}  // namespace limber
