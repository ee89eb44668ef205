// Saving the state of a world and going back to it: what follows is the same to the bit.
#include <gtest/gtest.h>

#include <cstddef>
#include <functional>
#include <vector>

#include "asked.h"
#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"
#include "thread_jobs.h"

namespace limber::testing {
namespace {

using State = std::vector<std::byte>;

State saved(const World& world) {
  State state;
  world.save_state(state);
  return state;
}

/// A world and what is done to it before each step.
struct Played {
  World& world;
  std::function<void(int)> act = [](int) {};
};

/// After `before` steps: saves, goes on, goes back, goes on again; all states of the two futures are the same.
void expect_same_future(const Played& played, int before, int after) {
  for (int i = 0; i < before; ++i) played.act(i), played.world.step();
  const State start = saved(played.world);
  std::vector<State> states;
  std::vector<std::uint64_t> hashes;
  const auto go_on = [&](auto&& see) {
    for (int i = 0; i < after; ++i) {
      played.act(before + i);
      played.world.step();
      see(static_cast<std::size_t>(i));
    }
  };
  go_on([&](std::size_t) {
    states.push_back(saved(played.world));
    hashes.push_back(played.world.state_hash());
  });
  played.world.restore_state(start);
  ASSERT_EQ(saved(played.world), start);
  go_on([&](std::size_t i) {
    ASSERT_EQ(played.world.state_hash(), hashes[i]) << "step " << i;
    ASSERT_TRUE(saved(played.world) == states[i]) << "step " << i;
  });
  EXPECT_NE(start, states.back()) << "nothing happened";
}

/// Boxes in a heap, some of them falling; on `slope` radians of tilt they slide.
void drop_boxes(GroundedWorld& scene, int count, int modes) {
  const auto model = damped_box(modes, 60.0);
  for (int i = 0; i < count; ++i)
    scene.world.add_body(model, {.pose = {{}, {0.12 * (i % 3), 0.11 * (i / 3 % 2), 0.15 + 0.22 * (i / 4)}},
                                 .angular_velocity = {0.3 * i, 0.2, -0.1 * i}});
}

TEST(Rollback, APileGoesOnAsItDid) {
  for (const int modes : {0, 6}) {
    GroundedWorld scene;
    drop_boxes(scene, 6, modes);
    expect_same_future({scene.world}, 30, 30);
  }
}

TEST(Rollback, ImpactsAndRollingGoOn) {
  GroundedWorld scene(exactly({.rolling_friction = 0.05}));
  drop_boxes(scene, 4, 6);
  scene.world.add_body(damped_box(0, 60.0), {.pose = {{}, {1.0, 0.0, 0.3}},
                                             .velocity = {1.0, 0.0, 0.0},
                                             .shape = std::make_shared<const Shape>(Sphere{0.1})});
  for (const int before : all_or_first<int>({3, 12, 30})) expect_same_future({scene.world}, before, 20);
}

TEST(Rollback, SleepersSleepOnAndWakeAtTheSameStep) {
  GroundedWorld scene({}, {.sleep = {.enabled = true, .time = 0.2}});
  const auto model = damped_box(0, 60.0);
  std::vector<BodyId> boxes;
  for (int i = 0; i < 3; ++i)
    boxes.push_back(scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model) + 0.2 * i}}}));
  const auto hit = [&](int step) {
    if (step == 130) scene.world.apply_impulse(boxes[2], {.triangle = 0}, {0.5, 0.1, 0.0});
  };
  expect_same_future({scene.world, hit}, 5, 35);
  scene.step(60);
  ASSERT_TRUE(scene.world.is_asleep(boxes[0]));
  expect_same_future({scene.world, hit}, 100, 100);
}

TEST(Rollback, ASleeperMovedAwayMeetsWhatComesToItsOldPlace) {
  GroundedWorld scene({}, {.sleep = {.enabled = true, .time = 0.2}});
  const auto model = damped_box(0, 60.0);
  const BodyId lying = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, depth_below_origin(*model)}}});
  scene.step(60);
  ASSERT_TRUE(scene.world.is_asleep(lying));
  const State here = saved(scene.world);
  scene.world.set_pose(lying, {{}, {5.0, 0.0, depth_below_origin(*model)}});
  scene.step(60);
  ASSERT_TRUE(scene.world.is_asleep(lying));
  scene.world.restore_state(here);
  const BodyId falling = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 0.6}}});
  scene.step(60);
  EXPECT_GT(scene.world.body(falling).pose.p.z(), 0.2) << "it lies on the other";
}

