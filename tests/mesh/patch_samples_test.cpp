#include "limber/mesh/patch_samples.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace limber {
namespace {

// Two triangles of a square and one beside it with a corner outside of the patch.
const std::vector<Triangle> kTriangles{{0, 1, 2}, {0, 2, 3}, {1, 4, 2}};
const std::vector<Vec3> kPlaces{{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {0, 1, 0}, {5, 0, 0}};

std::vector<PatchSample> samples_of(const std::vector<bool>& inside) {
  return patch_samples(kTriangles, inside, [](std::size_t v) { return kPlaces[v]; });
}

TEST(PatchSamples, MeansOfProductsOfLinearFunctionsAreExact) {
  double all = 0.0, x = 0.0, xx = 0.0, xy = 0.0;
  for (const PatchSample& s : samples_of({true, true, true, true, false})) {
    Vec3 p = Vec3::Zero();
    for (std::size_t c = 0; c < 3; ++c)
      p += s.at[c] * kPlaces[static_cast<std::size_t>(kTriangles[static_cast<std::size_t>(s.triangle)][c])];
    all += s.weight, x += s.weight * p.x(), xx += s.weight * p.x() * p.x(), xy += s.weight * p.x() * p.y();
  }
  EXPECT_NEAR(all, 1.0, 1e-15);
  EXPECT_NEAR(x, 1.0, 1e-15);
  EXPECT_NEAR(xx, 4.0 / 3.0, 1e-15);  // over 0 ≤ x ≤ 2, 0 ≤ y ≤ 1
  EXPECT_NEAR(xy, 0.5, 1e-15);
}

TEST(PatchSamples, AreTheVerticesAlikeWhereNoTriangleLiesInThePatch) {
  const auto samples = samples_of({true, true, false, false, false});
  ASSERT_EQ(samples.size(), 2u);
  for (std::size_t v = 0; v < 2; ++v) {
    const auto corner = static_cast<std::size_t>(std::ranges::find(samples[v].at, 1.0) - samples[v].at.begin());
    EXPECT_EQ(kTriangles[static_cast<std::size_t>(samples[v].triangle)][corner], static_cast<Index>(v));
    EXPECT_EQ(samples[v].weight, 0.5);
  }
}

}  // namespace
}  // namespace limber
