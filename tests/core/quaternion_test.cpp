#include "limber/core/quaternion.h"

#include <gtest/gtest.h>

#include <limits>
#include <numbers>

#include "limber/core/rigid_transform.h"

namespace limber {
namespace {

constexpr double kRoundOff = 16 * std::numeric_limits<double>::epsilon();

TEST(Quaternion, RotatesLikeItsMatrix) {
  const Quaternion q = quaternion_from_rotation_vector({0.3, -1.2, 2.0});
  const Vec3 v{1.0, 2.0, -3.0};
  EXPECT_LT((q * v - to_matrix(q) * v).norm(), kRoundOff * v.norm());
}

TEST(Quaternion, QuarterTurnAboutZTakesXToY) {
  const Quaternion q = quaternion_from_rotation_vector({0, 0, std::numbers::pi / 2});
  EXPECT_LT((q * Vec3::UnitX() - Vec3::UnitY()).norm(), kRoundOff);
}

TEST(Quaternion, TinyRotationVectorsKeepTheirDigits) {
  const double angle = 1e-9;
  EXPECT_NEAR(quaternion_from_rotation_vector({angle, 0, 0}).x, angle / 2, kRoundOff * angle);
}

TEST(Quaternion, MatrixRoundTripIsExactUpToSign) {
  const Quaternion q = normalized({0.1, 0.7, -0.3, 0.5});
  const Quaternion p = quaternion_from_matrix(to_matrix(q));
  EXPECT_LT(std::abs(q.w - p.w) + (q.vector() - p.vector()).norm(), kRoundOff);
}

TEST(Quaternion, SlerpHalfwayIsHalfTheAngleByTheShortArc) {
  const Quaternion a, b = quaternion_from_rotation_vector({0, 0, 1.0});
  const Quaternion half = slerp(a, {-b.w, -b.x, -b.y, -b.z}, 0.5);
  const Quaternion expected = quaternion_from_rotation_vector({0, 0, 0.5});
  EXPECT_NEAR(half.w, expected.w, kRoundOff);
  EXPECT_NEAR(half.z, expected.z, kRoundOff);
}

TEST(RigidTransform, InverseUndoesAndInnerLettersMeet) {
  const RigidTransform X_AB{quaternion_from_rotation_vector({1, 2, 3}), {4, 5, 6}};
  const Vec3 p{0.1, 0.2, 0.3};
  EXPECT_LT((X_AB.inverse() * (X_AB * p) - p).norm(), 8 * kRoundOff);
}

}  // namespace
}  // namespace limber