TEST(Rollback, FastBodiesGoOn) {
  GroundedWorld scene;
  scene.world.add_static(std::make_shared<Shape>(Box{{0.01, 1.0, 1.0}}), {{}, {2.0, 0.0, 1.0}});
  drop_boxes(scene, 4, 6);
  scene.world.add_body(damped_box(6, 60.0), {.pose = {{}, {-1.0, 0.1, 0.9}}, .velocity = {60.0, 0.0, 0.0}});
  expect_same_future({scene.world}, 1, 20);
}

TEST(Rollback, JointsHandlesLoadsAndActuationGoOn) {
  GroundedWorld scene({}, {.substeps = 2});
  const auto model = damped_box(6, 60.0);
  const BodyId a = scene.world.add_body(model, {.pose = {{}, {0.0, 0.0, 1.0}}}),
               b = scene.world.add_body(model, {.pose = {{}, {0.3, 0.0, 1.0}}});
  JointSpec spec{.type = JointType::kRevolute, .frame = {.origin = {0.15, 0.0, 1.0}}};
  spec.limits.rotation = {-0.5, 0.7};
  const JointId hinge = scene.world.add_joint(a, b, spec);
  scene.world.add_joint({}, a, {.type = JointType::kBall, .frame = {.origin = {0.0, 0.0, 1.2}}});
  scene.world.set_joint_actuation(hinge, 0, {.motor_velocity = 1.0, .motor_max_force = 0.3, .friction = 0.01});
  const HandleId hand =
      scene.world.add_handle(b, {.triangle = 3}, {.max_force = 20.0, .stiffness = 300.0, .damping = 3.0});
  const auto act = [&](int step) {
    if (step == 20) scene.world.apply_impulse(b, {.triangle = 1}, {0.0, 0.1, 0.0}, Axes::kWorld, 0.01);
    if (step % 7 == 0)
      scene.world.set_handle_target(hand, {.position = {0.3, 0.05 * step / 7, 1.1}, .velocity = {0.1, 0, 0}});
    scene.world.apply_force(a, {.triangle = 0}, {0.0, 0.3, 0.0});
  };
  expect_same_future({scene.world, act}, 17, 40);
  // With loads that wait for the coming step.
  scene.world.apply_force(a, {.triangle = 0}, {1.0, 0.0, 0.0});
  scene.world.apply_impulse(b, {.triangle = 1}, {0.0, 0.1, 0.0}, Axes::kWorld, 0.012);
  expect_same_future({scene.world}, 0, 10);
}

TEST(Rollback, BodiesThatHangOrAreLedGoOn) {
  World world;
  std::vector<BodyId> bodies;
  for (const FrameMotion motion : kAllMotions)
    bodies.push_back(world.add_body(sample_model({.motion = motion}), {.angular_velocity = {1, 2, 3}}));
  const auto act = [&](int step) {
    for (const BodyId body : bodies) world.apply_impulse(body, kMarked, {0.1, 0.0, 0.02 * step}, Axes::kBody, 0.01);
    world.set_kinematic_frame(bodies.back(), {.pose = {{}, {0.01 * step, 0, 0}}, .velocity = {0.6, 0, 0}});
  };
  expect_same_future({world, act}, 20, 50);
}

