#include "limber/mesh/surface_locator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <vector>

#include "limber/core/error.h"
#include "limber/mesh/closest_point.h"

namespace limber {
namespace {

/// The nearest point is the least over all triangles, among slivers, repeated ones and single points too.
TEST(SurfaceLocator, FindsTheLeastDistanceOfAllTriangles) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const auto point = [&] { return Vec3(u(random), u(random), u(random)); };
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
  for (Index t = 0; t < 300; ++t) {
    const Vec3 place = point();
    for (int i = 0; i < 3; ++i) vertices.push_back(place + 0.2 * point());
    triangles.push_back({3 * t, 3 * t + 1, t % 10 == 0 ? 3 * t : 3 * t + 2});
    if (t % 7 == 0) triangles.push_back(triangles.back());
  }
  const SurfaceLocator locator(vertices, triangles);
  for (int trial = 0; trial < 2000; ++trial) {
    const Vec3 p = trial % 5 == 0 ? vertices[static_cast<std::size_t>(trial % 900)] : Vec3(1.5 * point());
    double least = std::numeric_limits<double>::infinity();
    Index first = 0;
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      TrianglePoints x;
      for (std::size_t i = 0; i < 3; ++i) x[i] = vertices[static_cast<std::size_t>(triangles[t][i])];
      const double d2 = (closest_on_triangle(p, x).point - p).squaredNorm();
      if (d2 < least) least = d2, first = static_cast<Index>(t);
    }
    const SurfaceLocation found = locator.nearest(p);
    EXPECT_EQ(found.triangle, first);
    EXPECT_EQ(found.distance, std::sqrt(least));
    Vec3 foot = Vec3::Zero();
    for (std::size_t i = 0; i < 3; ++i)
      foot +=
          found.weight[i] * vertices[static_cast<std::size_t>(triangles[static_cast<std::size_t>(found.triangle)][i])];
    EXPECT_NEAR((foot - p).norm(), found.distance, 1e-14);
  }
}

TEST(SurfaceLocator, SaysWhatIsWrongWithASurface) {
  const std::vector<Vec3> vertices(3, Vec3::Zero());
  EXPECT_THROW(SurfaceLocator(vertices, {}), InvalidArgument);
  const std::vector<Triangle> triangles = {{0, 1, 2}, {0, 1, 3}};
  try {
    SurfaceLocator locator(vertices, triangles);
    FAIL();
  } catch (const InvalidArgument& e) {
    EXPECT_THAT(e.what(), ::testing::HasSubstr("triangle 1 names vertex 3"));
  }
}

}  // namespace
}  // namespace limber
