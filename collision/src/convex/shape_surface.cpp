#include "limber/collision/shape_surface.h"

#include <cmath>
#include <numbers>

#include "limber/collision/collision_surface.h"
#include "limber/collision/narrow_phase.h"

namespace limber {
namespace {

/// A ball cut in two along z, its halves `half_length` from the origin: rings from pole to pole.
TriangleMesh rings(double radius, double half_length) {
  constexpr Index kAround = 32, kDown = 16;  // the latter even: the middle ring is there twice, once for each half
  TriangleMesh mesh;
  const auto add_ring = [&](Index i, double shift) {
    const double polar = std::numbers::pi * i / kDown;
    for (Index j = 0; j < kAround; ++j) {
      const double angle = 2.0 * std::numbers::pi * j / kAround;
      mesh.vertices.push_back({radius * std::sin(polar) * std::cos(angle), radius * std::sin(polar) * std::sin(angle),
                               radius * std::cos(polar) + shift});
    }
  };
  for (Index i = 0; i <= kDown / 2; ++i) add_ring(i, half_length);
  for (Index i = kDown / 2; i <= kDown; ++i) add_ring(i, -half_length);
  for (Index i = 0; i <= kDown; ++i)
    for (Index j = 0; j < kAround; ++j) {
      const Index next = (j + 1) % kAround, above = i * kAround, below = above + kAround;
      mesh.triangles.push_back({above + j, below + j, below + next});
      mesh.triangles.push_back({above + j, below + next, above + next});
    }
  return mesh;
}

TriangleMesh square(const HalfSpace& s, const Vec3& about, double half_side) {
  const Vec3 middle = about - (s.normal.dot(about) - s.offset) * s.normal;
  const Vec3 x = s.normal.unitOrthogonal(), y = s.normal.cross(x);
  TriangleMesh mesh;
  for (const auto& [u, v] : {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}})
    mesh.vertices.push_back(middle + half_side * (u * x + v * y));
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// The surface that collision/ touches: flat triangles with corners of their own, so that edges are seen.
TriangleMesh touched(const Shape& shape) {
  const RigidGeometry geometry(shape);
  TriangleMesh mesh;
  for (Index t = 0; t < geometry.surface()->triangles(); ++t) {
    const auto first = static_cast<Index>(mesh.vertices.size());
    for (const Index v : geometry.surface()->triangle(t)) mesh.vertices.push_back(geometry.surface()->rest(v));
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

}  // namespace

TriangleMesh surface_of(const Shape& shape, const Vec3& about, double half_side) {
  if (const auto* plane = std::get_if<HalfSpace>(&shape)) return square(*plane, about, half_side);
  if (const auto* ball = std::get_if<Sphere>(&shape)) return rings(ball->radius, 0.0);
  if (const auto* capsule = std::get_if<Capsule>(&shape)) return rings(capsule->radius, capsule->half_length);
  return touched(shape);
}

}  // namespace limber
