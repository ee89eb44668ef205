#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <numbers>

#include "asked.h"
#include "counted_new.h"
#include "grounded_world.h"
#include "limber/core/error.h"
#include "pile.h"

namespace limber::testing {
namespace {

constexpr double kRadius = 0.2;                 // m
constexpr double kResistance = 0.05;            // C
constexpr double kGap = 1e-9;                   // m and rad: what gaps and turns are met to at a metre from the origin
constexpr double kRolling = 1.0 / (1.0 + 0.4);  // of what a block that slides without friction does

/// A solid ball, ⅖ m R² about every axis, on a slope; x points down it, and it sets out at an angle `heading` to that.
struct RollingBall : GroundedWorld {
  explicit RollingBall(double slope, double speed = 0.0, double spin = 0.0, double resistance = kResistance,
                       double heading = 0.0)
      : GroundedWorld(exactly({.friction = 0.8, .rolling_friction = resistance}),
                      {.gravity = kGravity * Vec3(std::sin(slope), 0.0, -std::cos(slope))}) {
    ModalModelData data = sample_model_data({.modes = 0});
    data.inertia = 0.4 * data.mass * kRadius * kRadius * Mat3::Identity();
    ball = world.add_body(
        std::make_shared<const ModalModel>(std::move(data)),
        {.pose = {{}, {0.0, 0.0, kRadius}},
         .velocity = speed * Vec3(std::cos(heading), std::sin(heading), 0.0),
         .angular_velocity = speed / kRadius * Vec3(-std::sin(heading), std::cos(heading), 0.0) + spin * Vec3::UnitZ(),
         .shape = std::make_shared<const Shape>(Sphere{kRadius})});
  }
  double speed() const { return world.body(ball).velocity.x(); }
  double mass() const { return world.model(ball).data().mass; }
  BodyId ball;
};

TEST(Rolling, OnAPlaneSlowsByTheCoefficientOfItsWeightWhereverItGoes) {
  for (const double heading : {0.0, 0.3, 0.25 * std::numbers::pi, 2.0}) {
    RollingBall scene(0.0, 2.0, 0.0, kResistance, heading);
    scene.step(6);  // resistance begins where forces are known: a step late
    const Vec3 before = scene.world.body(scene.ball).velocity;
    scene.step(60);
    const Vec3 after = scene.world.body(scene.ball).velocity, ahead = before.normalized();
    const double slowing = kResistance * kGravity * kRolling;
    EXPECT_NEAR(before.norm() - after.norm(), slowing, 1e-6 * slowing) << heading;
    EXPECT_LT(ahead.cross(after).norm(), 1e-6) << "it goes straight on";
    EXPECT_LT((scene.world.body(scene.ball).angular_velocity - Vec3::UnitZ().cross(after) / kRadius).norm(), 1e-6);
  }
}

TEST(Rolling, TheMomentIsNoLargerWhereABallSpinsAsItRolls) {
  const double speed = 2.0;
  RollingBall scene(0.0, speed, speed / kRadius, kResistance, 0.4);
  scene.step(6);
  const BodyView before = scene.world.body(scene.ball);
  scene.step(1);
  const BodyView after = scene.world.body(scene.ball);
  // Against rolling m R² ⅖ + m R² have to be turned back, against spinning m R² ⅖ alone.
  const double inertia = 0.4 * scene.mass() * kRadius * kRadius;
  const double roll = inertia / 0.4 * 1.4 * (before.velocity - after.velocity).norm() / kRadius / kFrame;
  const double spin = inertia * (before.angular_velocity.z() - after.angular_velocity.z()) / kFrame;
  const double largest = kResistance * scene.mass() * kGravity * kRadius;
  EXPECT_NEAR(std::hypot(roll, spin), largest, 1e-5 * largest) << "the velocities are those of a moment that turns";
  EXPECT_NEAR(spin / roll, after.angular_velocity.z() * kRadius / after.velocity.norm(), 1e-2) << "straight against";
}

TEST(Rolling, ComesToRestAndStaysWhereItIs) {
  RollingBall scene(0.0, 1.0);
  scene.step(240);  // it has rolled for 2.86 s
  const Vec3 there = scene.world.body(scene.ball).pose.p;
  scene.step(60);
  EXPECT_LT((scene.world.body(scene.ball).pose.p - there).norm(), 10.0 * kGap);
  EXPECT_NEAR(there.x(), 0.5 / (kResistance * kGravity * kRolling), 0.02) << "v²/2a and a frame's way";
}

TEST(Rolling, StaysOnSlopesBelowItsAngleAndGoesDownSteeperOnes) {
  const double angle = 0.9 * std::atan(kResistance);
  RollingBall flat(angle);
  flat.step(120);
  // Its moment is bound by the last step's force: it rolls for the first step, and is braked over the next ones.
  const double pull = kGravity * kRolling * std::sin(angle), first = pull * kFrame;
  const double brake = kGravity * kRolling * kResistance * std::cos(angle) - pull;
  EXPECT_LT(std::abs(flat.world.body(flat.ball).pose.p.x()), first * kFrame + first * first / (2.0 * brake));
  const double x = flat.world.body(flat.ball).pose.p.x();
  flat.step(60);
  EXPECT_NEAR(flat.world.body(flat.ball).pose.p.x(), x, 10.0 * kGap);

  const double slope = 0.3;
  RollingBall steep(slope);
  steep.step(6);
  const double before = steep.speed();
  steep.step(60);
  const double expected = kGravity * (std::sin(slope) - kResistance * std::cos(slope)) * kRolling;
  EXPECT_NEAR(steep.speed() - before, expected, 1e-6 * expected);
}

/// At 200 m/s a ball of 0.2 m turns by 16.7 rad a step.
TEST(Rolling, ABallThatTurnsOftenInAStepRollsAndIsBrakedAsOneThatTurnsLittle) {
  for (const double slope : {0.0, 0.3}) {
    RollingBall scene(slope, 200.0);
    scene.step(6);
    const double before = scene.speed();
    scene.step(60);
    const double expected = kGravity * (std::sin(slope) - kResistance * std::cos(slope)) * kRolling;
    EXPECT_NEAR(scene.speed() - before, expected, 1e-6 * std::abs(expected)) << slope;
    EXPECT_NEAR(scene.world.body(scene.ball).angular_velocity.y() * kRadius, scene.speed(), 1e-6) << slope;
    EXPECT_LT(scene.world.constraint_report().residual, 1.0) << slope;
  }
}

TEST(Rolling, WithoutResistanceGoesOn) {
  RollingBall scene(0.0, 1.0, 0.0, 0.0);
  scene.step(300);
  EXPECT_NEAR(scene.speed(), 1.0, 1e-8);
}

TEST(Rolling, SpinningEndsToo) {
  RollingBall scene(0.0, 0.0, 5.0);
  scene.step(6);
  const double before = scene.world.body(scene.ball).angular_velocity.z();
  scene.step(6);
  const double slowing = kResistance * kGravity * kRadius / (0.4 * kRadius * kRadius);
  EXPECT_NEAR(before - scene.world.body(scene.ball).angular_velocity.z(), 6.0 * kFrame * slowing, 1e-6);
  scene.step(120);
  EXPECT_LT(std::abs(scene.world.body(scene.ball).angular_velocity.z()), 2.0 * kGap / kFrame);
}

TEST(Rolling, TakesEnergyAwayAndAllocatesNothing) {
  RollingBall scene(0.0, 1.0);
  scene.step(30);
  const std::vector<BodyId> ball{scene.ball};
  const double weight = scene.mass() * kGravity;
  const long before = allocations();
  const double rise = largest_rise(scene.world, ball, 200);
  EXPECT_EQ(allocations() - before, 0);
  EXPECT_LT(rise, 10.0 * kGap * weight);
}

TEST(Rolling, APileOfMixedBodiesComesToRest) {
  constexpr int kSteps = kSanitized ? 120 : 180;
  constexpr double kPenetration = 1e-3 * kPileSize, kShift = 1e-4;  // m
  Pile pile(kPileBoxes, -1, true, exactly({.rolling_friction = 0.1}));
  for (int i = 0; i < kSteps; ++i) pile.step_once();
  std::vector<Vec3> before;
  for (const BodyId id : pile.bodies) before.push_back(pile.world.body(id).pose.p);
  for (int i = 0; i < 30; ++i) pile.step_once();
  EXPECT_GT(pile.deepest, -kPenetration);
  for (std::size_t i = 0; i < before.size(); ++i)
    EXPECT_LT((pile.world.body(pile.bodies[i]).pose.p - before[i]).norm(), kShift) << i;
}

TEST(Rolling, AFallingPileOfMixedBodiesTakesABoundedNumberOfNewtonSteps) {
  constexpr int kAllowed = 500;
  Pile pile(24, -1, true, exactly({.rolling_friction = 0.1}));
  int most = 0;
  for (int i = 0; i < 90; ++i) {
    pile.step_once();
    most = std::max(most, pile.world.constraint_report().newton_steps);
  }
  EXPECT_LE(most, kAllowed);
  EXPECT_GE(most, 50) << "the pile is a hard one";
}

TEST(Rolling, CoefficientsAreChecked) {
  EXPECT_THROW(ContactOptions({.rolling_friction = -0.1}).validate(), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
