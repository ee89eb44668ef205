#include "limber/engine/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "limber/core/error.h"
#include "limber/dynamics/oscillator.h"
#include "limber/jobs_tbb/tbb_jobs.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::sample_model;
using testing::SampleOptions;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kRoundOff = 64 * kEpsilon;
const Vec3 kNoGravity = Vec3::Zero();

TEST(World, FreeBodyFallsOnItsParabola) {
  World world({.step = 0.01});
  const BodyId body = world.add_body(sample_model(), {.pose = {.p = {1, 2, 3}}, .velocity = {1, -2, 4}});
  while (world.step_count() < 1000) world.step();
  const double t = 10.0;
  const Vec3 expected = Vec3(1, 2, 3) + t * Vec3(1, -2, 4) + 0.5 * t * t * world.options().gravity;
  EXPECT_LT((world.body(body).pose.p - expected).norm(), 1000 * kEpsilon * expected.norm());
}

TEST(World, MomentumOfAStruckBodyEqualsTheImpulse) {
  World world({.gravity = kNoGravity});
  const BodyId body = world.add_body(sample_model(), {.pose = {.q = quaternion_from_rotation_vector({1, 2, 3})}});
  const SurfacePoint at{.triangle = 3, .weight = {0.2, 0.5, 0.3}};
  const Vec3 impulse{0.3, -1.0, 2.0};
  const Vec3 moment = world.position(body, at).cross(impulse);
  world.apply_impulse(body, at, impulse);
  for (int i = 0; i < 600; ++i) world.step();
  EXPECT_LT((world.linear_momentum(body) - impulse).norm(), 1e-12 * impulse.norm());
  EXPECT_LT((world.angular_momentum(body) - moment).norm(), 1e-12 * moment.norm());
}

TEST(World, StruckBodyRingsAtItsFrequencies) {
  World world({.gravity = kNoGravity});
  const auto model = sample_model({.decay = 0.3});
  const BodyId body = world.add_body(model);
  world.apply_impulse(body, {.triangle = 0}, {0, 0, 1});
  const std::vector<double> start(world.body(body).rates.begin(), world.body(body).rates.end());
  for (int i = 0; i < 240; ++i) world.step();
  for (std::size_t i = 0; i < start.size(); ++i) {
    const double xi = model->data().decays[i], omega = std::sqrt(model->data().eigenvalues[i] - xi * xi);
    EXPECT_GT(std::abs(start[i]), 1e-3);
    EXPECT_NEAR(world.body(body).amplitudes[i], start[i] * std::exp(-xi * 4.0) * std::sin(omega * 4.0) / omega,
                4000 * kEpsilon * std::abs(start[i]) / omega * omega);
  }
}

}  // namespace
}  // namespace limber
