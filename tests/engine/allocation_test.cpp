#include <gtest/gtest.h>

#include <span>
#include <vector>

#include "counted_new.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber {
namespace {

TEST(World, StepDoesNotAllocateOnceWarm) {
  World world;
  std::vector<BodyId> bodies;
  for (const FrameMotion motion : testing::kAllMotions) {
    const auto model = testing::sample_model({.motion = motion});
    for (int i = 0; i < 100; ++i) bodies.push_back(world.add_body(model, {.angular_velocity = {1, 2, 3}}));
  }
  std::vector<float> positions(24 * bodies.size()), normals(24 * bodies.size()), amplitudes(4);
  std::vector<DrawTarget> targets;
  for (std::size_t i = 0; i < bodies.size(); ++i)
    targets.push_back({bodies[i], std::span(positions).subspan(24 * i, 24), std::span(normals).subspan(24 * i, 24)});
  const SurfacePoint& at = testing::kMarked;
  const auto frame = [&] {
    for (const BodyId id : bodies) {
      world.apply_force(id, at, {1, 2, 3});
      world.apply_impulse(id, at, {0.1, 0.2, 0.3}, Axes::kBody, 0.01);
    }
    world.set_kinematic_frame(bodies.back(), {.velocity = {1, 0, 0}});
    world.advance(1.0 / 60.0);
    world.reconstruct(targets, 0.5);
    for (const BodyId id : bodies) world.interpolated_amplitudes(id, 0.5, amplitudes);
    for (const BodyId id : bodies) world.interpolated_weights(id, 0.5, amplitudes);
    EXPECT_GT(world.energy(bodies[0]).kinetic_rigid, 0.0);
  };
  frame();
  const long before = testing::allocations();
  for (int i = 0; i < 100; ++i) frame();
  EXPECT_EQ(testing::allocations() - before, 0);
}

}  // namespace
}  // namespace limber
