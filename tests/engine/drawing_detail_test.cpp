// Bodies far away are drawn by few modes: none of their vertices is off by more than the tolerance asked for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "limber/core/error.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber {
namespace {

constexpr double kFloat = 1e-6;  // of single precision at 1 m

/// A box of 20 modes that ring, each shown by a little less than the one before.
struct RingingBox {
  World world;
  BodyId id = world.add_body(testing::sample_model({.modes = 20}));
  std::size_t floats = 3 * static_cast<std::size_t>(world.model(id).render().vertices());

  explicit RingingBox(bool half_precision = false)
      : world({.gravity = Vec3::Zero(), .half_precision = half_precision}) {
    std::vector<double> z(20), rates(20, 0.0);
    for (std::size_t i = 0; i < z.size(); ++i)
      z[i] = 0.1 * std::pow(0.6, static_cast<double>(i)) / world.model(id).render_extent().shape[i];
    world.set_amplitudes(id, z, rates);
  }
  std::vector<float> drawn(double tolerance, double s = 1.0) const {
    std::vector<float> p(floats);
    const DrawTarget target{.id = id, .positions = p, .tolerance = tolerance};
    world.reconstruct({&target, 1}, s);
    return p;
  }
};

/// Of any vertex.
double distance(const std::vector<float>& p, const std::vector<float>& q) {
  double largest = 0.0;
  for (std::size_t i = 0; i < p.size(); i += 3)
    largest = std::max(largest, std::hypot(static_cast<double>(p[i] - q[i]), static_cast<double>(p[i + 1] - q[i + 1]),
                                           static_cast<double>(p[i + 2] - q[i + 2])));
  return largest;
}

TEST(DrawnModes, AreTheFewestWhoseRestIsWithinTheTolerance) {
  const SurfaceExtent extent{.radius = 1.0, .shape = {1.0, 2.0, 1.0, 1.0}};
  const std::vector<double> z{-1.0, 0.1, 0.0, -0.05};
  EXPECT_EQ(drawn_modes(extent, z, 0.0), 4);
  EXPECT_EQ(drawn_modes(extent, z, 0.05), 2);
  EXPECT_EQ(drawn_modes(extent, z, 0.24), 2);
  EXPECT_EQ(drawn_modes(extent, z, 0.26), 1);
  EXPECT_EQ(drawn_modes(extent, z, 2.0), 0);
}

TEST(WorldDetail, NoVertexIsOffByMoreThanTheTolerance) {
  RingingBox box;
  double seen = 0.0;
  for (int n = 0; n < 50; ++n) {
    box.world.step();
    for (const double tolerance : {1e-5, 1e-3, 1e-2}) {
      const double off = distance(box.drawn(tolerance), box.drawn(0.0));
      EXPECT_LE(off, tolerance + kFloat);
      seen = std::max(seen, off / tolerance);
      EXPECT_LE(distance(box.drawn(tolerance, 0.4), box.drawn(0.0, 0.4)), tolerance + kFloat);
    }
  }
  EXPECT_GT(seen, 0.1);  // something was left out
}

TEST(WorldDetail, HalfPrecisionIsPartOfTheTolerance) {
  RingingBox box, lean(true);
  for (int n = 0; n < 50; ++n) {
    box.world.step(), lean.world.step();
    for (const double tolerance : {3e-5, 1e-3, 1e-2})
      for (const double s : {0.4, 1.0})
        EXPECT_LE(distance(lean.drawn(tolerance, s), box.drawn(0.0, s)), tolerance + kFloat);
    EXPECT_GT(distance(lean.drawn(1e-3), box.drawn(1e-3)), kFloat);  // read from the shapes in half precision
    // Where their error is too large, shapes are those in single precision.
    for (const double tolerance : {0.0, 1e-8}) EXPECT_EQ(lean.drawn(tolerance), box.drawn(tolerance));
  }
}

TEST(WorldDetail, ABodyThatGoesAwayJumpsByNoMoreThanTheTolerance) {
  RingingBox box;
  box.world.step();
  double jumps = 0.0;
  for (double tolerance = 1e-6; tolerance < 0.1; tolerance *= 1.1) {
    const double jump = distance(box.drawn(tolerance), box.drawn(1.1 * tolerance));
    EXPECT_LE(jump, 1.1 * tolerance + kFloat);
    jumps += jump > 0.0 ? 1.0 : 0.0;
  }
  EXPECT_GT(jumps, 5.0);
}

TEST(WorldDetail, IsTheSameForEachHoweverManyAreDrawn) {
  World world({.gravity = Vec3::Zero()});
  const auto model = testing::sample_model({.modes = 20});
  const std::size_t floats = 3 * static_cast<std::size_t>(model->render().vertices());
  std::vector<float> together(11 * floats), alone(floats);
  std::vector<DrawTarget> targets;
  for (std::size_t i = 0; i < 11; ++i) {
    const BodyId id = world.add_body(model);
    const std::vector<double> z(20, 1e-3 * static_cast<double>(i + 1)), rates(20, 0.0);
    world.set_amplitudes(id, z, rates);
    targets.push_back({.id = id,
                       .positions = std::span(together).subspan(i * floats, floats),
                       .tolerance = i % 3 == 0 ? 0.0 : 1e-3 * static_cast<double>(i % 4)});
  }
  world.reconstruct(targets);
  for (const DrawTarget& target : targets) {
    const DrawTarget own{.id = target.id, .positions = alone, .tolerance = target.tolerance};
    world.reconstruct({&own, 1});
    EXPECT_TRUE(std::equal(alone.begin(), alone.end(), target.positions.begin()));
  }
  targets[0].tolerance = -1.0;
  EXPECT_THROW(world.reconstruct(targets), InvalidArgument);
}

TEST(WorldDetail, ABodyAtRestIsDrawnWithoutAnyMode) {
  World world({.gravity = Vec3::Zero()});
  const auto model = testing::sample_model({.modes = 8});
  EXPECT_EQ(drawn_modes(model->render_extent(), world.body(world.add_body(model)).amplitudes, 1e-9), 0);
}

TEST(WorldDetail, WhatTouchesNothingMovesAndIsHeldAllTheSame) {
  // No rows of single vertices: points of its surface are found by its shapes.
  ModalModelData data = testing::sample_model_data({.modes = 4});
  data.touchable = false;
  const auto lean = std::make_shared<const ModalModel>(std::move(data));
  World a, b;
  const BodyId in_a = a.add_body(lean), in_b = b.add_body(testing::sample_model({.modes = 4}));
  const SurfacePoint at{.surface = SurfacePoint::Surface::kCollision, .triangle = 3, .weight = {0.2, 0.5, 0.3}};
  for (int n = 0; n < 30; ++n) {
    a.apply_force(in_a, at, {1, 2, 3});
    b.apply_force(in_b, at, {1, 2, 3});
    a.step(), b.step();
    EXPECT_LE((a.position(in_a, at) - b.position(in_b, at)).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace limber