TEST(Rollback, WhatWasMadeOrRemovedSinceIsAsItWas) {
  GroundedWorld scene;
  drop_boxes(scene, 3, 6);
  World& world = scene.world;
  const auto model = damped_box(6, 60.0);
  const BodyId a = world.add_body(model, {.pose = {{}, {2.0, 0.0, 1.0}}}),
               b = world.add_body(model, {.pose = {{}, {2.1, 0.0, 1.0}}});
  const JointId hinge = world.add_joint(a, b, {.type = JointType::kRevolute, .frame = {.origin = {2.05, 0.0, 1.0}}});
  const HandleId hand = world.add_handle(a, {.triangle = 2});
  scene.step(5);
  const State start = saved(world);
  scene.step(30);
  const std::uint64_t future = world.state_hash();
  const State end = saved(world);

  world.restore_state(start);
  world.remove_joint(hinge);
  world.remove_handle(hand);
  const BodyId guest = world.add_body(damped_box(3, 50.0), {.pose = {{}, {0.0, 0.0, 1.5}}});
  world.add_handle(guest, {.triangle = 0});
  world.set_gravity({0.0, 3.0, 0.0});
  scene.step(20);
  EXPECT_NE(world.state_hash(), future);

  world.restore_state(start);
  EXPECT_EQ(saved(world), start);
  EXPECT_FALSE(world.contains(guest));
  EXPECT_TRUE(world.contains(hinge));
  EXPECT_TRUE(world.contains(hand));
  EXPECT_EQ(world.options().gravity, WorldOptions{}.gravity);
  scene.step(30);
  EXPECT_EQ(world.state_hash(), future);
  EXPECT_EQ(saved(world), end);
}

/// The same calls on both sides of a connection: a state that was sent makes one world of two.
TEST(Rollback, AnotherWorldTakesTheState) {
  ThreadJobs jobs(2);
  GroundedWorld host, guest({}, {}, jobs);
  for (GroundedWorld* scene : {&host, &guest}) drop_boxes(*scene, 6, 6);
  host.step(50);
  guest.world.restore_state(saved(host.world));
  for (int i = 0; i < 30; ++i) {
    host.step(1), guest.step(1);
    ASSERT_EQ(host.world.state_hash(), guest.world.state_hash());
  }
}

TEST(Rollback, DrawingAfterwardsIsTheSame) {
  GroundedWorld scene;
  drop_boxes(scene, 2, 6);
  const auto indented = sample_model({.modes = 6, .dropped = 14, .decay = 10.0});
  const BodyId body = scene.world.add_body(indented, {.pose = {{}, {3.0, 0.0, depth_below_origin(*indented) + 0.01}}});
  scene.step(30);
  const auto drawn = [&] {
    std::vector<float> positions(3 * static_cast<std::size_t>(scene.world.model(body).render().vertices()));
    scene.world.reconstruct(body, positions, {}, 0.3);
    return positions;
  };
  const State state = saved(scene.world);
  const std::vector<float> then = drawn();
  scene.step(10);
  EXPECT_NE(drawn(), then);
  scene.world.restore_state(state);
  EXPECT_EQ(drawn(), then);
}

TEST(Rollback, AWarmSaveAllocatesNothing) {
  GroundedWorld scene;
  drop_boxes(scene, 9, 6);
  scene.step(60);
  State state;
  scene.world.save_state(state);
  state.reserve(2 * state.size());
  const long before = allocations();
  for (int i = 0; i < 20; ++i) scene.world.save_state(state);
  EXPECT_EQ(allocations() - before, 0);
}

TEST(Rollback, WhatDoesNotFitIsRefusedAndChangesNothing) {
  GroundedWorld scene;
  drop_boxes(scene, 3, 6);
  World& world = scene.world;
  const BodyId gone = world.add_body(damped_box(2, 60.0), {.pose = {{}, {5.0, 0.0, 1.0}}});
  scene.step(10);
  const State good = saved(world);
  scene.step(5);
  const State now = saved(world);
  const auto refused = [&](const State& state) {
    EXPECT_THROW(world.restore_state(state), InvalidArgument);
    EXPECT_EQ(saved(world), now);
  };
  refused({});
  for (std::size_t size = 0; size < good.size(); size += 97)
    refused(State(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(size)));
  for (std::size_t at = 0; at < good.size(); at += 101) {
    State damaged = good;
    damaged[at] ^= std::byte{4};
    refused(damaged);
  }
  GroundedWorld doubled({}, {.substeps = 2});
  refused(saved(doubled.world));
  World bare;
  refused(saved(bare));
  GroundedWorld alike;
  drop_boxes(alike, 3, 5);  // another number of modes
  alike.world.add_body(damped_box(2, 60.0), {.pose = {{}, {5.0, 0.0, 1.0}}});
  refused(saved(alike.world));

  world.remove_body(gone);
  EXPECT_THROW(world.restore_state(good), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
