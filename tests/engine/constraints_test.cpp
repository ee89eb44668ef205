#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "asked.h"
#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::depth_below_origin;
using testing::kFrame;
using testing::kMarked;
using testing::kSampleSize;
using testing::sample_model;

constexpr double kExact = 1e-9;  // of a length

JointSpec hinge_at(const Vec3& origin) {
  JointSpec spec{.type = JointType::kRevolute, .frame = {.origin = origin}};
  spec.frame.axes.col(0) = Vec3::UnitY(), spec.frame.axes.col(1) = Vec3::UnitZ(),
  spec.frame.axes.col(2) = Vec3::UnitX();
  return spec;
}

/// Links along x from `from`, the first hinged to the world.
struct Chain {
  std::vector<BodyId> links;
  std::vector<JointId> joints;
};
Chain add_chain(World& world, const std::shared_ptr<const ModalModel>& model, int links, const Vec3& from) {
  Chain chain;
  for (int i = 0; i < links; ++i) {
    const Vec3 start = from + i * kSampleSize * Vec3::UnitX();
    chain.links.push_back(world.add_body(model, {.pose = {.p = start + 0.5 * kSampleSize * Vec3::UnitX()}}));
    chain.joints.push_back(world.add_joint(i == 0 ? BodyId{} : chain.links[static_cast<std::size_t>(i) - 1],
                                           chain.links.back(), hinge_at(start), {.radius = 0.25}, {.radius = 0.25}));
  }
  return chain;
}

double total_energy(const World& world, const Chain& chain) {
  double sum = 0.0;
  for (const BodyId id : chain.links) sum += world.energy(id).total();
  return sum;
}

/// All modes of a stiff body answer a hand statically. Let go, they are at rest once more, and stay so.
TEST(Constraints, AStiffBodyThatIsLetGoKeepsItsEnergy) {
  World world;
  world.set_contact_source(nullptr, testing::exactly());
  const BodyId body = world.add_body(sample_model({.modes = 8, .lowest_hz = 100.0}));
  const HandleId hand = world.add_handle(body, kMarked);
  Vec3 target = world.position(body, kMarked);
  for (int i = 0; i < 10; ++i) {
    target += Vec3(0.1, 0.02, 0.03);
    world.set_handle_target(hand, {.position = target});
    world.step();
  }
  world.remove_handle(hand);
  EXPECT_GT(world.energy(body).elastic, 0.0);
  world.step();
  const double let_go = world.energy(body).total();
  EXPECT_EQ(world.energy(body).elastic, 0.0);
  for (int i = 0; i < 60; ++i) world.step();
  EXPECT_NEAR(world.energy(body).total(), let_go, 1e-12 * let_go);
}

TEST(Constraints, DraggedPointIsWhereTheHandIs) {
  World world;
  world.set_contact_source(nullptr, testing::exactly());
  const BodyId body = world.add_body(sample_model({.modes = 8, .lowest_hz = 12.0, .decay = 0.5}));
  const HandleId hand = world.add_handle(body, kMarked);
  Vec3 target = world.position(body, kMarked);
  for (int i = 0; i < 120; ++i) {
    target += Vec3(0.001, 0.002 * std::sin(0.1 * i), 0.003);
    world.set_handle_target(hand, {.position = target});
    world.step();
    ASSERT_LT((world.position(body, kMarked) - target).norm(), kExact);
  }
  EXPECT_GT(world.handle(hand).force.z(), 0.0);
  EXPECT_EQ(world.constraint_report().islands, 1);
  EXPECT_TRUE(world.constraint_report().solved);
  world.remove_handle(hand);
  EXPECT_FALSE(world.contains(hand));
  const double z = world.position(body, kMarked).z();
  for (int i = 0; i < 60; ++i) world.step();
  EXPECT_LT(world.position(body, kMarked).z(), z - 0.5) << "let go, it falls";
}

