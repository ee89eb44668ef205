#include <gtest/gtest.h>

#include <set>

#include "limber/collision/tree_traversal.h"
#include "random_states.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::Random;

TEST(TreeTraversal, PairsHoldEveryPairOfTrianglesWhoseBoxesOverlap) {
  Random random(2);
  const auto surface =
      std::make_shared<const CollisionSurface>(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, 2), 8));
  DeformedSurface a, b;
  for (int trial = 0; trial < 30; ++trial) {
    a.bind(surface, random.amplitudes(8, 0.2));
    b.bind(surface, random.amplitudes(8, 0.2));
    const RigidTransform X_AB = random.pose(1.5);
    std::vector<TrianglePair> pairs;
    find_triangle_pairs(a, b, X_AB, 0.0, pairs);
    const std::set<TrianglePair> found(pairs.begin(), pairs.end());
    EXPECT_EQ(found.size(), pairs.size()) << "a pair is reported twice";
    for (Index t = 0; t < surface->triangles(); ++t)
      for (Index u = 0; u < surface->triangles(); ++u) {
        Aabb box_t, box_u;
        for (const Vec3& p : a.triangle(t)) box_t.include(p);
        for (const Vec3& p : b.triangle(u)) box_u.include(X_AB * p);
        // Boxes in A overlap: not yet touching, but a triangle of u's inside t's box is what a traversal may not miss.
        if (box_t.contains(X_AB * b.triangle(u)[0])) {
          EXPECT_TRUE(found.contains({t, u}));
        }
      }
  }
}

}  // namespace
}  // namespace limber
