// Contacts give no energy and keep momenta, in lumps, falls, and slides.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "asked.h"
#include "grounded_world.h"

namespace limber::testing {
namespace {

constexpr int kStepsOfLump = kSanitized ? 20 : 60;

/// Bricks that fly towards each other and end in one lump: an island of more than fifty contacts.
void expect_momenta_kept_in_a_lump(int modes) {
  ContactFinder finder;
  World world({.gravity = Vec3::Zero()});
  world.set_contact_source(&finder, exactly({.recovery_speed = 0.0}));
  const Vec3 half(0.15, 0.12, 0.09);
  const auto model = sample_model({.modes = modes, .lowest_hz = 60.0, .decay = 12.0, .half_extent = half});
  const auto brick = modes > 0 ? nullptr : std::make_shared<const Shape>(Box{.half_extents = half});
  std::vector<BodyId> bodies;
  for (int i = 0; i < 27; ++i) {
    const Vec3 at(0.5 * (i % 3 - 1), 0.45 * (i / 3 % 3 - 1), 0.4 * (i / 9 - 1));
    bodies.push_back(world.add_body(model, {.pose = {quaternion_from_rotation_vector({0.1 * i, 0.0, 0.0}), at},
                                            .velocity = -3.0 * at + Vec3(0.0, 0.2, 0.1 * std::sin(i)),
                                            .angular_velocity = {0.0, 0.0, std::cos(i)},
                                            .shape = brick}));
  }
  const auto momentum = [&] {
    Vec3 sum = Vec3::Zero();
    for (const BodyId body : bodies) sum += world.linear_momentum(body);
    return sum;
  };
  const auto angular_momentum = [&] {
    Vec3 sum = Vec3::Zero();
    for (const BodyId body : bodies)
      sum += world.angular_momentum(body) + world.body(body).pose.p.cross(world.linear_momentum(body));
    return sum;
  };
  std::size_t most = 0;
  const Vec3 linear = momentum(), angular = angular_momentum();
  double energy = total_energy(world, bodies);
  const double scale = energy;
  for (int i = 0; i < kStepsOfLump; ++i) {
    world.step();
    most = std::max(most, world.contact_events().size());
    const double now = total_energy(world, bodies);
    EXPECT_LE(now, energy + 1e-6 * scale) << i;
    energy = now;
  }
  EXPECT_GT(most, 50u);
  EXPECT_LT((momentum() - linear).norm(), 1e-10 * linear.norm());
  EXPECT_LT((angular_momentum() - angular).norm(), 1e-10 * angular.norm());
}

TEST(WorldContact, BodiesThatMeetInALumpKeepTheirMomenta) { expect_momenta_kept_in_a_lump(0); }

TEST(WorldContact, BodiesThatBendAndMeetInALumpKeepTheirMomenta) { expect_momenta_kept_in_a_lump(6); }

TEST(WorldContact, EnergyOfBoxesThatFallOnEachOtherNeverRises) {
  constexpr double kRise = 1e-6;
  // What overlaps stays so: pushing it apart is work that the island is given.
  GroundedWorld scene(exactly({.recovery_speed = 0.0}));
  World& world = scene.world;
  const auto model = sample_model({.modes = 8, .lowest_hz = 20.0});
  std::vector<BodyId> boxes;
  for (int i = 0; i < 3; ++i)
    boxes.push_back(world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.3, 0.2 * i, 0.1}), {0.05 * i, 0.0, 0.5 + 0.5 * i}}}));
  EXPECT_LT(largest_rise(world, boxes, 180), kRise * 3.0 * model->data().mass * kGravity * kSampleSize);
}

/// Indentations stay with the material, whatever contacts come and go; what they store is counted.
TEST(WorldContact, EnergyNeverRisesWhereBodiesWithResidualComplianceSlideAndRoll) {
  constexpr double kRise = 1e-6;
  const auto model = sample_model({.modes = 6, .dropped = 14, .lowest_hz = 20.0});
  GroundedWorld scene(exactly({.recovery_speed = 0.0, .residual_compliance = true}));
  World& world = scene.world;
  std::vector<BodyId> boxes;
  for (int i = 0; i < 3; ++i)
    boxes.push_back(world.add_body(
        model, {.pose = {quaternion_from_rotation_vector({0.3, 0.2 * i, 0.1}), {0.05 * i, 0.0, 0.5 + 0.5 * i}},
                .velocity = {1.0, 0.0, 0.0}}));
  EXPECT_LT(largest_rise(world, boxes, 180), kRise * 3.0 * model->data().mass * kGravity * kSampleSize);
}

}  // namespace
}  // namespace limber::testing
