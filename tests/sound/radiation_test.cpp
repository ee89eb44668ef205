#include "limber/sound/radiation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "limber/core/error.h"
#include "shapes.h"

namespace limber {
namespace {

/// A sphere whose surface moves out and in as one.
struct BreathingSphere {
  SurfaceMesh mesh;
  std::vector<Vec3f> rest;
  SoundModes modes;

  BreathingSphere(double radius, double hz) : mesh(shapes::sphere(Vec3::Zero(), radius, 5)) {
    const double omega = 2.0 * std::numbers::pi * hz;
    modes.eigenvalues = {omega * omega};
    modes.decays = {1.0};
    modes.vertices = static_cast<Index>(mesh.vertices.size());
    for (const Vec3& v : mesh.vertices) {
      rest.push_back(v.cast<float>());
      const Vec3f n = v.normalized().cast<float>();
      modes.shapes.insert(modes.shapes.end(), {n.x(), n.y(), n.z()});
    }
  }
};

// Of a sphere of radius a: |p| r = ρ c a ka/√(1 + (ka)²) v.
TEST(Radiation, APulsatingSphereIsAsLoudAsItsClosedForm) {
  constexpr double kFacets = 2e-3;  // area of the polyhedron
  for (const double hz : {50.0, 1000.0, 15000.0}) {
    const double radius = 0.07;
    const BreathingSphere sphere(radius, hz);
    const Air air;
    const double ka = 2.0 * std::numbers::pi * hz / air.speed * radius;
    const double expected = air.density * air.speed * radius * ka / std::sqrt(1.0 + ka * ka);
    const auto gains = monopole_gains(sphere.modes, sphere.rest, sphere.mesh.triangles, air);
    EXPECT_NEAR(gains.at(0) / expected, 1.0, kFacets) << hz << " Hz";
  }
}

TEST(Radiation, AModeThatMovesAlongTheSurfaceIsSilent) {
  BreathingSphere sphere(0.07, 1000.0);
  for (Index v = 0; v < sphere.modes.vertices; ++v) {
    const Vec3f along = sphere.rest[v].cross(Vec3f::UnitZ());
    for (int axis = 0; axis < 3; ++axis) sphere.modes.shapes[3 * v + axis] = along[axis] / 0.07f;
  }
  const BreathingSphere loud(0.07, 1000.0);
  constexpr double kFacets = 0.02;  // normals of facets are not quite those of the sphere
  EXPECT_LT(monopole_gains(sphere.modes, sphere.rest, sphere.mesh.triangles)[0],
            kFacets * monopole_gains(loud.modes, loud.rest, loud.mesh.triangles)[0]);
}

TEST(Radiation, RefusesASurfaceThatIsNotTheModes) {
  const BreathingSphere sphere(0.1, 100.0);
  EXPECT_THROW(monopole_gains(sphere.modes, {}, sphere.mesh.triangles), InvalidArgument);
  EXPECT_THROW(monopole_gains(sphere.modes, sphere.rest, {}), InvalidArgument);
  EXPECT_THROW(point_velocity_gains(sphere.modes, -1, Vec3::UnitX()), InvalidArgument);
}

}  // namespace
}  // namespace limber
