// Assets whose bodies are joined, in a world.
#include "limber/machine/machine.h"

#include "jointed_blocks.h"
#include "limber/collision/contact_finder.h"
#include "limber/collision/manifold_finder.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::jointed_blocks;

const RigidTransform kPose{quaternion_from_rotation_vector({0.3, -0.5, 0.9}), {3.0, 1.0, 2.0}};

World world_with(ContactSource& finder, ContactSolver solver = kDefaultContactSolver) {
  World world({.step = 0.01});
  world.set_contact_source(&finder, {.solver = solver});
  return world;
}

TEST(Machine, StandsWhereItIsPutAndMovesByItsJoints) {
  ContactFinder finder;
  World world = world_with(finder, ContactSolver::kExact);
  const Asset asset = jointed_blocks();
  const Machine machine = add_machine(world, asset, {.pose = kPose});
  ASSERT_EQ(machine.bodies.size(), 3u);
  ASSERT_EQ(machine.joints.size(), 2u);
  for (std::size_t i = 0; i < 3; ++i)
    EXPECT_LT((world.body(machine.bodies[i]).pose.p - kPose * asset.bodies[i]->data().origin_in_input).norm(), 1e-15);
  double swing = 0.0;
  for (int step = 0; step < 200; ++step) {
    world.step();
    for (const JointId id : machine.joints) EXPECT_LT(world.joint(id).distance_error, 1e-9);
    const double q = world.joint(machine.joints[1]).position[0];
    EXPECT_GT(q, -0.4 - 1e-6);
    EXPECT_LT(q, 0.3 + 1e-6);
    swing = std::max(swing, std::abs(q));
  }
  EXPECT_GT(swing, 0.05) << "rad";
}

TEST(Machine, PairsOfTheAssetHaveNoContacts) {
  ManifoldFinder finder;
  World world = world_with(finder);
  const Machine machine = add_machine(world, jointed_blocks());
  const auto touch = [&] {
    world.step();
    const auto low = static_cast<Index>(machine.bodies[1].index), high = static_cast<Index>(machine.bodies[2].index);
    for (const ContactEvent& e : world.contact_events())
      if (std::min(e.a, e.b) == low && std::max(e.a, e.b) == high && e.phase != ContactPhase::kEnded) return true;
    return false;
  };
  EXPECT_FALSE(touch());
  world.ignore_collision(machine.bodies[2], machine.bodies[1], false);
  EXPECT_TRUE(touch()) << "they overlap by half";
  world.ignore_collision(machine.bodies[2], machine.bodies[1], true);
  EXPECT_FALSE(touch());
  EXPECT_THROW(world.ignore_collision(machine.bodies[0], machine.bodies[0], true), InvalidArgument);
}

TEST(Machine, UntiedItFallsAsOneThing) {
  World world({.step = 0.01});
  world.set_contact_source(nullptr, {.solver = ContactSolver::kExact});
  const Machine machine = add_machine(world, jointed_blocks(), {.pose = kPose, .velocity = {1, 0, 0}, .tied = false});
  EXPECT_EQ(machine.joints[0], JointId{});
  const Vec3 start = world.body(machine.bodies[1]).pose.p;
  for (int step = 0; step < 50; ++step) world.step();
  const double g = world.options().gravity.z();
  EXPECT_LT((world.body(machine.bodies[1]).pose.p - start - Vec3(0.5, 0, 0.125 * g)).norm(), 1e-6);
}

TEST(Machine, OneThatIsRefusedLeavesNothingInTheWorld) {
  World world({.step = 0.01});
  Asset asset = jointed_blocks();
  asset.joints[1].spec.frame.axes *= 2.0;
  EXPECT_THROW(add_machine(world, asset), InvalidArgument);
  EXPECT_EQ(world.body_count(), 0u);
}

}  // namespace
}  // namespace limber