TEST(Constraints, ChainOfFlexibleLinksHangsTogetherAndGainsNothing) {
  World world;
  world.set_contact_source(nullptr, testing::exactly());
  const Chain chain = add_chain(world, sample_model({.modes = 8, .lowest_hz = 25.0, .decay = 0.5}), 4, {0, 0, 2});
  double before = total_energy(world, chain);
  const double scale = 4.0 * world.model(chain.links[0]).data().mass * 9.80665 * kSampleSize;
  for (int i = 0; i < 600; ++i) {
    world.step();
    for (const JointId joint : chain.joints) {
      EXPECT_LT(world.joint(joint).distance_error, kExact);
      EXPECT_LT(world.joint(joint).angle_error, kExact);
    }
    const double energy = total_energy(world, chain);
    EXPECT_LT(energy - before, 1e-6 * scale);
    before = energy;
  }
}

// Beyond a radian a step the rows of the step's start are no guide to its end.
TEST(Constraints, StepsSettleWhereLinksTurnByMoreThanARadianInEach) {
  constexpr int kSteps = 120;
  World world;
  const Chain chain = add_chain(world, sample_model({.modes = 0}), 3, {0, 0, 2});
  const double spin = 1.3 / world.options().step;  // rad/s
  for (std::size_t i = 0; i < chain.links.size(); ++i)
    world.set_velocity(chain.links[i], {0.0, 0.0, -spin * kSampleSize * (static_cast<double>(i) + 0.5)},
                       {0.0, spin, 0.0});
  int unsettled = 0;
  for (int i = 0; i < kSteps; ++i) {
    world.step();
    if (!world.constraint_report().solved) ++unsettled;
  }
  EXPECT_EQ(unsettled, 0);
}

// Impulses in the middle of a step bring together what those at its start cannot, without shorter steps.
TEST(Constraints, ChainsThatWhipHangTogether) {
  int cuts = 0;
  for (const auto& [links, step] : {std::pair(3, 0.1), std::pair(8, 1.0 / 60.0)}) {
    World world({.step = step});
    world.set_contact_source(nullptr, testing::exactly());
    std::vector<JointId> joints;
    BodyId last{};
    for (int i = 0; i < links; ++i) {
      const Vec3 start(i * kSampleSize, 0.0, 2.0);
      JointSpec ball{.type = JointType::kBall};
      ball.frame.origin = start;
      const BodyId link =
          world.add_body(sample_model({.modes = 0}), {.pose = {.p = start + 0.5 * kSampleSize * Vec3::UnitX()}});
      joints.push_back(world.add_joint(last, link, ball));
      last = link;
    }
    for (double time = 0.0; time < testing::all_or_tenth(30); time += step) {
      world.step();
      EXPECT_TRUE(world.constraint_report().solved) << links << " links at " << time << " s";
      cuts += world.constraint_report().attempts.cuts();
      for (const JointId joint : joints) EXPECT_LT(world.joint(joint).distance_error, kExact);
    }
  }
  EXPECT_EQ(cuts, 0);
}

TEST(Constraints, IslandsAreWhatConstraintsTieTogether) {
  World world;
  const auto model = sample_model({.modes = 0});
  for (int i = 0; i < 3; ++i) add_chain(world, model, 2 + i, {0.0, 2.0 * i, 0.0});
  world.add_body(model);
  world.step();
  EXPECT_EQ(world.constraint_report().islands, 3);
  EXPECT_EQ(world.constraint_report().bodies, 2 + 3 + 4);
}

TEST(Constraints, BodiesWithoutConstraintsFallAsBefore) {
  World with, without;
  const auto model = sample_model();
  add_chain(with, model, 2, {5, 5, 5});
  const BodyId a = with.add_body(model, {.angular_velocity = {1, 2, 3}});
  const BodyId b = without.add_body(model, {.angular_velocity = {1, 2, 3}});
  for (int i = 0; i < 50; ++i) with.step(), without.step();
  EXPECT_EQ(with.body(a).pose.p, without.body(b).pose.p);
  EXPECT_EQ(with.body(a).pose.q.vector(), without.body(b).pose.q.vector());
}

