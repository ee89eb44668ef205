#include "limber/collision/deformed_surface.h"

#include <gtest/gtest.h>

#include "random_states.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::Random;

std::shared_ptr<const CollisionSurface> wavy_sphere(int splits, Index modes, int leaf_triangles = 4) {
  return std::make_shared<const CollisionSurface>(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, splits), modes),
                                                  CollisionSurfaceOptions{.leaf_triangles = leaf_triangles});
}

/// No vertex below a node lies outside its box, compared without any tolerance.
void expect_all_enclosed(DeformedSurface& body) {
  for (std::size_t n = 0; n < body.surface().nodes().size(); ++n) {
    const Aabb box = body.bounds(static_cast<Index>(n));
    for (const Index t : body.surface().node_triangles(static_cast<Index>(n)))
      for (const Vec3& p : body.triangle(t))
        ASSERT_TRUE(box.contains(p)) << "node " << n << ", triangle " << t << ", outside by "
                                     << ((box.low - p).cwiseMax(p - box.high)).maxCoeff();
  }
}

TEST(DeformedSurface, BoxesOfEveryNodeEncloseItsVertices) {
  Random random(1);
  for (const Index modes : {0, 1, 7, 16, 33}) {
    const auto surface = wavy_sphere(2, modes);
    DeformedSurface body;
    for (int trial = 0; trial < 200; ++trial) {
      body.bind(surface, random.amplitudes(modes, std::pow(10.0, random.uniform(-12.0, 6.0))));
      expect_all_enclosed(body);
      if (HasFatalFailure()) return;
    }
  }
}

}  // namespace
}  // namespace limber
