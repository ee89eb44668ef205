#include "shells.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "cgal_steps.h"
#include "limber/core/disjoint_sets.h"
#include "limber/mesh/closed_shells.h"

namespace limber::internal {
namespace {

constexpr std::size_t kSeedsPerShell = 48;

/// A shell, and where it lies among the others.
struct Nested {
  SurfaceShell shell;
  int depth = 0;    ///< how many shells hold it
  int parent = -1;  ///< the smallest of them
};

/// What hangs together by vertices.
std::vector<Index> shells_of(const SurfaceMesh& surface) {
  DisjointSets sets(surface.triangles.size());
  std::vector<Index> triangle_at(surface.vertices.size(), -1);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (const Index v : surface.triangles[i]) {
      if (triangle_at[v] >= 0) sets.join(static_cast<Index>(i), triangle_at[v]);
      triangle_at[v] = static_cast<Index>(i);
    }
  return sets.labels();
}

std::vector<Nested> nested(std::vector<SurfaceShell> shells) {
  std::vector<Nested> out;
  for (SurfaceShell& shell : shells) out.push_back({.shell = std::move(shell)});
  for (Nested& inner : out)
    for (std::size_t o = 0; o < out.size(); ++o) {
      const Nested& outer = out[o];
      if (&outer == &inner || !holds(outer.shell, inner.shell)) continue;
      ++inner.depth;
      if (inner.parent < 0 || std::abs(outer.shell.volume) < std::abs(out[inner.parent].shell.volume))
        inner.parent = static_cast<int>(o);
    }
  return out;
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

SurfaceMesh turned(SurfaceMesh surface) {
  for (Triangle& t : surface.triangles) std::swap(t[1], t[2]);
  return surface;
}

void add_shell(const SurfaceShell& shell, bool outward, Body& body) {
  append((shell.volume > 0.0) == outward ? shell.surface : turned(shell.surface), body.boundary);
  const auto seeds = spread_vertices(shell.surface);
  body.seeds.insert(body.seeds.end(), seeds.begin(), seeds.end());
  body.volume += (outward ? 1.0 : -1.0) * std::abs(shell.volume);
}

}  // namespace

void append(const SurfaceMesh& part, SurfaceMesh& whole) {
  const auto first = static_cast<Index>(whole.vertices.size());
  whole.vertices.insert(whole.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const Triangle& t : part.triangles) whole.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

bool add_inner_surface(const SurfaceMesh& surface, Bodies& bodies) {
  const SurfaceMesh inward = enclosed_volume(surface) > 0.0 ? turned(surface) : surface;
  std::vector<Body> cut = bodies.bodies;
  for (Body& body : cut) {
    SurfaceMesh inside = inward;
    if (!clip_to_body(inside, body.boundary)) return false;
    if (inside.triangles.empty()) continue;
    const auto seeds = spread_vertices(inside);
    body.seeds.insert(body.seeds.end(), seeds.begin(), seeds.end());
    body.inner.push_back(std::move(inside));
  }
  bodies.bodies = std::move(cut);
  return true;
}

Bodies split_into_bodies(const SurfaceMesh& surface) {
  const std::vector<Nested> shells = nested(split_into_shells(surface, shells_of(surface)));
  Bodies out;
  std::vector<std::size_t> body_of(shells.size());
  for (std::size_t s = 0; s < shells.size(); ++s) {
    const auto& [shell, depth, parent] = shells[s];
    const bool outward = depth % 2 == 0;
    if ((shell.volume > 0.0) != outward) ++out.turned;
    if (!outward) continue;
    body_of[s] = out.bodies.size();
    Body& body = out.bodies.emplace_back();
    body.diagonal = shell.box.diagonal().norm();
    add_shell(shell, true, body);
  }
  for (const Nested& inner : shells) {
    if (inner.depth % 2 == 0) continue;
    ++out.cavities;
    add_shell(inner.shell, false, out.bodies[body_of[inner.parent]]);
  }
  return out;
}

}  // namespace limber::internal