/// A hand that goes where the ground is cannot have its way; nothing is thrown, and it drags the block along.
TEST(Constraints, AHandThatPushesABlockIntoTheGroundThrowsNothing) {
  constexpr double kDepth = 0.005, kSpeed = 0.5;  // m, m/s
  for (const int modes : {0, 8}) {
    ContactFinder finder;
    World world;
    world.set_contact_source(&finder, testing::exactly({.friction = 0.5}));
    world.add_static(std::make_shared<Shape>(HalfSpace{}));
    const auto model = sample_model({.modes = modes, .lowest_hz = 30.0, .decay = 6.0});
    const BodyId block = world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
    for (int i = 0; i < 30; ++i) world.step();
    const HandleId hand = world.add_handle(block, kMarked);
    Vec3 target = world.position(block, kMarked);
    double farthest = 0.0, fastest = 0.0;
    IslandStatusCounts statuses;
    for (int i = 0; i < 300; ++i) {
      target += Vec3(kSpeed * kFrame, 0.0, i < 30 ? -kDepth / 30.0 : 0.0);
      world.set_handle_target(hand, {.position = target});
      world.step();
      statuses.add(world.constraint_report().statuses);
      farthest = std::max(farthest, (world.position(block, kMarked) - target).norm());
      fastest = std::max(fastest, world.body(block).velocity.norm());
    }
    EXPECT_LE(statuses[IslandStatus::kFailed], 3) << modes;
    // A rigid block cannot give way: hand and ground contradict each other in each of the 300 steps.
    EXPECT_LE(statuses[IslandStatus::kLimit], modes == 0 ? 300 : 3)
        << modes << ": rounds may use up their Newton steps";
    EXPECT_LT(farthest, 0.1 * kDepth) << modes << ": it tips instead";
    EXPECT_LT(fastest, 1.1 * kSpeed) << modes;
  }
}

/// A chain of rigid links that is let go level over the ground, so that its end falls on it and drags, also where the
/// last link is a hundred times as heavy: all rows meet, joints and ground, in every step.
TEST(Constraints, AChainWhoseEndDragsOnTheGroundHangsTogetherAndGainsNothing) {
  constexpr double kRise = 1e-9;  // of Σ m g size
  for (const auto& [times, height] :
       {std::pair(1.0, 1.2), {1.0, 1.2 - 1e-6}, {1.0, 1.2001}, {100.0, 1.2}, {100.0, 1.20001}}) {
    testing::GroundedWorld scene(testing::exactly({.friction = 0.5, .recovery_speed = 0.0}));
    World& world = scene.world;
    const auto model = sample_model({.modes = 0});
    ModalModelData heavy = testing::sample_model_data({.modes = 0});
    heavy.mass *= times, heavy.inertia *= times;
    Chain chain = add_chain(world, model, 3, {0.0, 0.0, height});
    const Vec3 end(3.0 * kSampleSize, 0.0, height);
    const BodyId last = world.add_body(std::make_shared<const ModalModel>(std::move(heavy)),
                                       {.pose = {.p = end + 0.5 * kSampleSize * Vec3::UnitX()}});
    chain.joints.push_back(
        world.add_joint(chain.links.back(), last, hinge_at(end), {.radius = 0.25}, {.radius = 0.25}));
    chain.links.push_back(last);
    double scale = 0.0, before = total_energy(world, chain);
    for (const BodyId id : chain.links) scale += world.model(id).data().mass * testing::kGravity * kSampleSize;
    int pressed = 0;
    for (int i = 0; i < 240; ++i) {
      world.step();
      ASSERT_TRUE(world.constraint_report().solved) << times << ", step " << i;
      for (const JointId joint : chain.joints) ASSERT_LT(world.joint(joint).distance_error, kExact) << times;
      const double now = total_energy(world, chain);
      ASSERT_LT(now - before, kRise * scale) << times << ", step " << i;
      before = now;
      pressed += world.contact_events().empty() ? 0 : 1;
    }
    EXPECT_GT(pressed, 120) << times;
    EXPECT_GT(testing::lowest(world, last), -1e-6 * kSampleSize) << times;
  }
}

