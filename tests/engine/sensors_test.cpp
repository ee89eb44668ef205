// Sensors, user data and lists: what a game keeps its books by.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::sample_model;
using testing::share;

/// A ball falls through a light gate of 1 m: it comes in and goes out when a stone does, and as fast as without it.
TEST(Sensors, ABallFallsThroughAGate) {
  constexpr double kStep = 1.0 / 240.0, kGravity = 9.80665, kRadius = 0.1;
  World world({.step = kStep});
  const BodyId gate = world.add_sensor(share(Box{{1, 1, 0.5}}), {.p = {0, 0, -2}});
  const BodyId ball = world.add_rigid(share(Sphere{kRadius}), 1000.0, {.user_data = 4});
  world.set_user_data(gate, 6);
  double in = -1.0, out = -1.0;
  for (int i = 0; i < 240; ++i) {
    world.step();
    for (const SensorEvent& e : world.sensor_events()) {
      EXPECT_EQ(e.sensor, gate);
      EXPECT_EQ(e.body, ball);
      EXPECT_EQ(e.user_data_body, 4u);
      EXPECT_EQ(e.user_data_sensor, 6u);
      (e.began ? in : out) = world.time();
    }
  }
  EXPECT_NEAR(in, std::sqrt(2.0 * (1.5 - kRadius) / kGravity), kStep);
  EXPECT_NEAR(out, std::sqrt(2.0 * (2.5 + kRadius) / kGravity), kStep);
  EXPECT_NEAR(world.body(ball).velocity.z(), -kGravity, 1e-12);
}

TEST(Sensors, FiltersRemovalAndPosesCount) {
  GroundedWorld g({}, {.gravity = Vec3::Zero()});
  const auto box = share(Box{});
  const BodyId seen = g.world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 3}}, .filter = {.layers = 2}});
  g.world.add_rigid(box, 500.0, {.pose = {.p = {0, 0, 5}}, .filter = {.layers = 4}});
  const BodyId sensor = g.world.add_sensor(share(Sphere{3.0}), {.p = {0, 0, 4}}, {.mask = 2});
  const auto inside = [&] {
    std::vector<BodyId> bodies;
    g.world.list_inside(sensor, bodies);
    return bodies;
  };
  g.step(1);
  EXPECT_EQ(inside(), std::vector<BodyId>{seen});
  EXPECT_EQ(g.world.sensor_events().size(), 1u);
  g.step(1);
  EXPECT_TRUE(g.world.sensor_events().empty());  // stays
  g.world.set_sensor_pose(sensor, {.p = {20, 0, 0}});
  g.step(1);
  ASSERT_EQ(g.world.sensor_events().size(), 1u);
  EXPECT_FALSE(g.world.sensor_events()[0].began);
  g.world.set_sensor_pose(sensor, {.p = {0, 0, 4}});
  g.step(1);
  g.world.remove_body(seen);
  g.step(1);
  ASSERT_EQ(g.world.sensor_events().size(), 1u);
  EXPECT_EQ(g.world.sensor_events()[0].body, seen);
  g.world.remove_body(sensor);
  EXPECT_THROW(g.world.set_sensor_pose(sensor, {}), InvalidArgument);
  EXPECT_THROW(g.world.set_sensor_pose(g.ground, {}), InvalidArgument);
  EXPECT_THROW(g.world.add_sensor(share(HalfSpace{})), InvalidArgument);
  EXPECT_THROW(g.world.add_sensor(nullptr), InvalidArgument);
}

