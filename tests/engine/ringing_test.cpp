// A body rings on and on, and pauses: steps of a closed form do not add up errors beyond their round-off.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "asked.h"
#include "constants.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber {
namespace {

using testing::kEpsilon;
using testing::sample_model;

/// A million steps; `LIMBER_TRIALS` says otherwise. Each rounds amplitude and rate once: at worst N ε, and the turn of
/// the phase, which one rounding of its cosine and sine shifts by ε a step, the same each time.
TEST(WorldRinging, IsWhereItShouldBeAfterAnyNumberOfSteps) {
  const double steps = testing::asked("LIMBER_TRIALS", testing::all_or_tenth(1000000)), step = 1.0 / 60.0;
  const auto model = sample_model({.modes = 1, .lowest_hz = 7.3});
  World world({.step = step, .gravity = Vec3::Zero()});
  const BodyId bell = world.add_body(model);
  world.set_amplitudes(bell, std::vector{0.01}, std::vector{0.0});
  const double before = world.energy(bell).total(), omega = std::sqrt(model->data().eigenvalues[0]);
  for (double n = 0.0; n < steps; ++n) world.step();
  const double after = world.energy(bell).total();
  EXPECT_NEAR(after, before, 4.0 * kEpsilon * steps * before);
  const double turns = omega * step * steps;
  const double off = std::hypot(world.body(bell).amplitudes[0] - 0.01 * std::cos(turns),
                                world.body(bell).rates[0] / omega + 0.01 * std::sin(turns));
  EXPECT_LE(off, 0.01 * 4.0 * kEpsilon * (steps + turns));
  RecordProperty("energy_change", std::to_string(after / before - 1.0));
  std::printf("%g steps: energy %+.2e of itself, off by %.2e of the amplitude\n", steps, after / before - 1.0,
              off / 0.01);
}

/// An hour in one step: what flies lands on its parabola, what rings has its energy.
TEST(WorldRinging, AnHourInOneStepIsOneStep) {
  const auto model = sample_model({.modes = 4});
  World world({.step = 1.0 / 60.0});
  const BodyId body = world.add_body(model, {.velocity = {1.0, 2.0, 3.0}, .angular_velocity = {0.3, 2.0, 0.1}});
  world.set_amplitudes(body, std::vector(4, 0.01), std::vector(4, 0.0));
  for (int i = 0; i < 10; ++i) world.step();
  const BodyEnergy before = world.energy(body);
  const Vec3 place = world.body(body).pose.p, velocity = world.body(body).velocity, turn = world.angular_momentum(body);
  constexpr double kHour = 3600.0;
  world.set_step(kHour);
  world.step();
  const Vec3 expected = place + kHour * velocity + 0.5 * kHour * kHour * world.options().gravity;
  EXPECT_LE((world.body(body).pose.p - expected).norm(), 1e-13 * expected.norm());
  const BodyEnergy after = world.energy(body);
  const auto shape = [](const BodyEnergy& e) { return e.kinetic_modal + e.elastic; };
  EXPECT_NEAR(shape(after), shape(before), 1e-12 * shape(before));
  EXPECT_LE((world.angular_momentum(body) - turn).norm(), 1e-9 * turn.norm());
}

}  // namespace
}  // namespace limber
