#include "limber/sound/contact_time.h"

#include <gtest/gtest.h>

#include <cmath>

#include "limber/core/error.h"

namespace limber {
namespace {

// A steel ball of 10 mm across on its like.
StrikeSide steel_ball(double radius) {
  return {.mass = 7850.0 * 4.0 / 3.0 * 3.14159265 * std::pow(radius, 3), .radius = radius, .modulus = 207e9 / 0.91};
}

// Hertz: the compression δ obeys m δ̈ = −(4/3) E* √R δ^{3/2}.
double integrated_contact_time(double m, double R, double E, double speed) {
  const double k = 4.0 / 3.0 * E * std::sqrt(R), dt = 1e-9;
  double x = 0.0, v = speed, t = 0.0;
  while (x >= 0.0) {
    v -= dt * k / m * std::pow(std::max(x, 0.0), 1.5);
    x += dt * v;
    t += dt;
  }
  return t;
}

TEST(ContactTime, IsThatOfHertzsCollision) {
  const StrikeSide ball = steel_ball(0.005);
  const double tau = contact_time(ball, ball, 1.0);
  constexpr double kDigits = 2e-3;  // of the factor 2.87
  EXPECT_NEAR(tau / integrated_contact_time(ball.mass / 2, ball.radius / 2, ball.modulus / 2, 1.0), 1.0, kDigits);
}

TEST(ContactTime, GrowsWithTheSizeAndFallsWithTheFifthRootOfTheSpeed) {
  const StrikeSide ground{.modulus = 60e9};
  const double tau = contact_time(steel_ball(0.01), ground, 1.0);
  EXPECT_NEAR(contact_time(steel_ball(0.03), ground, 1.0) / tau, 3.0, 1e-12);
  EXPECT_NEAR(contact_time(steel_ball(0.01), ground, 32.0) / tau, 0.5, 1e-12);
}

TEST(ContactTime, RefusesTwoBodiesThatAreBothRigidFlatOrFixed) {
  EXPECT_THROW(contact_time({}, {}, 1.0), InvalidArgument);
  EXPECT_THROW(contact_time(steel_ball(0.01), {}, 0.0), InvalidArgument);
  EXPECT_THROW(contact_time({.mass = 1.0, .radius = 0.1}, {}, 1.0), InvalidArgument);
}

}  // namespace
}  // namespace limber
