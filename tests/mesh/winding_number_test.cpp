#include "limber/mesh/winding_number.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "sample_meshes.h"

namespace limber {
namespace {

using samples::cube_surface;

// From the middle of a cube each face fills a sixth of the sphere; from a point before the middle of a face at half a
// side's distance, that face fills a sixth as well.
TEST(WindingNumber, IsOneInsideNoneOutsideAndAFractionBesideAHole) {
  SurfaceMesh cube = cube_surface();
  const Vec3 middle = Vec3::Constant(0.5);
  EXPECT_NEAR(winding_number(cube, middle), 1.0, 1e-14);
  EXPECT_NEAR(winding_number(cube, Vec3(0.9, 0.01, 0.5)), 1.0, 1e-14);
  EXPECT_NEAR(winding_number(cube, Vec3(1.5, 0.5, 0.5)), 0.0, 1e-14);
  std::erase_if(cube.triangles, [&](const Triangle& t) {
    return std::all_of(t.begin(), t.end(), [&](Index v) { return cube.vertices[v].x() == 1.0; });
  });
  EXPECT_NEAR(winding_number(cube, middle), 5.0 / 6.0, 1e-14);
  EXPECT_NEAR(winding_number(cube, Vec3(1.5, 0.5, 0.5)), 1.0 / 6.0, 1e-14);
  for (Triangle& t : cube.triangles) std::swap(t[0], t[1]);
  EXPECT_NEAR(winding_number(cube, middle), -5.0 / 6.0, 1e-14);
}

}  // namespace
}  // namespace limber
