// Shapes as they are drawn: closed, seen from outside, and as large as they are.
#include "limber/collision/shape_surface.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "limber/mesh/surface_mesh.h"

namespace limber {
namespace {

double drawn_volume(const Shape& shape) {
  const TriangleMesh drawn = surface_of(shape, Vec3::Zero(), 1.0);
  return enclosed_volume({drawn.vertices, drawn.triangles});
}

TEST(ShapeSurface, SolidsEncloseTheirVolumeFromOutside) {
  constexpr double kRound = 0.02;  // 32 flat parts around lie inside the round shape
  const double ball = 4.0 / 3.0 * std::numbers::pi * 8.0;
  EXPECT_NEAR(drawn_volume(Sphere{2.0}), ball, kRound * ball);
  const double capsule = ball + std::numbers::pi * 4.0 * 6.0;
  EXPECT_NEAR(drawn_volume(Capsule{2.0, 3.0}), capsule, kRound * capsule);
  EXPECT_NEAR(drawn_volume(Box{Vec3(1.0, 2.0, 3.0)}), 48.0, 1e-12);
  EXPECT_NEAR(drawn_volume(ConvexHull{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.1, 0.1, 0.1}}}), 1.0 / 6.0,
              1e-12);
}

TEST(ShapeSurface, AHalfSpaceIsASquareOfItsPlaneThatFacesOut) {
  const HalfSpace plane{.normal = Vec3(0.6, 0.0, 0.8), .offset = 2.0};
  const TriangleMesh drawn = surface_of(plane, {5.0, 6.0, 7.0}, 3.0);
  Vec3 area = Vec3::Zero();
  for (const Triangle& t : drawn.triangles) {
    const auto corner = [&](std::size_t i) { return drawn.vertices[static_cast<std::size_t>(t[i])]; };
    area += 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0));
    for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(plane.normal.dot(corner(i)), 2.0, 1e-12);
  }
  EXPECT_NEAR((area - 36.0 * plane.normal).norm(), 0.0, 1e-12);
}

}  // namespace
}  // namespace limber
