#include "shells.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limber/core/disjoint_sets.h"
#include "limber/mesh/winding_number.h"

namespace limber::internal {
namespace {

constexpr std::size_t kSeedsPerShell = 48;

struct Shell {
  SurfaceMesh surface;
  Eigen::AlignedBox3d box;
  double volume = 0.0;  ///< signed
  int depth = 0;        ///< how many shells hold it
  int parent = -1;      ///< the smallest of them
};

std::vector<Shell> separate_shells(const SurfaceMesh& surface) {
  DisjointSets sets(surface.triangles.size());
  std::vector<Index> triangle_at(surface.vertices.size(), -1);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (const Index v : surface.triangles[i]) {
      if (triangle_at[v] >= 0) sets.join(static_cast<Index>(i), triangle_at[v]);
      triangle_at[v] = static_cast<Index>(i);
    }
  const std::vector<Index> label = sets.labels();
  std::vector<Shell> shells(1 + *std::max_element(label.begin(), label.end()));
  std::vector<Index> new_index(surface.vertices.size(), -1);  // a vertex belongs to one shell only
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    Shell& shell = shells[label[i]];
    Triangle t = surface.triangles[i];
    for (Index& v : t) {
      if (new_index[v] < 0) {
        new_index[v] = static_cast<Index>(shell.surface.vertices.size());
        shell.surface.vertices.push_back(surface.vertices[v]);
        shell.box.extend(surface.vertices[v]);
      }
      v = new_index[v];
    }
    shell.surface.triangles.push_back(t);
  }
  for (Shell& shell : shells) shell.volume = enclosed_volume(shell.surface);
  return shells;
}

void find_nesting(std::vector<Shell>& shells) {
  for (Shell& inner : shells)
    for (std::size_t o = 0; o < shells.size(); ++o) {
      const Shell& outer = shells[o];
      if (&outer == &inner || !outer.box.contains(inner.box)) continue;
      if (std::abs(winding_number(outer.surface, inner.surface.vertices.front())) < 0.5) continue;
      ++inner.depth;
      if (inner.parent < 0 || std::abs(outer.volume) < std::abs(shells[inner.parent].volume))
        inner.parent = static_cast<int>(o);
    }
}

/// Vertices far from each other, each next one the farthest from those taken.
std::vector<Vec3> spread_vertices(const SurfaceMesh& surface) {
  std::vector<double> distance(surface.vertices.size(), std::numeric_limits<double>::infinity());
  std::vector<Vec3> taken;
  std::size_t next = 0;
  while (taken.size() < kSeedsPerShell && distance[next] > 0.0) {
    taken.push_back(surface.vertices[next]);
    for (std::size_t i = 0; i < distance.size(); ++i)
      distance[i] = std::min(distance[i], (surface.vertices[i] - taken.back()).squaredNorm());
    next = static_cast<std::size_t>(std::max_element(distance.begin(), distance.end()) - distance.begin());
  }
  return taken;
}

void add_shell(const Shell& shell, bool outward, Body& body) {
  const bool turn = (shell.volume > 0.0) != outward;
  const auto base = static_cast<Index>(body.boundary.vertices.size());
  body.boundary.vertices.insert(body.boundary.vertices.end(), shell.surface.vertices.begin(),
                                shell.surface.vertices.end());
  for (const Triangle& t : shell.surface.triangles)
    body.boundary.triangles.push_back(turn ? Triangle{base + t[0], base + t[2], base + t[1]}
                                           : Triangle{base + t[0], base + t[1], base + t[2]});
  const auto seeds = spread_vertices(shell.surface);
  body.seeds.insert(body.seeds.end(), seeds.begin(), seeds.end());
  body.volume += (outward ? 1.0 : -1.0) * std::abs(shell.volume);
}

}  // namespace

Bodies split_into_bodies(const SurfaceMesh& surface) {
  std::vector<Shell> shells = separate_shells(surface);
  find_nesting(shells);
  Bodies out;
  std::vector<std::size_t> body_of(shells.size());
  for (std::size_t s = 0; s < shells.size(); ++s) {
    const bool outward = shells[s].depth % 2 == 0;
    if ((shells[s].volume > 0.0) != outward) ++out.turned;
    if (!outward) continue;
    body_of[s] = out.bodies.size();
    Body& body = out.bodies.emplace_back();
    body.diagonal = shells[s].box.diagonal().norm();
    add_shell(shells[s], true, body);
  }
  for (const Shell& shell : shells) {
    if (shell.depth % 2 == 0) continue;
    ++out.cavities;
    add_shell(shell, false, out.bodies[body_of[shell.parent]]);
  }
  return out;
}

}  // namespace limber::internal