/// An arm that turns at 20 rad/s, a third of a radian a step, between stops. What it turns on does not give.
TEST(Constraints, StopsThatAreHitAtTwentyRadiansASecondHold) {
  constexpr double kStop = 0.5;
  for (const int modes : {0, 8}) {
    World world;
    world.set_contact_source(nullptr, testing::exactly());
    JointSpec hinge = hinge_at({0.0, 0.0, 1.0});
    hinge.limits.rotation = {-kStop, kStop};
    const Vec3 omega(0.0, 20.0, 0.0), arm = 0.5 * kSampleSize * Vec3::UnitX();
    const auto model = sample_model({.modes = modes, .lowest_hz = 30.0, .decay = 6.0});
    const BodyId body = world.add_body(
        model, {.pose = {.p = Vec3::UnitZ() + arm}, .velocity = omega.cross(arm), .angular_velocity = omega});
    const JointId joint = world.add_joint(BodyId{}, body, hinge, {.radius = 0.25}, {.radius = 0.25});
    const double scale = world.energy(body).total();
    double before = scale, farthest = 0.0;
    for (int i = 0; i < 300; ++i) {
      world.step();
      ASSERT_TRUE(world.constraint_report().solved) << modes << ", step " << i;
      const double now = world.energy(body).total();
      ASSERT_LT(now - before, 1e-12 * scale) << modes << ", step " << i;
      before = now;
      farthest = std::max(farthest, std::abs(world.joint(joint).position[0]));
      ASSERT_LT(world.joint(joint).distance_error, kExact);
    }
    EXPECT_GT(farthest, kStop - 1e-6) << modes << ": it has come to a stop";
    EXPECT_LT(farthest, kStop + 1e-9) << modes;
  }
}

TEST(Constraints, BodiesTakeTheirHandlesAndJointsWithThem) {
  World world;
  const Chain chain = add_chain(world, sample_model(), 3, Vec3::Zero());
  const HandleId hand = world.add_handle(chain.links[1], kMarked);
  world.step();
  world.remove_body(chain.links[1]);
  EXPECT_FALSE(world.contains(hand));
  EXPECT_TRUE(world.contains(chain.joints[0]));
  EXPECT_FALSE(world.contains(chain.joints[1]));
  EXPECT_FALSE(world.contains(chain.joints[2]));
  EXPECT_THROW(world.handle(hand), InvalidArgument);
  const double z = world.body(chain.links[2]).pose.p.z();
  for (int i = 0; i < 30; ++i) world.step();
  EXPECT_LT(world.body(chain.links[2]).pose.p.z(), z - 0.5) << "the last link falls";
  const HandleId other = world.add_handle(chain.links[0], kMarked);
  EXPECT_TRUE(world.contains(other));
  EXPECT_FALSE(world.contains(hand)) << "an id stays invalid though its place is used again";
}

TEST(Constraints, RefuseWhatIsNotThere) {
  World world;
  const BodyId body = world.add_body(sample_model());
  EXPECT_THROW(world.add_handle(BodyId{7, 1}, kMarked), InvalidArgument);
  EXPECT_THROW(world.add_handle(body, {.triangle = 99}), InvalidArgument);
  EXPECT_THROW(world.add_handle(body, kMarked, {.max_force = -1.0}), InvalidArgument);
  EXPECT_THROW(world.add_joint(body, body, {}), InvalidArgument);
  EXPECT_THROW(world.add_joint(BodyId{}, BodyId{}, {}), InvalidArgument);
  EXPECT_THROW(world.add_joint(BodyId{}, body, {}, {}, {.radius = -1.0}), InvalidArgument);
  EXPECT_THROW(world.remove_joint(JointId{0, 1}), InvalidArgument);
  const JointId joint = world.add_joint(BodyId{}, body, hinge_at(Vec3::Zero()));
  EXPECT_THROW(world.set_joint_actuation(joint, 1, {}), InvalidArgument);
  EXPECT_FALSE(world.contains(HandleId{joint.index, joint.generation})) << "a joint's id is no handle's";
}

