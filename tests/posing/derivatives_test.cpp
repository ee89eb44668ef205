// Derivatives by hand against finite differences, joints' rows against what joints mean.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "posed_models.h"
#include "solver/bounded_system.h"
#include "solver/pose_solver.h"

namespace limber {
namespace {

using namespace internal;
using testing::bar_surface;
using testing::single_part;

constexpr double kStep = 1e-6;
constexpr double kDifference = 2e-8;  // of central differences at this step, of values of order 1

/// Random numbers that are the same everywhere.
class Dice {
 public:
  double operator()() { return 2.0 * static_cast<double>(generator_() % 20001u) / 20000.0 - 1.0; }
  Vec3 vector() { return {(*this)(), (*this)(), (*this)()}; }
  Quaternion turn(double largest) { return quaternion_from_rotation_vector(largest * vector()); }

 private:
  std::mt19937 generator_{7};
};

/// Two boxes, joined.
PoseStructure two_boxes(JointType type, double pitch = 0.0) {
  JointedModel model = single_part(shapes::box({0, 0, 0}, {1, 0.5, 0.4}));
  shapes::append(shapes::box({1, 0, 0}, {2, 0.5, 0.4}), model.surface);
  model.parts.push_back({"second", {}});
  for (Index t = 12; t < 24; ++t) model.parts[1].triangles.push_back(t);
  JointSpec joint{.type = type,
                  .frame = {{1.0, 0.2, 0.1}, to_matrix(quaternion_from_rotation_vector({0.3, 1.0, -0.5}))}};
  joint.pitch = pitch;
  joint.limits.cone = type == JointType::kBall ? 1.0 : joint.limits.cone;
  if (type == JointType::kBall) joint.limits.euler = {Interval{-1, 1}, Interval{-1, 1}, Interval{-1, 1}};
  model.joints.push_back({0, 1, joint, {}});
  return build_structure(model, {{}, {}}, {false, false}, StrainWeights::kVolume);
}

BodyPoses anywhere(const PoseStructure& s, Dice& dice, double turn = 0.7) {
  BodyPoses poses = rest_poses(s);
  for (auto& X : poses) X = {dice.turn(turn), X.p + 0.3 * dice.vector()};
  return poses;
}

std::vector<Row> all(const JointRows& rows) {
  std::vector<Row> out = rows.constraints;
  for (const CoordinateRow& c : rows.coordinates) out.push_back(c.row);
  return out;
}

class JointDerivatives : public ::testing::TestWithParam<std::pair<JointType, double>> {};

TEST_P(JointDerivatives, AreThoseOfFiniteDifferences) {
  const PoseStructure s = two_boxes(GetParam().first, GetParam().second);
  Dice dice;
  for (int trial = 0; trial < 5; ++trial) {
    const BodyPoses poses = anywhere(s, dice);
    const auto rows_at = [&](const BodyPoses& at) {
      JointRows rows;
      append_joint_rows(s, s.joints[0], at, 0.0, rows);
      return all(rows);
    };
    const std::vector<Row> rows = rows_at(poses);
    for (const Index body : {0, 1})
      for (int k = 0; k < 6; ++k) {
        BodyPoses more = poses, less = poses;
        const auto b = static_cast<std::size_t>(body);
        more[b] = moved(poses[b], kStep * Twist::Unit(k));
        less[b] = moved(poses[b], -kStep * Twist::Unit(k));
        const auto high = rows_at(more), low = rows_at(less);
        for (std::size_t r = 0; r < rows.size(); ++r)
          EXPECT_NEAR((body == 0 ? rows[r].J_a : rows[r].J_b)[k], (high[r].value - low[r].value) / (2.0 * kStep),
                      kDifference)
              << "row " << r << " body " << body << " component " << k;
      }
  }
}

TEST_P(JointDerivatives, OfSecondOrderAreThoseOfFiniteDifferences) {
  const PoseStructure s = two_boxes(GetParam().first, GetParam().second);
  constexpr double kSecondStep = 1e-4, kSecondDifference = 1e-6;
  Dice dice;
  for (int trial = 0; trial < 5; ++trial) {
    const BodyPoses poses = anywhere(s, dice);
    JointRows rows;
    append_joint_rows(s, s.joints[0], poses, 0.0, rows);
    const std::size_t held = GetParam().second == 0.0 ? rows.constraints.size() : 0;  // an angle is curved in Q
    for (std::size_t r = 0; r < held; ++r) {
      const Row& row = rows.constraints[r];
      const PairMatrix K = joint_curvature(s, s.joints[0], poses, row.dQ, row.dt);
      EXPECT_EQ((K - K.transpose()).norm(), 0.0);
      for (int along = 0; along < 8; ++along) {
        const Twist a = Twist::NullaryExpr([&] { return dice(); }), b = Twist::NullaryExpr([&] { return dice(); });
        const auto value = [&](double h) {
          BodyPoses at = poses;
          at[0] = moved(poses[0], h * a), at[1] = moved(poses[1], h * b);
          JointRows there;
          append_joint_rows(s, s.joints[0], at, 0.0, there);
          return there.constraints[r].value;
        };
        Eigen::Matrix<double, 12, 1> x;
        x << a, b;
        const auto screw = [](const Twist& J, const Twist& u) {  // what forces that balance do not make
          return J.tail<3>().dot(u.head<3>().cross(u.tail<3>()));
        };
        EXPECT_NEAR((value(kSecondStep) + value(-kSecondStep) - 2.0 * value(0.0)) / (kSecondStep * kSecondStep),
                    x.dot(K * x) + screw(row.J_a, a) + screw(row.J_b, b), kSecondDifference)
            << "row " << r;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllTypes, JointDerivatives,
                         ::testing::Values(std::pair(JointType::kBall, 0.0), std::pair(JointType::kRevolute, 0.0),
                                           std::pair(JointType::kCylindrical, 0.0),
                                           std::pair(JointType::kCylindrical, 0.05),
                                           std::pair(JointType::kPrismatic, 0.0), std::pair(JointType::kPlanar, 0.0)));

/// Moves b by a motion in the joint's frame.
BodyPoses moved_in_joint(const PoseStructure& s, const Vec3& rotation, const Vec3& translation) {
  const JointFrame& f = s.joints[0].joint.frame;
  const RigidTransform J{quaternion_from_matrix(f.axes), f.origin};
  const RigidTransform motion =
      J * RigidTransform{quaternion_from_rotation_vector(rotation), translation} * J.inverse();
  BodyPoses poses = rest_poses(s);
  poses[1] = motion * poses[1];
  return poses;
}

double error_of(const PoseStructure& s, const BodyPoses& poses) {
  JointRows rows;
  append_joint_rows(s, s.joints[0], poses, 0.0, rows);
  double out = 0.0;
  for (const Row& r : rows.constraints) out = std::max(out, std::abs(r.value));
  return out;
}

TEST(JointRows, VanishForTheMotionsThatTheTypeLeavesAndForNoOther) {
  struct Case {
    JointType type;
    double pitch;
    std::array<bool, 6> free;  // about x y z, along x y z
  };
  for (const Case& c : {Case{JointType::kBall, 0.0, {true, true, true, false, false, false}},
                        Case{JointType::kRevolute, 0.0, {true, false, false, false, false, false}},
                        Case{JointType::kCylindrical, 0.0, {true, false, false, true, false, false}},
                        Case{JointType::kCylindrical, 0.05, {false, false, false, false, false, false}},
                        Case{JointType::kPrismatic, 0.0, {false, false, false, true, false, false}},
                        Case{JointType::kPlanar, 0.0, {false, false, true, true, true, false}}}) {
    const PoseStructure s = two_boxes(c.type, c.pitch);
    for (int k = 0; k < 6; ++k) {
      constexpr double kMotion = 0.4, kRoundOff = 1e-14;
      const Vec3 w = k < 3 ? Vec3(kMotion * Vec3::Unit(k)) : Vec3::Zero(),
                 t = k < 3 ? Vec3::Zero() : Vec3(kMotion * Vec3::Unit(k - 3));
      const double error = error_of(s, moved_in_joint(s, w, t));
      if (c.free[static_cast<std::size_t>(k)]) {
        EXPECT_LT(error, kRoundOff) << to_string(c.type) << " " << k;
      } else {
        EXPECT_GT(error, 1e-3) << to_string(c.type) << " " << k;
      }
    }
  }
}

TEST(JointRows, AScrewAdvancesByItsPitch) {
  const PoseStructure s = two_boxes(JointType::kCylindrical, 0.05);
  EXPECT_LT(error_of(s, moved_in_joint(s, {1.2, 0, 0}, {0.05 * 1.2, 0, 0})), 1e-14);
}

TEST(JointRows, AnAngleIsToldOnFromTurnToTurn) {
  const PoseStructure s = two_boxes(JointType::kRevolute);
  double turn = 0.0;
  for (int i = 1; i <= 20; ++i) turn = joint_turn(s, s.joints[0], moved_in_joint(s, {0.5 * i, 0, 0}, {0, 0, 0}), turn);
  EXPECT_NEAR(turn, 10.0, 1e-12);
}

TEST(PoseEnergy, ItsGradientIsThatOfFiniteDifferences) {
  const PoseStructure s =
      build_structure(single_part(bar_surface(4.0, 1.0, 4)), {{.cells = Subdivision::kUniform, .cell_size = 0.7}},
                      {false}, StrainWeights::kVolume);
  Dice dice;
  const BodyPoses poses = anywhere(s, dice);
  const std::vector<HandleTerm> handles{{0, {0.1, 0.2, -0.3}, {1, 2, 3}, 0.5}};
  const auto energy = [&](const BodyPoses& at) {
    const auto R = rotations_of(at);
    return strain_energy(s, at, R) + handle_energy(handles, at, R);
  };
  const BodyLoads l = loads(s, handles, poses, rotations_of(poses));
  for (std::size_t b = 0; b < poses.size(); b += 3)
    for (int k = 0; k < 6; ++k) {
      BodyPoses more = poses, less = poses;
      more[b] = moved(poses[b], kStep * Twist::Unit(k));
      less[b] = moved(poses[b], -kStep * Twist::Unit(k));
      EXPECT_NEAR(l.gradient[b][k], (energy(more) - energy(less)) / (2.0 * kStep), 10.0 * kDifference);
    }
}

TEST(PoseEnergy, ItsMatrixIsTheSecondDerivativeWhereNothingIsStrained) {
  // All bodies turned together: residuals vanish, and Gauss–Newton's matrix is exact.
  const PoseStructure s =
      build_structure(single_part(bar_surface(3.0, 1.0, 3)), {{.cells = Subdivision::kUniform, .cell_size = 1.0}},
                      {false}, StrainWeights::kVolume);
  BodyPoses poses = rest_poses(s);
  const RigidTransform X{quaternion_from_rotation_vector({0.4, -1.1, 2.0}), {3, -5, 7}};
  for (auto& pose : poses) pose = X * pose;
  std::vector<bool> interface(s.bodies.size(), false);
  interface.front() = true;
  ElasticSystem system(s, interface, 0.0, 0.0);
  std::vector<TwistMatrix> anchors(s.bodies.size(), TwistMatrix::Zero());
  anchors[0].setIdentity();
  ASSERT_TRUE(system.factor(rotations_of(poses), anchors, {}));
  Dice dice;
  for (int trial = 0; trial < 5; ++trial) {
    VectorX f(system.dofs()), at_interface, u;
    for (auto& x : f) x = dice();
    system.reduce(f, at_interface);
    system.expand(at_interface, u);
    // f·u = uᵀHu: the energy of a motion along u, to second order.
    const double scale = 1e-3 / u.norm();
    BodyPoses trial_poses = poses;
    for (std::size_t b = 0; b < poses.size(); ++b)
      trial_poses[b] = moved(poses[b], scale * u.segment<6>(6 * static_cast<Index>(b)));
    const double expected =
        2.0 * strain_energy(s, trial_poses, rotations_of(trial_poses)) + scale * scale * u.head<6>().squaredNorm();
    EXPECT_NEAR(scale * scale * f.dot(u), expected, 5e-3 * expected);  // the next order is 1e-3 smaller
    // With no force elsewhere the others follow the interface: they bear no force.
    VectorX followed;
    system.follow(at_interface, followed);
    BodyPoses carried = poses;
    for (std::size_t b = 0; b < poses.size(); ++b)
      carried[b] = moved(poses[b], 1e-6 * followed.segment<6>(6 * static_cast<Index>(b)));
    const BodyLoads l = loads(s, {}, carried, rotations_of(carried));
    for (std::size_t b = 1; b < poses.size(); ++b) EXPECT_LT(l.gradient[b].norm(), 1e-10 * followed.norm());
  }
}

TEST(PoseEnergy, TurningStiffnessIsTheCurvatureOfArcs) {
  // A weight hung from a rod of length 2 by a force of 3: a pendulum, stiffness 6 about both axes across.
  const Vec3 arm(0, 0, -2), gradient(0, 0, 3);
  const Mat3 G = turning_stiffness(arm * gradient.transpose());
  EXPECT_NEAR((G - Mat3(Vec3(6, 6, 0).asDiagonal())).norm(), 0.0, 1e-12);
  const Mat3 fallen = turning_stiffness(arm * -gradient.transpose());  // upside down
  EXPECT_NEAR((fallen + G).norm(), 0.0, 1e-12);
  EXPECT_NEAR(positive_part(fallen).norm(), 0.0, 1e-12);
}

TEST(BoundedSystem, LimitsPushAndNeverPull) {
  Dice dice;
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Index n = 2 + trial % 9;
    const MatrixX G = MatrixX::NullaryExpr(n, n + 1, [&] { return dice(); });
    const MatrixX A = G * G.transpose();
    const VectorX b = VectorX::NullaryExpr(n, [&] { return dice(); });
    std::vector<bool> pushes(static_cast<std::size_t>(n));
    for (std::size_t i = 0; i < pushes.size(); ++i) pushes[i] = i % 3 != 0;
    VectorX lambda = VectorX::NullaryExpr(n, [&] { return dice(); });
    solve_bounded(A, b, pushes, lambda);
    const VectorX slack = A * lambda - b;
    const double round_off = 1e-7 * lambda.cwiseAbs().maxCoeff();
    for (Eigen::Index i = 0; i < n; ++i) {
      if (!pushes[static_cast<std::size_t>(i)]) {
        EXPECT_NEAR(slack[i], 0.0, round_off);
        continue;
      }
      EXPECT_GE(lambda[i], 0.0);
      EXPECT_GE(slack[i], -round_off);
      EXPECT_NEAR(slack[i] * lambda[i], 0.0, round_off * std::max(1.0, lambda[i]));
    }
  }
}

TEST(BoundedSystem, RowsThatStandTwiceShare) {
  const MatrixX A = MatrixX::Constant(2, 2, 4.0);
  VectorX lambda;
  solve_bounded(A, VectorX::Constant(2, 8.0), {false, false}, lambda);
  EXPECT_NEAR(lambda[0], 1.0, 1e-6);
  EXPECT_NEAR(lambda[1], 1.0, 1e-6);
}

}  // namespace
}  // namespace limber
