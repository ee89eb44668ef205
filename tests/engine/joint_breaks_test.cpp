// Joints that break under a force: where, what is told, and what goes on.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "counted_new.h"
#include "grounded_world.h"
#include "limber/collision/contact_finder.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::share;

constexpr double kGravity = 9.80665;

/// A ball that swings about a point of the world, 1 m from it, let go at the height of the point.
struct Pendulum {
  explicit Pendulum(ContactSolver solver, double step = 1.0 / 480.0) : world({.step = step}) {
    world.set_contact_source(nullptr, {.solver = solver});
    ball = world.add_rigid(share(Sphere{0.01}), 1e6, {.pose = {.p = {1, 0, 0}}, .user_data = 5});
    joint = world.add_joint({}, ball, {.type = JointType::kBall});
    weight = world.model(ball).data().mass * kGravity;
  }
  World world;
  BodyId ball{};
  JointId joint{};
  double weight = 0.0;
};

class JointBreaks : public ::testing::TestWithParam<ContactSolver> {};

/// The thread of a pendulum pulls by 3 m g cos θ at the angle θ from below: it breaks at cos θ = s/3 for a strength of
/// s m g, and the ball flies on at the speed √(2 g cos θ) that it has there.
TEST_P(JointBreaks, AThreadBreaksWhereAPendulumPullsHarder) {
  for (const double share : {1.0, 2.0, 2.8}) {
    Pendulum p(GetParam());
    p.world.set_joint_strength(p.joint, share * p.weight);
    p.world.set_user_data(p.joint, 9);
    EXPECT_EQ(p.world.joint_strength(p.joint), share * p.weight);
    int told = 0;
    for (int i = 0; i < 480 && told == 0; ++i) {
      p.world.step();
      for (const JointBreak& broken : p.world.joint_breaks()) {
        ++told;
        EXPECT_EQ(broken.joint, p.joint);
        EXPECT_EQ(broken.a, BodyId{});
        EXPECT_EQ(broken.b, p.ball);
        EXPECT_EQ(broken.user_data, 9u);
        EXPECT_GT(broken.force.norm(), share * p.weight);
        EXPECT_LT(broken.force.norm(), 1.02 * share * p.weight);
      }
    }
    ASSERT_EQ(told, 1) << share;
    EXPECT_FALSE(p.world.contains(p.joint));
    const BodyView at = p.world.body(p.ball);
    EXPECT_NEAR(-at.pose.p.z(), share / 3.0, 0.015) << share;
    EXPECT_NEAR(at.velocity.norm(), std::sqrt(2.0 * kGravity * -at.pose.p.z()), 0.02);
    const Vec3 p0 = at.pose.p, v0 = at.velocity;
    for (int i = 0; i < 96; ++i) p.world.step();
    EXPECT_TRUE(p.world.joint_breaks().empty());
    EXPECT_LT((p.world.body(p.ball).pose.p - (p0 + 0.2 * v0 - Vec3(0, 0, 0.5 * kGravity * 0.04))).norm(), 1e-9);
  }
}

TEST_P(JointBreaks, AStrongerThreadHolds) {
  Pendulum p(GetParam());
  p.world.set_joint_strength(p.joint, 3.1 * p.weight);
  for (int i = 0; i < 960; ++i) p.world.step();
  EXPECT_TRUE(p.world.contains(p.joint));
}

INSTANTIATE_TEST_SUITE_P(Solvers, JointBreaks, ::testing::Values(ContactSolver::kGame, ContactSolver::kExact));

/// A state from before the break knows the strength, and the same break follows, to the bit; one from after it tells it
/// again.
TEST(JointBreak, IsInSnapshots) {
  Pendulum p(ContactSolver::kGame, 1.0 / 60.0);
  p.world.set_joint_strength(p.joint, 2.0 * p.weight);
  std::vector<std::byte> before, broken;
  p.world.save_state(before);
  const auto swing = [&] {
    for (int i = 0; i < 60; ++i) {
      p.world.step();
      if (!p.world.joint_breaks().empty()) return i;
    }
    return -1;
  };
  const int when = swing();
  ASSERT_GT(when, 0);
  p.world.save_state(broken);
  const std::uint64_t hash = p.world.state_hash();
  for (int i = 0; i < 10; ++i) p.world.step();
  p.world.restore_state(before);
  EXPECT_TRUE(p.world.contains(p.joint));
  EXPECT_TRUE(p.world.joint_breaks().empty());
  EXPECT_EQ(p.world.joint_strength(p.joint), 2.0 * p.weight);
  EXPECT_EQ(swing(), when);
  EXPECT_EQ(p.world.state_hash(), hash);
  p.world.step();
  p.world.restore_state(broken);
  EXPECT_EQ(p.world.joint_breaks().size(), 1u);
  EXPECT_FALSE(p.world.contains(p.joint));
}

/// Two boxes that a joint held apart meet once it is broken: they overlapped, and part.
TEST(JointBreak, BodiesMeetAfterIt) {
  testing::GroundedWorld g;
  const auto box = share(Box{{0.2, 0.2, 0.2}});
  const BodyId low = g.world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 0.2}}});
  const BodyId high = g.world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 0.55}}});
  const JointId joint = g.world.add_joint(low, high, {.type = JointType::kFixed, .frame = {.origin = {0, 0, 0.4}}});
  g.step(30);
  EXPECT_NEAR(g.world.body(high).pose.p.z(), 0.55, 2e-3);
  g.world.set_joint_strength(joint, 1.0);  // of 314 N
  g.step(1);
  ASSERT_EQ(g.world.joint_breaks().size(), 1u);
  EXPECT_EQ(g.world.joint_breaks()[0].a, low);
  EXPECT_EQ(g.world.joint_breaks()[0].b, high);
  g.step(120);
  EXPECT_NEAR(g.world.body(high).pose.p.z(), 0.6, 3e-3);
  EXPECT_GT(g.world.contact_impulse(high, low).z(), 0.0);
}

TEST(JointBreak, ArgumentsAreCheckedAndStepsAllocateNothing) {
  Pendulum p(ContactSolver::kGame);
  EXPECT_EQ(p.world.joint_strength(p.joint), std::numeric_limits<double>::infinity());
  EXPECT_THROW(p.world.set_joint_strength(p.joint, 0.0), InvalidArgument);
  EXPECT_THROW(p.world.set_joint_strength(p.joint, std::nan("")), InvalidArgument);
  EXPECT_THROW(p.world.set_joint_strength({}, 1.0), InvalidArgument);
  p.world.set_joint_strength(p.joint, 10.0 * p.weight);
  for (int i = 0; i < 30; ++i) p.world.step();
  const long before = testing::allocations();
  for (int i = 0; i < 30; ++i) p.world.step();
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
