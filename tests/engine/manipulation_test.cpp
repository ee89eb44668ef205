#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "constants.h"
#include "limber/core/error.h"
#include "limber/engine/world.h"
#include "sample_models.h"

namespace limber::testing {
namespace {

constexpr double kHeldError = 1e-9;
constexpr SurfacePoint kThird{.triangle = 5, .weight = {0.6, 0.2, 0.2}};
const BodyPlacement kMoving{.pose = {quaternion_from_rotation_vector({0.3, 0.1, 0.2}), {1.0, 0.5, 0.2}},
                            .velocity = {0.1, 0.2, 0.3},
                            .angular_velocity = {1.0, -2.0, 0.5}};

std::vector<BodyWish> wishes(BodyId id, const SurfacePoint& at, const Vec3& wanted) {
  std::vector<BodyWish> all;
  for (int axis = 0; axis < 3; ++axis) all.push_back({id, at, Vec3::Unit(axis), wanted[axis]});
  return all;
}
std::vector<BodyForce> forces(BodyId id, const SurfacePoint& at) {
  std::vector<BodyForce> all;
  for (int axis = 0; axis < 3; ++axis) all.push_back({id, at, Vec3::Unit(axis)});
  return all;
}
template <class List>
void append(List& to, const List& more) {
  to.insert(to.end(), more.begin(), more.end());
}

struct Hands {
  World world;
  BodyId a, b;
  explicit Hands(const WorldOptions& options = {}) : world(options) {
    const auto model = sample_model({.modes = 10, .lowest_hz = 4.0, .decay = 0.4});
    a = world.add_body(model, kMoving);
    b = world.add_body(model, {.pose = {{}, {-2.0, 0.0, 0.0}}});
    world.step();
  }
};

/// Two points of one body and one of another go where they are wanted, by forces at the same or at other points.
TEST(WorldManipulation, PointsOfSeveralBodiesAreAtTheirPlacesAfterTheStep) {
  for (const bool elsewhere : {false, true}) {
    Hands hands;
    const Vec3 first = hands.world.position(hands.a, kMarked) + Vec3(0.001, 0.002, -0.001);
    const Vec3 other = hands.world.position(hands.b, kSecond) + Vec3(0.0, 0.01, 0.005);
    std::vector<BodyWish> wanted = wishes(hands.a, kMarked, first);
    append(wanted, wishes(hands.b, kSecond, other));
    std::vector<BodyForce> acting;
    if (elsewhere) {
      append(acting, forces(hands.a, kThird));
      append(acting, forces(hands.b, kMarked));
    }
    std::vector<double> impulses(6);
    const ManipulationResult result =
        hands.world.manipulate(wanted, acting, impulses, ManipulationLevel::kPosition, 60);
    EXPECT_EQ(result.rank, 6);
    EXPECT_LT(result.residual, kHeldError);
    hands.world.step();
    EXPECT_LT((hands.world.position(hands.a, kMarked) - first).norm(), kHeldError) << elsewhere;
    EXPECT_LT((hands.world.position(hands.b, kSecond) - other).norm(), kHeldError) << elsewhere;
  }
}

/// What is told as impulses is what the body's momentum changes by.
TEST(WorldManipulation, VelocitiesChangeAtOnceByTheImpulsesTold) {
  Hands hands;
  const Vec3 wanted(0.5, -0.4, 0.3), before = hands.world.linear_momentum(hands.a);
  std::vector<double> p(3);
  hands.world.manipulate(wishes(hands.a, kMarked, wanted), forces(hands.a, kThird), p, ManipulationLevel::kVelocity);
  EXPECT_LT((hands.world.velocity(hands.a, kMarked) - wanted).norm(), kHeldError);
  EXPECT_LT((hands.world.linear_momentum(hands.a) - before - Vec3(p[0], p[1], p[2])).norm(), kHeldError);
}

/// By differences of the velocity over a step so short that all accelerations hold, of a body that spins: [H03]
/// equations 19 and 20.
TEST(WorldManipulation, AccelerationsAreSeenInAShortStep) {
  constexpr double kShort = 1e-7;
  for (const SurfacePoint& pushed : {kMarked, kThird}) {
    Hands hands({.step = kShort});
    const Vec3 wanted(5.0, -4.0, 3.0), before = hands.world.velocity(hands.a, kMarked);
    std::vector<double> f(3);
    hands.world.manipulate(wishes(hands.a, kMarked, wanted), forces(hands.a, pushed), f,
                           ManipulationLevel::kAcceleration);
    hands.world.step();
    const Vec3 seen = (hands.world.velocity(hands.a, kMarked) - before) / kShort;
    EXPECT_LT((seen - wanted).norm(), 1e-3) << "differences: first order in the step, round-off over it";
  }
}

TEST(WorldManipulation, ForcesForAnAccelerationLastForAllPartsOfTheStep) {
  for (const int substeps : {1, 4}) {
    Hands hands({.substeps = substeps, .gravity = Vec3::Zero()});
    const Vec3 before = hands.world.linear_momentum(hands.a);
    std::vector<double> f(3);
    hands.world.manipulate(wishes(hands.a, kMarked, {5.0, -4.0, 3.0}), {}, f, ManipulationLevel::kAcceleration);
    hands.world.step();
    const Vec3 gained = hands.world.linear_momentum(hands.a) - before;
    EXPECT_LT((gained - hands.world.options().step * Vec3(f[0], f[1], f[2])).norm(), kHeldError) << substeps;
  }
}

TEST(WorldManipulation, WakesWhomItPushes) {
  World world({.gravity = Vec3::Zero(), .sleep = {.enabled = true, .time = 0.1}});
  const BodyId id = world.add_body(sample_model({.modes = 3}), {});
  for (int i = 0; i < 20; ++i) world.step();
  ASSERT_TRUE(world.is_asleep(id));
  std::vector<double> p(3);
  EXPECT_THROW(
      world.manipulate(wishes(id, kMarked, Vec3::UnitX()), {}, std::span(p).first(2), ManipulationLevel::kVelocity),
      InvalidArgument);
  EXPECT_TRUE(world.is_asleep(id)) << "a refused call wakes nobody";
  world.manipulate(wishes(id, kMarked, Vec3::UnitX()), {}, p, ManipulationLevel::kVelocity);
  EXPECT_FALSE(world.is_asleep(id));
  EXPECT_LT((world.velocity(id, kMarked) - Vec3::UnitX()).norm(), kHeldError);
}

TEST(WorldManipulation, RefusedCallsChangeNothing) {
  Hands hands, untouched;
  World& world = hands.world;
  std::vector<double> f(3), short_f(2);
  const std::vector<BodyWish> good = wishes(hands.a, kMarked, Vec3::Zero());
  std::vector<BodyWish> bad = good;
  const auto refused = [&](auto&& change) {
    bad = good;
    change(bad[2]);
    EXPECT_THROW(world.manipulate(bad, {}, f), InvalidArgument);
    EXPECT_THROW(world.manipulate(bad, {}, f, ManipulationLevel::kVelocity), InvalidArgument);
  };
  refused([](BodyWish& wish) { wish.body = {9, 1}; });
  refused([](BodyWish& wish) { wish.at.triangle = 99; });
  refused([](BodyWish& wish) { wish.direction = {2.0, 0.0, 0.0}; });
  refused([](BodyWish& wish) { wish.wanted = std::numeric_limits<double>::quiet_NaN(); });
  EXPECT_THROW(world.manipulate(good, {}, short_f), InvalidArgument);
  EXPECT_THROW(world.manipulate(good, {}, f, ManipulationLevel::kPosition, 0), InvalidArgument);
  const std::vector<BodyForce> nowhere{{{9, 1}, kMarked}};
  EXPECT_THROW(world.manipulate(good, nowhere, std::span(f).first(1)), InvalidArgument);
  EXPECT_EQ(world.state_hash(), untouched.world.state_hash());
  world.step(), untouched.world.step();
  EXPECT_EQ(world.state_hash(), untouched.world.state_hash()) << "no load is left behind";
}

TEST(WorldManipulation, PlacesAreRefusedWhereAStepHasParts) {
  Hands hands({.substeps = 2});
  std::vector<double> f(3);
  EXPECT_THROW(hands.world.manipulate(wishes(hands.a, kMarked, Vec3::Zero()), {}, f), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
