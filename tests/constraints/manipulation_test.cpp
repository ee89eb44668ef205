#include "limber/constraints/manipulation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "constants.h"
#include "islands.h"
#include "limber/core/error.h"

namespace limber {
namespace {

using testing::Island;
using testing::kDown;
using testing::kFrame;
using testing::kGravity;
using testing::kMarked;
using testing::kSecond;

constexpr double kHeldError = 1e-10;

/// A turning, bent, vibrating body.
struct Moving : Island {
  explicit Moving(double step = kFrame) : Island({.modes = 10, .lowest_hz = 4.0, .decay = 0.4}, step) {
    add_body({quaternion_from_rotation_vector({0.3, 0.1, 0.2}), {1.0, 0.5, 0.2}}, {0.1, 0.2, 0.3}, {1.0, -2.0, 0.5});
    group.apply_impulse(0, kSecond, {0.3, 0.2, -0.1}, 0.0);
    group.advance(0, 1, kDown);
  }
  MaterialFrame at(const SurfacePoint& point) const { return {0, *model, point}; }
  std::vector<PointWish> wishes(const SurfacePoint& point, const Vec3& wanted) const {
    std::vector<PointWish> all;
    for (int axis = 0; axis < 3; ++axis) all.push_back({at(point), Vec3::Unit(axis), wanted[axis]});
    return all;
  }
  std::vector<PointForce> forces(const SurfacePoint& point) const {
    std::vector<PointForce> all;
    for (int axis = 0; axis < 3; ++axis) all.push_back({at(point), Vec3::Unit(axis)});
    return all;
  }
};

TEST(Manipulation, GivesAPointAVelocityByImpulsesThereOrElsewhere) {
  for (const SurfacePoint& pushed : {kMarked, kSecond}) {
    Moving body;
    const Vec3 wanted(0.5, -0.4, 0.3);
    std::vector<double> f(3);
    const ManipulationResult result = manipulate(body.table, body.wishes(kMarked, wanted), body.forces(pushed), f,
                                                 {.level = ManipulationLevel::kVelocity});
    EXPECT_EQ(result.rank, 3);
    EXPECT_LT((body.group.velocity(0, kMarked) - wanted).norm(), kHeldError);
  }
}

/// By differences of the velocity over a step so short that forces and accelerations hold.
TEST(Manipulation, GivesAPointAnAccelerationByForcesThereOrElsewhere) {
  const double step = 1e-7;
  for (const SurfacePoint& pushed : {kMarked, kSecond}) {
    Moving body(step);
    const Vec3 wanted(5.0, -4.0, 3.0), before = body.group.velocity(0, kMarked);
    std::vector<double> f(3);
    manipulate(body.table, body.wishes(kMarked, wanted), body.forces(pushed), f,
               {.level = ManipulationLevel::kAcceleration, .gravity = kDown});
    body.group.advance(0, 1, kDown);
    const Vec3 seen = (body.group.velocity(0, kMarked) - before) / step;
    EXPECT_LT((seen - wanted).norm(), 1e-3) << "differences: first order in the step, round-off over it";
  }
}

TEST(Manipulation, TakesAPointToAPlaceByHeldForcesOrImpulses) {
  for (const ManipulationLevel level : {ManipulationLevel::kPosition, ManipulationLevel::kPositionImpulse})
    for (const SurfacePoint& pushed : {kMarked, kSecond}) {
      Moving body;
      const Vec3 wanted = body.group.position(0, kMarked) + Vec3(0.002, 0.001, -0.001);
      std::vector<double> f(3);
      const ManipulationResult result = manipulate(body.table, body.wishes(kMarked, wanted), body.forces(pushed), f,
                                                   {.level = level, .gravity = kDown, .max_iterations = 40});
      EXPECT_LT(result.residual, kHeldError);
      body.group.advance(0, 1, kDown);
      EXPECT_LT((body.group.position(0, kMarked) - wanted).norm(), kHeldError);
    }
}

TEST(Manipulation, ConflictsAreMetInTheLeastSquaresSense) {
  Moving body;
  std::vector<PointWish> wishes = body.wishes(kMarked, {1.0, 0.0, 0.0});
  for (const PointWish& wish : body.wishes(kMarked, {0.0, 0.5, 0.0})) wishes.push_back(wish);
  std::vector<double> f(6);
  const ManipulationResult result = manipulate(body.table, wishes, {}, f, {.level = ManipulationLevel::kVelocity});
  EXPECT_EQ(result.rank, 3);
  EXPECT_LT((body.group.velocity(0, kMarked) - Vec3(0.5, 0.25, 0.0)).norm(), kHeldError);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(f[i], f[i + 3], kHeldError) << "the least norm: shared evenly";
}

TEST(Manipulation, RefusesWhatItCannotDo) {
  Moving body;
  std::vector<double> f(3), short_f(2);
  const auto wishes = body.wishes(kMarked, Vec3::Zero());
  EXPECT_THROW(manipulate(body.table, wishes, {}, short_f), InvalidArgument);
  std::vector<PointWish> long_direction = {{body.at(kMarked), {2.0, 0.0, 0.0}, 0.0}};
  EXPECT_THROW(manipulate(body.table, long_direction, {}, std::span(f).first(1)), InvalidArgument);
  EXPECT_THROW(manipulate({}, wishes, {}, f), InvalidArgument);
}

}  // namespace
}  // namespace limber