TEST(Sensors, ARestoredWorldTellsTheSameAgain) {
  World world({.step = 1.0 / 60.0});
  const BodyId gate = world.add_sensor(share(Box{{1, 1, 0.5}}), {.p = {0, 0, -2}});
  world.add_body(sample_model({.modes = 3}));
  std::vector<std::byte> state;
  const auto fall = [&] {
    std::vector<std::pair<double, bool>> told;
    for (int i = 0; i < 60; ++i) {
      if (i == 10) world.set_sensor_pose(gate, {.p = {0, 0, -2.5}});
      world.step();
      for (const SensorEvent& e : world.sensor_events()) told.emplace_back(world.time(), e.began);
    }
    return told;
  };
  world.save_state(state);
  const auto first = fall();
  world.restore_state(state);
  EXPECT_EQ(fall(), first);
  EXPECT_EQ(first.size(), 2u);
}

TEST(Sensors, AWarmStepAllocatesNothing) {
  GroundedWorld g;
  g.world.add_sensor(share(Box{{1, 1, 1}}));
  for (int i = 0; i < 5; ++i)
    g.world.add_rigid(share(Box{{0.2, 0.2, 0.2}}), 500.0, {.pose = {.p = {0.5 * i - 1.0, 0, 0.2}}});
  g.step(30);
  const long before = testing::allocations();
  g.step(30);
  EXPECT_EQ(testing::allocations(), before);
}

TEST(UserData, ItStaysWithBodiesHandlesAndJoints) {
  GroundedWorld g;
  const BodyId a = g.world.add_rigid(share(Box{}), 500.0, {.pose = {.p = {0, 0, 0.5}}, .user_data = 7});
  const BodyId b = g.world.add_body(sample_model({}), {.pose = {.p = {5, 0, 5}}});
  const HandleId hand = g.world.add_handle(a, {.triangle = 0});
  const JointId joint = g.world.add_joint(a, b, {.type = JointType::kRevolute});
  g.world.set_user_data(g.ground, 1);
  g.world.set_user_data(hand, 2);
  g.world.set_user_data(joint, ~std::uint64_t{0});
  std::vector<std::byte> state;
  g.world.save_state(state);
  g.world.set_user_data(a, 0);
  g.world.remove_joint(joint);
  g.world.restore_state(state);
  EXPECT_EQ(g.world.user_data(a), 7u);
  EXPECT_EQ(g.world.user_data(b), 0u);
  EXPECT_EQ(g.world.user_data(g.ground), 1u);
  EXPECT_EQ(g.world.user_data(hand), 2u);
  EXPECT_EQ(g.world.user_data(joint), ~std::uint64_t{0});
  g.world.remove_handle(hand);
  EXPECT_EQ(g.world.user_data(g.world.add_handle(a, {.triangle = 0})), 0u);
  EXPECT_THROW(g.world.user_data(hand), InvalidArgument);
}

TEST(UserData, ListsHoldWhatThereIs) {
  GroundedWorld g;
  const BodyId a = g.world.add_rigid(share(Box{}), 500.0, {.pose = {.p = {0, 0, 2}}});
  const BodyId b = g.world.add_rigid(share(Box{}), 500.0, {.pose = {.p = {3, 0, 2}}});
  const HandleId hand = g.world.add_handle(a, {.triangle = 0});
  const JointId joint = g.world.add_joint(a, b, {.type = JointType::kFixed});
  std::vector<BodyId> bodies;
  std::vector<HandleId> handles;
  std::vector<JointId> joints;
  g.world.list(bodies), g.world.list(handles), g.world.list(joints);
  EXPECT_EQ(bodies, (std::vector<BodyId>{g.ground, a, b}));
  EXPECT_EQ(handles, std::vector<HandleId>{hand});
  EXPECT_EQ(joints, std::vector<JointId>{joint});
  EXPECT_EQ(g.world.id_of(static_cast<Index>(a.index)), a);
  g.world.remove_body(a);
  g.world.list(bodies), g.world.list(handles), g.world.list(joints);
  EXPECT_EQ(bodies, (std::vector<BodyId>{g.ground, b}));
  EXPECT_TRUE(handles.empty());
  EXPECT_TRUE(joints.empty());
  EXPECT_EQ(g.world.id_of(static_cast<Index>(a.index)), BodyId{});
}

}  // namespace
}  // namespace limber
