// Pairs that come together fast, and what pairs press each other with.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::share;

constexpr double kG = 9.80665;

/// A ball that falls by h meets the ground at √(2 g h), whatever the step and wherever within it.
TEST(HitEvents, TellTheSpeedOfABallThatFalls) {
  for (const ContactSolver solver : {ContactSolver::kGame, ContactSolver::kExact})
    for (const double step : {1.0 / 60.0, 1.0 / 137.0}) {
      GroundedWorld g({.solver = solver}, {.step = step});
      const BodyId ball = g.world.add_rigid(share(Sphere{0.2}), 1000.0, {.pose = {.p = {1, 2, 1.2}}, .user_data = 77});
      std::vector<HitEvent> hits;
      for (int i = 0; i < static_cast<int>(0.7 / step); ++i) {
        g.world.step();
        for (const HitEvent& hit : g.world.hit_events()) {
          hits.push_back(hit);
          EXPECT_EQ(hit.impulse, g.world.contact_impulse(hit.a, hit.b));
          EXPECT_EQ(hit.impulse, -g.world.contact_impulse(hit.b, hit.a));
        }
      }
      ASSERT_EQ(hits.size(), 1u);
      const HitEvent& hit = hits[0];
      EXPECT_NEAR(hit.speed, std::sqrt(2.0 * kG), 2e-3);
      EXPECT_TRUE((hit.a == g.ground && hit.b == ball) || (hit.a == ball && hit.b == g.ground));
      const bool ball_is_a = hit.a == ball;
      EXPECT_EQ(ball_is_a ? hit.user_data_a : hit.user_data_b, 77u);
      EXPECT_NEAR((ball_is_a ? 1.0 : -1.0) * hit.normal.z(), 1.0, 1e-12);
      EXPECT_NEAR(hit.position.x(), 1.0, 1e-6);
      EXPECT_NEAR(hit.position.y(), 2.0, 1e-6);
    }
}

/// Flat on its face a box has one hit, with all that its corners press: what stops it.
TEST(HitEvents, AreOneForAPairWithTheImpulseOfAllItsContacts) {
  GroundedWorld g({}, {.step = 1.0 / 120.0});
  const BodyId box = g.world.add_rigid(share(Box{{0.5, 0.5, 0.5}}), 100.0, {.pose = {.p = {0, 0, 1.0}}});
  int hits = 0;
  for (int i = 0; i < 120; ++i) {
    const double before = g.world.body(box).velocity.z();
    g.world.step();
    for (const HitEvent& hit : g.world.hit_events()) {
      ++hits;
      const double change = 100.0 * (g.world.body(box).velocity.z() - before + kG / 120.0);
      EXPECT_NEAR(std::abs(hit.impulse.z()), change, 1e-3 * change);
      EXPECT_NEAR(hit.speed, std::sqrt(kG), 0.02);
    }
  }
  EXPECT_EQ(hits, 1);
}

TEST(HitEvents, TellNothingOfWhatIsSlowerThanAsked) {
  for (const double least : {1.0, 5.0}) {
    GroundedWorld g({}, {.step = 1.0 / 120.0, .hit_speed = least});
    g.world.add_rigid(share(Sphere{0.2}), 1000.0, {.pose = {.p = {0, 0, 1.2}}});
    int hits = 0;
    for (int i = 0; i < 120; ++i) {
      g.world.step();
      hits += static_cast<int>(g.world.hit_events().size());
    }
    EXPECT_EQ(hits, least < 4.0 ? 1 : 0);
  }
  EXPECT_THROW(World({.hit_speed = -1.0}), InvalidArgument);
  World world;
  const BodyId a = world.add_rigid(share(Sphere{0.2}), 1.0);
  EXPECT_THROW((void)world.contact_impulse(a, a), InvalidArgument);
  EXPECT_THROW((void)world.contact_impulse(a, BodyId{}), InvalidArgument);
  EXPECT_TRUE(world.hit_events().empty());
}

/// A state that is restored has the hits of its last step.
TEST(HitEvents, ComeBackWithAState) {
  GroundedWorld g({}, {.step = 1.0 / 120.0});
  g.world.add_rigid(share(Sphere{0.2}), 1000.0, {.pose = {.p = {0, 0, 1.2}}});
  while (g.world.hit_events().empty()) g.world.step();
  const double speed = g.world.hit_events()[0].speed;
  std::vector<std::byte> state;
  g.world.save_state(state);
  g.step(10);
  EXPECT_TRUE(g.world.hit_events().empty());
  g.world.restore_state(state);
  ASSERT_EQ(g.world.hit_events().size(), 1u);
  EXPECT_EQ(g.world.hit_events()[0].speed, speed);
}

}  // namespace
}  // namespace limber
