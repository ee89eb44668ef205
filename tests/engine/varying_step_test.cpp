// World::set_step: loops whose frames vary.
#include <gtest/gtest.h>

#include <random>

#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber::testing {
namespace {

/// In free flight a motion does not depend on how it is cut into steps.
TEST(VaryingStep, FreeFlightComesToWhereOneLongStepDoes) {
  World varying, once({.step = 1.0});
  BodyId bodies[2];
  int i = 0;
  for (World* world : {&varying, &once}) {
    bodies[i] =
        world->add_body(damped_box(8, 3.0), {.velocity = {1.0, -2.0, 3.0}, .angular_velocity = {4.0, 1.0, -2.0}});
    world->apply_impulse(bodies[i++], kMarked, {0.1, 0.3, -0.2});
  }
  std::mt19937 random(5);
  std::uniform_real_distribution<double> length(1e-4, 0.1);
  while (varying.time() < 0.8) {
    varying.set_step(length(random));
    varying.step();
  }
  varying.set_step(1.0 - varying.time());
  varying.step();
  once.step();
  EXPECT_DOUBLE_EQ(varying.time(), once.time());
  const BodyView a = varying.body(bodies[0]), b = once.body(bodies[1]);
  EXPECT_LT((a.pose.p - b.pose.p).norm(), 1e-12);
  EXPECT_LT(rotation_vector(a.pose.q.conjugate() * b.pose.q).norm(), 1e-10);
  for (std::size_t m = 0; m < a.amplitudes.size(); ++m) {
    EXPECT_NEAR(a.amplitudes[m], b.amplitudes[m], 1e-12);
    EXPECT_NEAR(a.rates[m], b.rates[m], 1e-11);
  }
}

TEST(VaryingStep, WhatLiesStillStaysWhereItIs) {
  GroundedWorld at(exactly({.recovery_speed = 0.0}));
  const BodyId box = at.world.add_body(damped_box(6, 30.0), {.pose = {.p = {0.0, 0.0, 0.5}}});
  at.step(240);
  const Vec3 start = at.world.body(box).pose.p;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> length(1.0 / 600.0, 1.0 / 30.0);
  for (int i = 0; i < 300; ++i) {
    at.world.set_step(length(random));
    const double before = at.world.energy(box).total();
    at.world.step();
    EXPECT_LT(at.world.energy(box).total() - before, 1e-9);
    EXPECT_TRUE(at.world.constraint_report().solved) << i;
  }
  EXPECT_LT((at.world.body(box).pose.p - start).norm(), 1e-6);
}

/// Modes pass the Nyquist rate of one step or the other, while the box strikes the ground and lies there.
TEST(VaryingStep, AStateThatIsRestoredBringsItsStepWithIt) {
  GroundedWorld at;
  at.world.add_body(damped_box(6, 30.0), {.pose = {quaternion_from_rotation_vector({0.2, 0.3, 0.0}), {0, 0, 0.4}}});
  const auto future = [&] {
    std::mt19937 random(11);
    std::uniform_real_distribution<double> length(1.0 / 600.0, 1.0 / 30.0);
    std::vector<std::uint64_t> hashes;
    for (int i = 0; i < 60; ++i) {
      at.world.set_step(length(random));
      at.world.step();
      hashes.push_back(at.world.state_hash());
    }
    return hashes;
  };
  for (int begin = 0; begin < 3; ++begin) {
    std::vector<std::byte> state;
    at.world.save_state(state);
    const double step = at.world.options().step, time = at.world.time();
    const auto first = future();
    at.world.restore_state(state);
    EXPECT_EQ(at.world.options().step, step);
    EXPECT_EQ(at.world.time(), time);
    EXPECT_EQ(future(), first);
  }
}

TEST(VaryingStep, KeepsTimeAndDrawingGoingOn) {
  World world({.step = 0.1});
  EXPECT_EQ(world.advance(0.25), 2);
  EXPECT_NEAR(world.interpolation_factor(), 0.5, 1e-12);
  world.set_step(0.02);
  EXPECT_NEAR(world.interpolation_factor(), 0.5, 1e-12);
  EXPECT_EQ(world.advance(0.011), 1);
  EXPECT_NEAR(world.time(), 0.22, 1e-15);
  EXPECT_EQ(world.options().step, 0.02);
}

TEST(VaryingStep, RefusesWhatIsNoLengthAndToMoveImpulsesThatWait) {
  World world({.step = 0.1});
  const BodyId body = world.add_body(damped_box(2, 3.0));
  for (const double bad : {0.0, -1.0, kInfinity, std::numeric_limits<double>::quiet_NaN()})
    EXPECT_THROW(world.set_step(bad), InvalidArgument);
  world.apply_impulse(body, kMarked, Vec3::UnitX(), Axes::kWorld, 0.05);
  EXPECT_THROW(world.set_step(0.01), InvalidArgument);
  EXPECT_EQ(world.options().step, 0.1);
  world.step();
  EXPECT_NO_THROW(world.set_step(0.01));
}

}  // namespace
}  // namespace limber::testing
