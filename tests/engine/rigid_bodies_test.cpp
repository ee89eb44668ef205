// Bodies from shapes alone: they share models, and slide, roll and tumble as rigid bodies do.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::GroundedWorld;
using testing::share;

TEST(RigidBodies, BodiesOfOneShapeAndMassShareAModel) {
  World world;
  const auto box = share(Box{});
  const BodyId a = world.add_rigid(box, 500.0), b = world.add_rigid(box, 500.0), heavy = world.add_rigid(box, 600.0);
  EXPECT_EQ(&world.model(a), &world.model(b));
  EXPECT_NE(&world.model(a), &world.model(heavy));
  EXPECT_DOUBLE_EQ(world.model(heavy).data().mass, 600.0);
  world.remove_body(a);
  world.remove_body(b);
  EXPECT_DOUBLE_EQ(world.model(world.add_rigid(box, 500.0)).data().mass, 500.0);
}

TEST(RigidBodies, ArgumentsAreChecked) {
  World world;
  EXPECT_THROW(world.add_rigid(nullptr, 1.0), InvalidArgument);
  EXPECT_THROW(world.add_rigid(share(HalfSpace{}), 1.0), InvalidArgument);
  EXPECT_THROW(world.add_rigid(share(Box{}), 0.0), InvalidArgument);
  EXPECT_THROW(world.add_rigid(share(Box{}), 1.0, {.shape = share(Box{})}), InvalidArgument);
  EXPECT_EQ(world.body_count(), 0u);
}

/// Without friction's end a box would slide on: v²/(2 μ g) stops it.
TEST(RigidBodies, ABoxSlidesAsFarAsFrictionLetsIt) {
  constexpr double kFriction = 0.4, kSpeed = 3.0;
  GroundedWorld g({.friction = kFriction}, {.step = 1.0 / 240.0});
  const BodyId box =
      g.world.add_rigid(share(Box{{0.5, 0.5, 0.1}}), 500.0, {.pose = {.p = {0, 0, 0.1}}, .velocity = {kSpeed, 0, 0}});
  g.step(480);
  const double way = kSpeed * kSpeed / (2.0 * kFriction * 9.80665);
  EXPECT_NEAR(g.world.body(box).pose.p.x(), way, 0.01 * way);
  EXPECT_LE(g.world.body(box).velocity.norm(), 1e-3);
}

/// A ball that slides rolls in the end at 5/7 of its speed, whatever the friction.
TEST(RigidBodies, ABallThatSlidesComesToRoll) {
  GroundedWorld g({.friction = 0.3}, {.step = 1.0 / 240.0});
  const BodyId ball =
      g.world.add_rigid(share(Sphere{0.2}), 1000.0, {.pose = {.p = {0, 0, 0.2}}, .velocity = {2, 0, 0}});
  g.step(240);
  EXPECT_NEAR(g.world.body(ball).velocity.x(), 2.0 * 5.0 / 7.0, 0.01);
  EXPECT_NEAR(g.world.body(ball).angular_velocity.y(), 2.0 * 5.0 / 7.0 / 0.2, 0.05);
}

/// Boxes, prisms, hulls and meshes come to lie on the ground, at the height of their centre of mass, and stay.
TEST(RigidBodies, WhatHasCornersComesToRest) {
  const std::vector<Vec3> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const TriangleMesh mesh{corners, {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
  const std::vector<std::pair<Shape, double>> heights{
      {Box{}, 0.5}, {cylinder_hull(0.5, 0.5), 0.5}, {ConvexHull{corners}, 0.25}, {mesh, 0.25}};
  for (const auto& [solid, height] : heights) {
    GroundedWorld g;
    const BodyId body = g.world.add_rigid(share(solid), 500.0, {.pose = {.p = {0, 0, height + 0.3}}});
    g.step(120);
    EXPECT_NEAR(g.world.body(body).pose.p.z(), height, 2e-3) << "shape " << solid.index();
    EXPECT_LE(g.world.body(body).velocity.norm(), 1e-3) << "shape " << solid.index();
  }
}

/// Free of forces a body keeps energy and momentum, about the axis of neither its least nor its largest moment too.
TEST(RigidBodies, ABoxTumblesWithItsMomentum) {
  World world({.step = 1.0 / 60.0, .gravity = Vec3::Zero()});
  const BodyId box = world.add_rigid(share(Box{{0.5, 0.2, 0.1}}), 500.0, {.angular_velocity = {0.01, 3.0, 0.02}});
  const Vec3 momentum = world.angular_momentum(box);
  const double energy = world.energy(box).total();
  for (int i = 0; i < 600; ++i) world.step();
  EXPECT_LE((world.angular_momentum(box) - momentum).norm(), 1e-12 * momentum.norm());
  EXPECT_NEAR(world.energy(box).total(), energy, 1e-12 * energy);
}

}  // namespace
}  // namespace limber
