// Conveyors: surfaces that run over their bodies.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::share;

constexpr double kG = 9.80665;

/// The belt draws a box along with μ g until it has the belt's speed.
TEST(SurfaceVelocity, ABoxOnABeltGathersSpeedByFrictionAndKeepsTheBelts) {
  constexpr double kFriction = 0.3, kBelt = 2.0, kStep = 1.0 / 240.0;
  GroundedWorld g({.friction = kFriction}, {.step = kStep});
  g.world.set_surface_velocity(g.ground, {kBelt, 0, 5.0});  // a contact feels what lies along the surface
  const BodyId box = g.world.add_rigid(share(Box{{0.5, 0.5, 0.1}}), 500.0, {.pose = {.p = {0, 0, 0.1}}});
  g.step(60);
  const Vec3 start = g.world.body(box).velocity;
  g.step(60);
  EXPECT_NEAR(g.world.body(box).velocity.x() - start.x(), kFriction * kG * 60 * kStep, 1e-3);
  g.step(240);
  EXPECT_NEAR(g.world.body(box).velocity.x(), kBelt, 1e-4);
  EXPECT_NEAR(g.world.body(box).velocity.tail<2>().norm(), 0.0, 1e-4);
  const double slid = kBelt * kBelt / (2.0 * kFriction * kG);  // behind the belt
  EXPECT_NEAR(g.world.body(box).pose.p.x(), 360 * kStep * kBelt - slid, 0.01);
  EXPECT_NEAR(g.world.body(box).pose.p.z(), 0.1, 1e-3);
}

/// What runs along the x axis of a body that stands turned draws a box along y.
TEST(SurfaceVelocity, ABeltRunsInTheAxesOfItsBody) {
  GroundedWorld g({.friction = 0.5}, {.step = 1.0 / 240.0});
  const Quaternion quarter = quaternion_from_rotation_vector({0, 0, std::acos(0.0)});
  const BodyId belt = g.world.add_kinematic(share(Box{{1, 1, 0.1}}), {.pose = {.q = quarter, .p = {0, 0, 0.5}}});
  g.world.set_surface_velocity(belt, {1.0, 0, 0});
  const BodyId box = g.world.add_rigid(share(Box{{0.2, 0.2, 0.1}}), 500.0, {.pose = {.p = {0, -0.8, 0.7}}});
  g.step(180);
  EXPECT_NEAR(g.world.body(box).velocity.y(), 1.0, 1e-3);
  EXPECT_NEAR(g.world.body(box).velocity.x(), 0.0, 1e-3);
  EXPECT_EQ(g.world.surface_velocity(belt), Vec3(1, 0, 0));
}

/// A vehicle without wheels: the body whose own surface runs back is driven forward.
TEST(SurfaceVelocity, ADynamicBodyDrivesItselfByItsSurface) {
  GroundedWorld g({.friction = 0.5}, {.step = 1.0 / 240.0});
  const BodyId box = g.world.add_rigid(share(Box{{0.5, 0.5, 0.1}}), 500.0, {.pose = {.p = {0, 0, 0.1}}});
  g.world.set_surface_velocity(box, {-1.5, 0, 0});
  g.step(240);
  EXPECT_NEAR(g.world.body(box).velocity.x(), 1.5, 1e-3);
}

TEST(SurfaceVelocity, IsInSnapshotsWakesAndAllocatesNothing) {
  GroundedWorld g({}, {.sleep = {.enabled = true}});
  const BodyId box = g.world.add_rigid(share(Box{{0.2, 0.2, 0.2}}), 500.0, {.pose = {.p = {0, 0, 0.2}}});
  g.step(120);
  ASSERT_TRUE(g.world.is_asleep(box));
  std::vector<std::byte> still, state;
  g.world.save_state(still);
  g.world.set_surface_velocity(g.ground, {1, 0, 0});
  EXPECT_FALSE(g.world.is_asleep(box));
  g.step(30);
  EXPECT_GT(g.world.body(box).velocity.x(), 0.5);
  g.world.save_state(state);
  const long before = testing::allocations();
  g.step(30);
  EXPECT_EQ(testing::allocations() - before, 0);
  const std::uint64_t hash = g.world.state_hash();
  g.world.set_surface_velocity(g.ground, {-1, 0, 0});
  g.step(5);
  g.world.restore_state(state);
  g.step(30);
  EXPECT_EQ(g.world.state_hash(), hash);
  g.world.restore_state(still);
  EXPECT_EQ(g.world.surface_velocity(g.ground), Vec3::Zero());
  EXPECT_THROW(g.world.set_surface_velocity(g.ground, {NAN, 0, 0}), InvalidArgument);
  EXPECT_THROW(g.world.set_surface_velocity(BodyId{}, {1, 0, 0}), InvalidArgument);
  GroundedWorld exact(testing::exactly());
  EXPECT_THROW(exact.world.set_surface_velocity(exact.ground, {1, 0, 0}), InvalidArgument);
}

}  // namespace
}  // namespace limber
