#include "limber/precompute/fem.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "constants.h"
#include "dense_fem.h"
#include "limber/core/error.h"
#include "rubber_box.h"

namespace limber {
namespace {

using testing::kFewRoundings;
using testing::kSteel;
using testing::tet_box;

/// Runs the ranges backwards and cut differently, as another pool of threads might.
class BackwardJobs final : public Jobs {
 public:
  void parallel_for(std::size_t count, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t)>& body) override {
    const std::size_t step = std::max<std::size_t>(grain / 3, 1);
    for (std::size_t end = count; end > 0; end -= std::min(end, step)) body(end - std::min(end, step), end);
  }
  int concurrency() const override { return 3; }
};

TetMesh crooked_box() {
  TetMesh mesh = tet_box(4, 3, 2, {0.4, 0.25, 0.2});
  std::mt19937 random(7);
  std::uniform_real_distribution<double> nudge(-0.015, 0.015);
  for (Vec3& x : mesh.nodes) x += Vec3(nudge(random), nudge(random), nudge(random));
  Warnings warnings;
  validate(mesh, "crooked box", warnings);
  return mesh;
}

Eigen::MatrixXd dense(const SparseMatrix& A) {
  Eigen::MatrixXd D = Eigen::MatrixXd::Zero(A.size, A.size);
  for (Index j = 0; j < A.size; ++j)
    for (Index e = A.column_start[j]; e < A.column_start[j + 1]; ++e) D(A.row[e], j) = A.value[e];
  return D;
}

TEST(TetStiffness, AgreesWithTheHessianOfTheStrainEnergy) {
  const std::array<Vec3, 4> x{Vec3(0.1, 0.2, -0.3), Vec3(1.2, 0.1, 0.0), Vec3(0.3, 0.9, 0.2), Vec3(0.2, 0.4, 1.1)};
  Eigen::Matrix<double, 3, 4> corners;
  for (int a = 0; a < 4; ++a) corners.col(a) = x[a];
  for (const double nu : {-0.5, 0.0, 0.3, 0.49}) {
    const Material m{.youngs_modulus = 3e6, .poisson_ratio = nu, .density = 1.0};
    const auto K = tet_stiffness(x, m);
    const auto reference = testing::dense_tet_stiffness(corners, m);
    for (int i = 0; i < 12; ++i)
      for (int j = 0; j < 12; ++j)
        EXPECT_NEAR(K[12 * i + j], reference(i, j), kFewRoundings * reference.norm()) << i << ' ' << j << ' ' << nu;
  }
}

TEST(Stiffness, AgreesWithADenseAssembly) {
  const TetMesh mesh = crooked_box();
  const auto K = dense(assemble_stiffness(mesh, std::span(&kSteel, 1)));
  const auto reference = testing::dense_model(mesh, std::span(&kSteel, 1), true).K;
  EXPECT_LT((K - reference).cwiseAbs().maxCoeff(), kFewRoundings * reference.cwiseAbs().maxCoeff());
}

TEST(Stiffness, IsSymmetricToTheBit) {
  const auto K = dense(assemble_stiffness(crooked_box(), std::span(&kSteel, 1)));
  EXPECT_TRUE(K == K.transpose());
}

TEST(Stiffness, RigidMotionsMakeNoForce) {
  const TetMesh mesh = crooked_box();
  const auto K = dense(assemble_stiffness(mesh, std::span(&kSteel, 1)));
  for (int motion = 0; motion < 6; ++motion) {
    Eigen::VectorXd u(K.rows());
    for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
      u.segment<3>(3 * i) = motion < 3 ? Vec3(Vec3::Unit(motion)) : Vec3(Vec3::Unit(motion - 3).cross(mesh.nodes[i]));
    EXPECT_LT((K * u).norm(), kFewRoundings * K.norm() * u.norm()) << "motion " << motion;
  }
}

TEST(Stiffness, StretchedBarStoresTheEnergyOfUniformStrain) {
  // u = (εx, −νεy, −νεz) is uniaxial stress: energy E ε²/2 per volume.
  const TetMesh mesh = crooked_box();
  const auto K = dense(assemble_stiffness(mesh, std::span(&kSteel, 1)));
  const double strain = 1e-3, nu = kSteel.poisson_ratio;
  Eigen::VectorXd u(K.rows());
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    u.segment<3>(3 * i) = strain * mesh.nodes[i].cwiseProduct(Vec3(1.0, -nu, -nu));
  const double energy = kSteel.youngs_modulus * strain * strain / 2.0 * volume_properties(mesh).volume;
  EXPECT_NEAR(0.5 * u.dot(K * u), energy, kFewRoundings * energy);
}

TEST(Stiffness, BitsDoNotDependOnHowTheWorkIsCut) {
  const TetMesh mesh = tet_box(12, 1.0);
  BackwardJobs backward;
  const auto a = assemble_stiffness(mesh, std::span(&kSteel, 1));
  const auto b = assemble_stiffness(mesh, std::span(&kSteel, 1), backward);
  EXPECT_EQ(a.column_start, b.column_start);
  EXPECT_EQ(a.row, b.row);
  EXPECT_EQ(a.value, b.value);
  const auto c = assemble_mass(mesh, std::span(&kSteel, 1), MassKind::kConsistent);
  const auto d = assemble_mass(mesh, std::span(&kSteel, 1), MassKind::kConsistent, backward);
  EXPECT_EQ(c.row, d.row);
  EXPECT_EQ(c.value, d.value);
}

TEST(Mass, AgreesWithQuadrature) {
  const TetMesh mesh = crooked_box();
  for (const bool lumped : {true, false}) {
    const auto M =
        dense(assemble_mass(mesh, std::span(&kSteel, 1), lumped ? MassKind::kLumped : MassKind::kConsistent));
    const auto reference = testing::dense_model(mesh, std::span(&kSteel, 1), lumped).M;
    for (Eigen::Index i = 0; i < M.rows(); ++i)
      for (Eigen::Index j = 0; j < M.cols(); ++j)
        EXPECT_NEAR(M(i, j), reference(3 * i + 1, 3 * j + 1), kFewRoundings * reference.maxCoeff());
  }
}

TEST(Mass, RowsSumToTheTotalMassAndLumpingKeepsThem) {
  TetMesh mesh = crooked_box();
  mesh.regions.push_back({.name = "heavy"});
  for (std::size_t e = 0; e < mesh.tets.size(); e += 3) mesh.tet_region[e] = 1;
  const std::array materials{kSteel, Material{.youngs_modulus = 1e9, .poisson_ratio = 0.2, .density = 19300.0}};
  double mass = 0.0;
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    mass += materials[mesh.tet_region[e]].density * signed_volume(mesh, static_cast<Index>(e));
  const Eigen::VectorXd consistent = dense(assemble_mass(mesh, materials, MassKind::kConsistent)).rowwise().sum();
  const Eigen::VectorXd lumped = dense(assemble_mass(mesh, materials, MassKind::kLumped)).rowwise().sum();
  EXPECT_NEAR(consistent.sum(), mass, kFewRoundings * mass);
  EXPECT_NEAR(lumped.sum(), mass, kFewRoundings * mass);
  EXPECT_LT((consistent - lumped).norm(), kFewRoundings * mass);
}

TEST(Assembly, NeedsOneMaterialPerRegion) {
  const TetMesh mesh = tet_box(1, 1.0);
  EXPECT_THROW(assemble_stiffness(mesh, {}), InvalidArgument);
  EXPECT_THROW(assemble_mass(mesh, {}, MassKind::kLumped), InvalidArgument);
}

}  // namespace
}  // namespace limber
