// What holds whatever the rule that contacts are solved for by: nothing allocates, and scenes play by each of them.
#include <gtest/gtest.h>

#include "contact_rules.h"
#include "contact_scene.h"
#include "counted_new.h"
#include "grounded_world.h"
#include "limber/hauser/hauser_method.h"

namespace limber::testing {
namespace {

TEST(AnyContactRule, AWarmStepOfAnIslandAllocatesNothing) {
  for (const ContactRule& rule : all_contact_rules()) {
    const HauserMethod method(rule);
    GroundedIsland island({.modes = 6, .lowest_hz = 20.0, .decay = 5.0}, kFrame, method.contacts());
    island.solver = method.islands()();
    island.add_body({quaternion_from_rotation_vector({0.3, 0.1, 0.0}), {0.0, 0.0, 0.4}});
    for (int i = 0; i < 120; ++i) island.step();
    const std::vector<ContactPoint> found = island.found;
    const long before = allocations();
    island.contacts.update(island.states(), found);
    island.Island::step();
    island.contacts.finish();
    EXPECT_EQ(allocations() - before, 0) << name(rule);
    EXPECT_FALSE(island.contacts.events().empty()) << name(rule);
  }
}

TEST(AnyContactRule, AWarmStepOfAWorldAllocatesNothing) {
  for (const ContactRule& rule : all_contact_rules()) {
    const HauserMethod method(rule);
    GroundedWorld scene(method.contacts());
    World& world = scene.world;
    world.set_island_solver(method.islands());
    world.add_body(damped_box(4, 30.0), {.pose = {{}, {0.0, 0.0, 0.2}}});
    scene.step(200);
    const long before = allocations();
    bool touched = false;  // under some rules a box that should rest hops a little
    for (int i = 0; i < 60; ++i) {
      world.step();
      touched = touched || !world.contact_events().empty();
    }
    EXPECT_EQ(allocations() - before, 0) << name(rule);
    // A program as it is may throw a box away for good.
    EXPECT_TRUE(touched || rule.guard == ProgramGuard::kNone) << name(rule);
  }
}

/// Of a world whose bodies fall, touch, and hang on each other.
std::uint64_t played(const IslandSolverFactory* islands) {
  GroundedWorld scene(exactly());
  World& world = scene.world;
  if (islands != nullptr) world.set_island_solver(*islands);
  const auto model = damped_box(4, 30.0);
  const BodyId a = world.add_body(model, {.pose = {{}, {0.0, 0.0, 0.3}}});
  const BodyId b = world.add_body(model, {.pose = {{}, {0.7, 0.0, 0.3}}});
  world.add_joint(a, b, {.type = JointType::kBall, .frame = {.origin = {0.35, 0.0, 0.3}}});
  scene.step(60);
  return world.state_hash();
}

/// [H03]'s islands are limber's own where contacts are complementary with the cone; and empty is limber's own.
TEST(AnyContactRule, TheComplementaryRuleWithTheConeIsLimbersOwnToTheBit) {
  const IslandSolverFactory by_rule = HauserMethod(ContactRule{}).islands(), none;
  EXPECT_EQ(played(&by_rule), played(nullptr));
  EXPECT_EQ(played(&none), played(nullptr));
  const IslandSolverFactory programs = HauserMethod({.method = ContactMethod::kGapProgram}).islands();
  EXPECT_NE(played(&programs), played(nullptr));
}

TEST(AnyContactRule, NumbersOutOfRangeAreRefused) {
  EXPECT_THROW(HauserMethod({.penalty_frequency = 0.0}), InvalidArgument);
  EXPECT_THROW(HauserMethod({.penalty_damping = -1.0}), InvalidArgument);
  EXPECT_THROW(HauserMethod({.penalty_damping = kUnbounded}), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
