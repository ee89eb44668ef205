// How far contacts are looked for: as far as bodies come.
#include <gtest/gtest.h>

#include <memory>

#include "limber/collision/contact_finder.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber::testing {
namespace {

std::shared_ptr<const ModalModel> rigid(double mass) {
  ModalModelData d = sample_model_data({.modes = 0});
  d.mass = mass;
  d.inertia = Mat3::Identity() * (0.4 * mass * 0.05 * 0.05);
  return std::make_shared<const ModalModel>(std::move(d));
}

/// A ball that lies still is struck by a heavier one: nothing of its own motion tells that it will reach the wall.
TEST(ContactReach, WhatABlowThrowsIsStoppedInTheSameStep) {
  constexpr double kRadius = 0.05, kRoom = 0.02;
  const auto ball = std::make_shared<const Shape>(Sphere{kRadius});
  ContactFinder finder;
  World world({.step = 1.0 / 60.0, .gravity = Vec3::Zero()});
  world.set_contact_source(&finder, {.solver = ContactSolver::kExact, .friction = 0.0});
  world.add_static(std::make_shared<const Shape>(Box{{0.05, 0.5, 0.5}}), {.p = {kRadius + kRoom + 0.05, 0.0, 0.0}});
  const BodyId struck = world.add_body(rigid(0.1), {.shape = ball});
  world.add_body(rigid(1.0),
                 {.pose = {.p = {-2.0 * kRadius - 1e-3, 0.0, 0.0}}, .velocity = {3.0, 0.0, 0.0}, .shape = ball});
  world.step();
  EXPECT_GT(world.constraint_report().attempts[StepAttempt::kLookedFarther], 0);
  EXPECT_GT(world.body(struck).pose.p.x(), 0.5 * kRoom);   // the blow did throw it
  EXPECT_LT(world.body(struck).pose.p.x(), kRoom + 1e-9);  // and the wall held it
}

}  // namespace
}  // namespace limber::testing
