// Modes under contact by small steps: what holds them gives them no energy, whatever their frequency (small_steps.h).
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "contact_scene.h"
#include "limber/constraints/small_steps.h"

namespace limber::testing {
namespace {

constexpr double kStep = 1.0 / 60.0;
constexpr int kSubsteps = 8;

/// A free body of one mode at so many radians a substep, without gravity.
struct OneMode : GroundedIsland {
  OneMode(double radians, double decay)
      : GroundedIsland(
            {.modes = 1, .lowest_hz = radians * kSubsteps / (kStep * 2.0 * std::numbers::pi), .decay = decay}, kStep,
            {.solver = ContactSolver::kGame, .small_steps = {.substeps = kSubsteps}}, Vec3::UnitZ(), Vec3::Zero()) {}
  SmallStepReport small_step() {
    return small_steps.step(
        {.table = table, .members = members, .contacts = nullptr, .constraints = constraints, .step = kStep});
  }
  SmallStepSolver small_steps;
};

/// Held by one point along one direction it is a free mass and an oscillator on a wall: a linear map per substep, whose
/// spectral radius must not exceed 1. In single precision a growth of 1e-5 a step would show as a factor of 22 here.
TEST(GameModes, AModeHeldByAWallNeverGainsEnergyAtAnyFrequency) {
  for (const double decay : {0.0, 5.0})
    for (const double radians : {0.1, 0.3, 0.6, 1.0, 1.3, 1.6, 2.0, 2.5, 3.0, std::numbers::pi, 4.0, 5.0,
                                 2.0 * std::numbers::pi, 7.0, 9.0, 4.0 * std::numbers::pi, 20.0}) {
      OneMode scene(radians, decay);
      scene.add_body({{}, {0.0, 0.0, 1.0}});
      scene.hold(0, corner_point(*scene.model, 0), {.directions = {Vec3::UnitZ()}});
      const double amplitude = 1e-3 / radians;
      scene.group.set_amplitudes(0, std::vector{amplitude}, std::vector{0.1});
      const double energy = scene.energy();
      double highest = 0.0;
      for (int i = 0; i < 400; ++i) {
        scene.small_step();
        highest = std::max(highest, scene.energy());
      }
      EXPECT_LE(highest, energy * 1.01) << radians << " rad a substep, decay " << decay;
    }
}

TEST(GameModes, AFreeBodyGoesAsItsModesDo) {
  OneMode scene(1.0, 0.0), other(1.0, 0.0);
  for (OneMode* one : {&scene, &other}) {
    one->add_body({{}, {0.0, 0.0, 1.0}}, {1.0, 0.0, 0.0});
    one->group.set_amplitudes(0, std::vector{1e-3}, std::vector{0.1});
  }
  for (int i = 0; i < 60; ++i) {
    scene.small_step();
    other.group.advance(0, 1, Vec3::Zero());
  }
  EXPECT_NEAR(scene.group.amplitudes(0)[0], other.group.amplitudes(0)[0], 1e-9);
  EXPECT_NEAR(scene.group.rates(0)[0], other.group.rates(0)[0], 1e-9);
  EXPECT_LT((scene.group.frame(0).pose().p - other.group.frame(0).pose().p).norm(), 1e-12);
}

TEST(GameModes, OptionsAreChecked) {
  EXPECT_THROW(SmallSteps{.substeps = 0}.validate(), InvalidArgument);
  EXPECT_THROW(SmallSteps{.slop = -1.0}.validate(), InvalidArgument);
  EXPECT_THROW(SmallSteps{.push_speed = kUnbounded}.validate(), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