TEST(Constraints, MotorTurnsTheWorld) {
  World world({.gravity = Vec3::Zero()});
  world.set_contact_source(nullptr, testing::exactly());
  const BodyId body = world.add_body(sample_model({.modes = 0}), {.pose = {.p = {0.3, 0, 0}}});
  const JointId joint = world.add_joint(BodyId{}, body, hinge_at(Vec3::Zero()));
  world.set_joint_actuation(joint, 0, {.motor_velocity = 3.0, .motor_max_force = 1e4});
  for (int i = 0; i < 180; ++i) world.step();
  EXPECT_NEAR(world.joint(joint).position[0], 9.0, 1e-6) << "three seconds at 3 rad/s";
}

std::uint64_t hash_of_chains(Jobs& jobs) {
  World world({}, jobs);
  const auto model = sample_model({.modes = 6, .lowest_hz = 20.0});
  std::vector<HandleId> hands;
  for (int i = 0; i < 12; ++i) {
    const Chain chain = add_chain(world, model, 1 + i % 4, {0.0, 2.0 * i, 0.0});
    hands.push_back(world.add_handle(chain.links.back(), kMarked, {.stiffness = 200.0, .damping = 3.0}));
  }
  for (int step = 0; step < testing::all_or_tenth(200); ++step) {
    for (const HandleId hand : hands)
      world.set_handle_target(hand, {.position = world.handle(hand).target.position + Vec3(0.0, 0.001, 0.002)});
    world.step();
  }
  return world.state_hash();
}

TEST(Constraints, StateHashIsTheSameForAnyThreadCount) {
  const std::uint64_t serial = hash_of_chains(serial_jobs());
  for (int run = 0; run < 3; ++run) {
    TbbJobs jobs;
    EXPECT_EQ(hash_of_chains(jobs), serial);
  }
}

TEST(Constraints, StepDoesNotAllocateOnceWarm) {
  World world;
  const auto model = sample_model({.modes = 6, .lowest_hz = 20.0});
  const Chain chain = add_chain(world, model, 3, Vec3::Zero());
  JointSpec limited = hinge_at({0.0, 3.0, 0.0});
  limited.limits.rotation = {-0.3, 0.3};
  const BodyId door = world.add_body(model, {.pose = {.p = {0.3, 3.0, 0.0}}});
  const JointId joint = world.add_joint(BodyId{}, door, limited);
  world.set_joint_actuation(joint, 0, {.motor_velocity = 1.0, .motor_max_force = 2.0, .friction = 0.1});
  const HandleId hand = world.add_handle(chain.links.back(), kMarked, {.stiffness = 100.0, .damping = 1.0});
  const auto frame = [&] {
    world.set_handle_target(hand, {.position = world.handle(hand).target.position + Vec3(0.0, 0.001, 0.002)});
    world.step();
  };
  for (int i = 0; i < 60; ++i) frame();
  const long before = testing::allocations();
  for (int i = 0; i < 100; ++i) frame();
  EXPECT_EQ(testing::allocations() - before, 0);
}

TEST(Constraints, WithAContactSourceABodyFallsOnTheGroundAndStaysThere) {
  ContactFinder finder;
  World world;
  world.set_contact_source(&finder);
  const BodyId ground = world.add_static(std::make_shared<const Shape>(HalfSpace{}));
  const BodyId body =
      world.add_body(sample_model({.modes = 6, .lowest_hz = 60.0, .decay = 20.0}), {.pose = {.p = {0.0, 0.0, 0.5}}});
  bool begun = false;
  for (int i = 0; i < 300; ++i) {
    world.step();
    for (const ContactEvent& event : world.contact_events()) begun = begun || event.phase == ContactPhase::kBegun;
  }
  EXPECT_TRUE(begun);
  const double height = testing::depth_below_origin(world.model(body));
  EXPECT_NEAR(world.body(body).pose.p.z(), height, 1e-3 * kSampleSize);
  EXPECT_LT(world.body(body).velocity.norm(), 1e-6);
  EXPECT_THROW(world.body(ground), InvalidArgument);
  world.remove_body(ground);
  for (int i = 0; i < 60; ++i) world.step();
  EXPECT_LT(world.body(body).pose.p.z(), -1.0) << "nothing holds it any more";
}

}  // namespace
}  // namespace limber
