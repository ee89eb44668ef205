// The paper's energies: values by hand, derivatives by differences, and poses that are near the constrained form's.
#include "penalty_energy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "limber/core/error.h"
#include "posed_models.h"

namespace limber {
namespace {

using namespace internal;
using namespace testing;

constexpr double kRoundOff = 1e-12;

TEST(PenaltyEnergy, ScalingAndShearingCostRigidity) {
  const double s = 1.1, g = 0.2;
  Mat3 shear = Mat3::Identity();
  shear(0, 1) = g;
  EXPECT_NEAR(rigidity_residuals(s * Mat3::Identity()).squaredNorm(), 3.0 * std::pow(s * s - 1.0, 2), kRoundOff);
  EXPECT_NEAR(rigidity_residuals(shear).squaredNorm(), g * g + std::pow(g, 4), kRoundOff);
  EXPECT_NEAR(rigidity_residuals(to_matrix(quaternion_from_rotation_vector({1, 2, 3}))).norm(), 0.0, kRoundOff);
}

/// Two unit cubes and a joint along x between them.
struct TwoCubes {
  explicit TwoCubes(JointType type) {
    JointedModel model = single_part(shapes::box({0, 0, 0}, {1, 1, 1}));
    shapes::append(shapes::box({1, 0, 0}, {2, 1, 1}), model.surface);
    model.parts.push_back({"second", {}});
    for (Index t = 12; t < 24; ++t) model.parts[1].triangles.push_back(t);
    model.joints.push_back({0, 1, {.type = type, .frame = {{1.0, 0.3, 0.4}, Mat3::Identity()}}, {}});
    structure = build_structure(model, {{}, {}}, {false, false}, StrainWeights::kVolume);
    const PlacedCell& cell = structure.cells[1];
    for (std::size_t i = 0; i < 8; ++i)
      corners[i] = cell.cell.centre + cell.cell.half.cwiseProduct(Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  }
  BodyMap rest(std::size_t body) const { return {Mat3::Identity(), structure.bodies[body].centre}; }
  /// b turned about the joint's origin, then moved.
  BodyMap moved(const Vec3& rotation, const Vec3& translation) const {
    const Mat3 R = to_matrix(quaternion_from_rotation_vector(rotation));
    const Vec3 o = structure.joints[0].joint.frame.origin;
    return {R, R * (structure.bodies[1].centre - o) + o + translation};
  }
  double energy(const BodyMap& b) const {
    double out = 0.0;
    for (const PairResidual& r : joint_residuals(structure, structure.joints[0], rest(0), b, corners, 0.0))
      out += r.value * r.value;
    return out;
  }

  PoseStructure structure;
  std::array<Vec3, 8> corners;
};

TEST(PenaltyEnergy, JointsCostNothingForTheMotionsTheyAllow) {
  EXPECT_NEAR(TwoCubes(JointType::kBall).energy(TwoCubes(JointType::kBall).moved({0.3, 0.8, -0.5}, {0, 0, 0})), 0.0,
              kRoundOff);
  EXPECT_NEAR(TwoCubes(JointType::kRevolute).energy(TwoCubes(JointType::kRevolute).moved({0.9, 0, 0}, {0, 0, 0})), 0.0,
              kRoundOff);
  EXPECT_NEAR(
      TwoCubes(JointType::kCylindrical).energy(TwoCubes(JointType::kCylindrical).moved({0.9, 0, 0}, {0.7, 0, 0})), 0.0,
      kRoundOff);
  EXPECT_NEAR(TwoCubes(JointType::kPrismatic).energy(TwoCubes(JointType::kPrismatic).moved({0, 0, 0}, {0.7, 0, 0})),
              0.0, kRoundOff);
  EXPECT_NEAR(TwoCubes(JointType::kPlanar).energy(TwoCubes(JointType::kPlanar).moved({0, 0, 0.9}, {0.7, -0.2, 0})), 0.0,
              kRoundOff);
}

TEST(PenaltyEnergy, ARevoluteSlidByTCostsEightTSquared) {
  const TwoCubes cubes(JointType::kRevolute);
  EXPECT_NEAR(cubes.energy(cubes.moved({0, 0, 0}, {0.1, 0, 0})), 8.0 * 0.1 * 0.1, kRoundOff);
}

TEST(PenaltyEnergy, ATiltCostsWhatTheAxesAreApart) {
  const TwoCubes cubes(JointType::kRevolute);
  const double phi = 0.4;
  double axes = 0.0;
  const auto r = joint_residuals(cubes.structure, cubes.structure.joints[0], cubes.rest(0),
                                 cubes.moved({0, phi, 0}, {0, 0, 0}), cubes.corners, 0.0);
  for (std::size_t i = 0; i < 3; ++i) axes += r[i].value * r[i].value;
  EXPECT_NEAR(axes, 2.0 - 2.0 * std::cos(phi), kRoundOff);
}

TEST(PenaltyEnergy, ItsJacobianIsThatOfFiniteDifferences) {
  PosingSession lamp(rigid_assembly("brush arm"));  // all six types
  JointedModel model = lamp.model();
  std::vector<bool> pinned(model.parts.size(), false);
  pinned[0] = true;
  const PoseStructure s =
      build_structure(model, std::vector<PartOptions>(model.parts.size()), pinned, StrainWeights::kVolume);
  const PenaltyEnergy energy(s, {.rigidity = 1.0, .joints = 1.0}, {{1, {0.1, 0, 0.2}, {1, 1, 1}, 2.0}});
  std::vector<BodyMap> maps;
  for (std::size_t b = 0; b < s.bodies.size(); ++b) {
    const double x = 0.1 * static_cast<double>(b + 1);
    Mat3 A = to_matrix(quaternion_from_rotation_vector({x, -0.5 * x, 0.3}));
    A(0, 1) += 0.05 * x;
    maps.push_back({A, s.bodies[b].centre + x * Vec3(0.1, -0.2, 0.1)});
  }
  const std::vector<double> turns(s.joints.size(), 0.0);
  PenaltyEnergy::Jacobian J;
  energy.residuals(maps, turns, &J);
  constexpr double kStep = 1e-6;
  for (std::size_t b = 0; b < maps.size(); ++b)
    for (int u = 0; u < 12 && energy.dof(static_cast<Index>(b)) >= 0; ++u) {
      auto more = maps, less = maps;
      (u < 9 ? more[b].A(u % 3, u / 3) : more[b].p[u - 9]) += kStep;
      (u < 9 ? less[b].A(u % 3, u / 3) : less[b].p[u - 9]) -= kStep;
      const Eigen::VectorXd difference =
          (energy.residuals(more, turns, nullptr) - energy.residuals(less, turns, nullptr)) / (2.0 * kStep);
      const Eigen::VectorXd column = J.col(energy.dof(static_cast<Index>(b)) + u);
      EXPECT_LT((column - difference).norm(), 1e-7 * (1.0 + column.norm())) << b << " " << u;
    }
}

TEST(PenaltyEnergy, ALampFollowsItsHandleAndLeavesItsJointsAlmostWhole) {
  PosingSession session(rigid_assembly("lamp"), {}, penalty_poses());
  session.set_pinned(0, true);
  const Index shade = session.model().part_named("shade");
  const Vec3 grip = furthest_point(session.model(), shade, Vec3(-1, -2, -3));
  const PoseHandle handle = session.add_handle(shade, grip);
  session.move_handle(handle, grip + Vec3(0.03, 0.05, -0.06));
  PoseResult r = session.solve();
  const double before = r.initial_energy;
  for (int more = 0; more < 20 && r.status == PoseResult::Status::kIterationLimit; ++more) {
    r = session.solve();
    EXPECT_LE(r.energy, r.initial_energy);
    EXPECT_LT(r.joint_error, 1e-2);
  }
  EXPECT_LT(r.energy, 0.1 * before);
}

TEST(PenaltyPoses, WeightsOutOfRangeAreRefused) {
  EXPECT_THROW(penalty_poses({.rigidity = 0.0}), InvalidArgument);
  EXPECT_THROW(penalty_poses({.joints = std::numeric_limits<double>::infinity()}), InvalidArgument);
}

}  // namespace
}  // namespace limber
