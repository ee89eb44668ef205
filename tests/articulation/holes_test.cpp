// Surfaces that are meant to bound a solid and have a hole: what is inside, and what stops.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "constants.h"
#include "grouped_parts.h"
#include "limber/articulation/assembly.h"
#include "limber/articulation/free_motion.h"
#include "limber/mesh/winding_number.h"
#include "shapes.h"

namespace limber {
namespace {

using testing::kPi;

Component component_of(const SurfaceMesh& surface) {
  GroupedSurface input;
  append_group(surface, "part", input);
  return find_components(input, {.rule = ComponentRule::kGroups}).components.at(0);
}

/// A ball of radius 1 about the origin without the triangles whose middle is seen within an angle (rad) of +x.
SurfaceMesh ball_with_hole(double angle) {
  SurfaceMesh ball = shapes::sphere(Vec3::Zero(), 1.0, 3);
  std::erase_if(ball.triangles, [&](const Triangle& t) {
    const Vec3 middle = ball.vertices[t[0]] + ball.vertices[t[1]] + ball.vertices[t[2]];
    return std::atan2(std::hypot(middle.y(), middle.z()), middle.x()) < angle;
  });
  return ball;
}

TEST(Holes, ASmallOneLeavesASolidWithAnInside) {
  const Component whole = component_of(shapes::sphere(Vec3::Zero(), 1.0, 3)),
                  holed = component_of(ball_with_hole(0.12));
  EXPECT_TRUE(whole.caps.empty());
  ASSERT_TRUE(holed.closed);
  EXPECT_FALSE(holed.caps.empty());
  const SurfaceMesh bounding = bounding_surface(holed);
  EXPECT_NEAR(enclosed_volume(bounding), enclosed_volume(whole.surface), 1e-3);
  const double radius = 0.2;  // of the hole, its triangles whole
  double hole = 0.0;
  for (const Triangle& t : holed.caps) {
    const auto& v = holed.surface.vertices;
    hole += 0.5 * (v[t[1]] - v[t[0]]).cross(v[t[2]] - v[t[0]]).norm();
    EXPECT_LT(std::hypot(v[t[0]].y(), v[t[0]].z()), radius);
  }
  EXPECT_LT(hole, 0.01 * 4.0 * kPi);
  int inside = 0;
  for (int i = 0; i < 300; ++i) {  // spread over a box by the plastic number's powers
    const Vec3 p =
        3.0 * Vec3(std::fmod(0.8191725 * i, 1.0), std::fmod(0.6710436 * i, 1.0), std::fmod(0.5497005 * i, 1.0)) -
        Vec3::Constant(1.5);
    if (std::abs(p.norm() - 0.98) < 0.03) continue;  // between the ball and its facets
    const double w = winding_number(bounding, p);
    EXPECT_NEAR(w, p.norm() < 0.98 ? 1.0 : 0.0, 1e-9);
    inside += p.norm() < 0.98 ? 1 : 0;
    // The bound: what is missing fills no more of the view than its area seen face to face.
    const double distance = (p - Vec3(0.985, 0, 0)).norm() - radius;
    if (distance > 0.0) {
      EXPECT_LE(std::abs(winding_number(holed.surface, p) - w), hole / (4.0 * kPi * distance * distance))
          << p.transpose();
    }
  }
  EXPECT_GT(inside, 30);
}

TEST(Holes, ALargeOneLeavesASheet) {
  const Component bowl = component_of(ball_with_hole(0.5));
  EXPECT_FALSE(bowl.closed);
  EXPECT_TRUE(bowl.caps.empty());
}

// A corner in the middle of an edge on one side only: nothing is missing but the edges do not match.
TEST(Holes, ACrackWithoutWidthLeavesASolid) {
  SurfaceMesh box = shapes::box({0, 0, 0}, {1, 2, 3});
  const Triangle cut = box.triangles.front();
  const auto middle = static_cast<Index>(box.vertices.size());
  box.vertices.push_back(0.5 * (box.vertices[cut[0]] + box.vertices[cut[1]]));
  box.triangles.front() = {cut[0], middle, cut[2]};
  box.triangles.push_back({middle, cut[1], cut[2]});
  const Component part = component_of(box);
  EXPECT_TRUE(part.closed);
  EXPECT_EQ(part.caps.size(), 1u);
  EXPECT_NEAR(enclosed_volume(bounding_surface(part)), 6.0, 1e-12);
}

TEST(Holes, ASheetDrawnFromBothSidesBoundsNothing) {
  SurfaceMesh sheet{{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 3}, {0, 2, 1}, {0, 3, 2}}};
  EXPECT_FALSE(component_of(sheet).closed);
}

TEST(Holes, ABallWithAHoleStopsLikeABallAndLetsPassBehindIt) {
  const SurfaceMesh cube = shapes::box({-3.1, -0.1, -0.1}, {-2.9, 0.1, 0.1});
  const MotionBody moving{&cube};
  const auto pass = [&](const Component& ball) {
    const MotionBody fixed{&ball.surface, ball.closed, ball.caps};
    return free_motion({&moving, 1}, {&fixed, 1}, {.kind = MotionPath::Kind::kTranslation, .axis = Vec3::UnitX()});
  };
  const FreeMotion whole = pass(component_of(shapes::sphere(Vec3::Zero(), 1.0, 3))),
                   holed = pass(component_of(ball_with_hole(0.12)));
  ASSERT_EQ(whole.others.size(), 1u);
  ASSERT_EQ(holed.others.size(), 1u);
  EXPECT_NEAR(holed.reachable.high, whole.reachable.high, 1e-3);
  EXPECT_NEAR(holed.others[0].low, whole.others[0].low, 0.02);  // the cap is flat where the ball bulges
  EXPECT_NEAR(whole.others[0].low, 4.1, 0.01);
}

}  // namespace
}  // namespace limber
