#include "limber/collision/collision_surface.h"

#include <gtest/gtest.h>

#include "limber/core/error.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber {
namespace {

TEST(CollisionSurface, SphereIsClosedAndFulfilsEulersFormula) {
  const CollisionSurface s(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, 3), 4));
  EXPECT_TRUE(s.closed());
  EXPECT_EQ(s.vertices() - s.edges() + s.triangles(), 2);
}

}  // namespace
}  // namespace limber
