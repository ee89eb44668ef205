#include "limber/precompute/tetrahedralise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "limber/core/error.h"
#include "shapes.h"

namespace limber {
namespace {

constexpr double kRoundOff = 1e-12;  // volumes are sums of thousands of terms


TEST(Tetrahedralise, ABoxKeepsItsEdgesAndSoItsVolumeExactly) {
  Warnings warnings;
  const auto r = tetrahedralise(shapes::box({0, 0, 0}, {1, 2, 0.5}), {.cell_size = 0.25}, warnings);
  EXPECT_FALSE(r.wrapped);
  EXPECT_NEAR(r.volume_before, 1.0, kRoundOff);
  EXPECT_NEAR(r.volume_after, 1.0, kRoundOff);
  EXPECT_TRUE(surface_quality(boundary_surface(r.mesh).surface).closed_manifold());
  ASSERT_EQ(r.mesh.regions.size(), 1u);
  EXPECT_EQ(r.mesh.regions[0].name, "*");
  EXPECT_THAT(warnings, testing::IsEmpty());
}

}  // namespace
}  // namespace limber
