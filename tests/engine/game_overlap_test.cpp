// Bodies that start in each other come apart by small steps (ContactSolver::kGame): at the push-out speed, along one
// direction, without a speed of their own, and never through each other.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "asked.h"
#include "constants.h"
#include "limber/collision/manifold_finder.h"
#include "limber/engine/world.h"
#include "pile.h"
#include "random_states.h"
#include "sample_models.h"
#include "shapes.h"

namespace limber::testing {
namespace {

constexpr double kWidth = 0.2;  // least width of all shapes

std::shared_ptr<const ModalModel> rigid() {
  return sample_model({.modes = 0, .half_extent = Vec3::Constant(0.5 * kWidth)});
}

ConvexHull random_hull(Random& random) {
  ConvexHull hull;
  for (int i = 0; i < 6; ++i) hull.points.push_back(0.5 * kWidth * (i % 2 == 0 ? 1.0 : -1.0) * Vec3::Unit(i / 2));
  for (int i = 0; i < 10; ++i) hull.points.push_back(0.6 * kWidth * random.vector(1.0).normalized());
  return hull;
}

Shape random_shape(Random& random) {
  switch (random.index(4)) {
    case 0:
      return Sphere{0.5 * kWidth};
    case 1:
      return Capsule{0.5 * kWidth, 0.4 * kWidth};
    case 2:
      return Box{kWidth * Vec3(0.5, 0.6, 0.9)};
    default:
      return random_hull(random);
  }
}

double least_gap(const std::array<std::shared_ptr<const Shape>, 2>& shapes,
                 const std::array<RigidTransform, 2>& poses) {
  ManifoldFinder finder;
  std::vector<BodyState> states;
  for (std::size_t i = 0; i < 2; ++i) {
    finder.add_body(static_cast<Index>(i), {.model = {}, .shape = shapes[i]}, {});
    states.push_back({.pose = poses[i]});
  }
  std::vector<ContactPoint> contacts;
  finder.find_contacts({.states = states, .margin = 10.0 * kWidth}, contacts, serial_jobs());
  double least = 10.0 * kWidth;
  for (const ContactPoint& c : contacts) least = std::min(least, c.gap);
  return least;
}

/// Two that float, from 4 to 50 % of their size in each other, anyhow off their middles.
TEST(GameOverlap, TwoBodiesPartAlongOneDirectionAndStand) {
  Random random(41);
  const ContactOptions options{.solver = ContactSolver::kGame};
  for (int trial = 0; trial < trials(40); ++trial) {
    const std::array shapes{std::make_shared<const Shape>(random_shape(random)),
                            std::make_shared<const Shape>(random_shape(random))};
    const double share = random.uniform(0.04, 0.5);
    ManifoldFinder finder;
    World world({.gravity = Vec3::Zero()});
    world.set_contact_source(&finder, options);
    const Vec3 beside = random.vector(1.0).normalized();
    std::array<BodyId, 2> bodies{
        world.add_body(rigid(), {.pose = random.pose(0.0), .shape = shapes[0]}),
        world.add_body(rigid(), {.pose = {random.pose(0.0).q, 3.0 * kWidth * beside}, .shape = shapes[1]})};
    const auto gap = [&] { return least_gap(shapes, {world.body(bodies[0]).pose, world.body(bodies[1]).pose}); };
    // Moved in until they are so deep.
    double from = 0.0, to = 3.0 * kWidth;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (from + to);
      world.set_pose(bodies[1], {world.body(bodies[1]).pose.q, middle * beside});
      (gap() < -share * kWidth ? from : to) = middle;
    }
    const auto apart = [&] { return Vec3(world.body(bodies[1]).pose.p - world.body(bodies[0]).pose.p); };
    const Vec3 start = apart();
    const double depth = -gap();
    double fastest = 0.0;
    Vec3 last = start;
    const int steps = 20 + static_cast<int>(std::ceil(60.0 * depth / options.small_steps.push_speed));
    for (int step = 0; step < steps; ++step) {
      world.step();
      fastest = std::max(fastest, (apart() - last).norm() * 60.0);
      last = apart();
    }
    EXPECT_GT(gap(), -5e-3 * kWidth) << trial << ": " << depth;
    EXPECT_LT((apart() - start).norm(), 1.3 * depth) << trial << ": along one direction, " << depth;
    EXPECT_LT(fastest, 1.05 * options.small_steps.push_speed) << trial;
    for (const BodyId body : bodies) EXPECT_LT(world.body(body).velocity.norm(), 1e-3) << trial << ": they stand";
  }
}

/// With their weight, in ground of each kind, from 4 to 50 % of their size deep.
TEST(GameOverlap, WhatStartsInTheGroundComesOutOnItsOwnSide) {
  Random random(43);
  const SurfaceMesh block = shapes::box({-1.0, -1.0, -1.0}, {1.0, 1.0, 0.0});
  HeightField field{.columns = 9, .rows = 9, .spacing_x = 0.25, .spacing_y = 0.25, .heights = {}};
  field.heights.assign(81, 0.0f);
  const std::array<std::pair<std::shared_ptr<const Shape>, Vec3>, 4> grounds{
      std::pair{std::make_shared<const Shape>(HalfSpace{}), Vec3(Vec3::Zero())},
      std::pair{std::make_shared<const Shape>(Box{{1.0, 1.0, 0.5}}), Vec3(0.0, 0.0, -0.5)},
      std::pair{std::make_shared<const Shape>(TriangleMesh{block.vertices, block.triangles}), Vec3(Vec3::Zero())},
      std::pair{std::make_shared<const Shape>(field), Vec3(-1.0, -1.0, 0.0)}};
  for (int trial = 0; trial < trials(80); ++trial) {
    const auto& [ground, at] = grounds[static_cast<std::size_t>(trial % 4)];
    const std::array shapes{ground, std::make_shared<const Shape>(random_shape(random))};
    const double share = random.uniform(0.04, 0.5);
    ManifoldFinder finder;
    World world;
    world.set_contact_source(&finder, {.solver = ContactSolver::kGame});
    const Quaternion turned = random.pose(0.0).q;
    const Vec3 place(random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5), 0.0);
    world.add_static(ground, {{}, at});
    const BodyId body = world.add_body(rigid(), {.pose = {turned, place + kWidth * Vec3::UnitZ()}, .shape = shapes[1]});
    const auto gap = [&] { return least_gap(shapes, {RigidTransform{{}, at}, world.body(body).pose}); };
    world.set_pose(body, {turned, place + (kWidth - gap() - share * kWidth) * Vec3::UnitZ()});
    double deepest = 0.0;
    for (int step = 0; step < 180; ++step) {
      world.step();
      if (step % 10 == 0) deepest = std::min(deepest, gap());
    }
    EXPECT_GT(deepest, -1.1 * share * kWidth) << trial << ": " << share;
    EXPECT_GT(gap(), -5e-3 * kWidth) << trial << ": " << share;
    EXPECT_LT(gap(), 5e-3 * kWidth) << trial << ": it lies on it, " << share;
    EXPECT_GT(world.body(body).pose.p.z(), 0.2 * kWidth) << trial << ": " << share;
  }
}

/// Boxes that bend land nearly flush on boxes, askew on them, and boxes come to the height of others' sides: no contact
/// leads through the whole of one.
TEST(GameOverlap, BoxesSinkInByLittleAsTheyLand) {
  for (const int fall : {2, 5, 48, 60}) {
    Pile pile(20, 6, false);
    for (std::size_t i = 0; i < pile.bodies.size(); ++i) {
      const RigidTransform pose = pile.world.body(pile.bodies[i]).pose;
      const double phase = 1.7 * static_cast<double>(i) + 2.3 * fall;
      const Vec3 aside(std::sin(phase), std::cos(1.3 * phase), std::sin(0.7 * phase));
      pile.world.set_pose(pile.bodies[i], {pose.q, pose.p + 1e-3 * aside});
    }
    for (int i = 0; i < 42; ++i) {
      pile.step_once();
      EXPECT_GT(pile.deepest, -0.2 * kPileSize) << fall << ' ' << i;
    }
  }
}

}  // namespace
}  // namespace limber::testing
