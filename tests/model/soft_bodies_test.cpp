// Ready bodies: their modes against a dense solution of matrices made in another way, and against those of the ball.
#include "limber/model/soft_bodies.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <vector>

#include "dense_fem.h"
#include "limber/core/error.h"

namespace limber {
namespace {

constexpr Material kRubber{1e6, 0.3, 1100.0};

TetMesh mesh_of(const ModalModel& model) {
  const ModalVolume& volume = *model.data().volume_block;
  TetMesh mesh{.nodes = volume.rest, .tets = volume.tets, .regions = {{.name = "all"}}};
  mesh.tet_region.assign(mesh.tets.size(), 0);
  return mesh;
}

TEST(SoftBodies, ModesAreThoseOfTheDenseProblem) {
  constexpr int kModes = 9;
  const auto box = make_soft_box({0.3, 0.2, 0.1}, {4, 3, 2}, kRubber, kModes);
  const testing::DenseModel dense = testing::dense_model(mesh_of(*box), std::vector<Material>{kRubber}, true);
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> all(dense.K, dense.M, Eigen::EigenvaluesOnly);
  constexpr int kRigid = 6;
  for (int i = 0; i < kModes; ++i) {
    const double expected = all.eigenvalues()[kRigid + i];
    EXPECT_NEAR(box->data().eigenvalues[static_cast<std::size_t>(i)], expected, 1e-8 * expected) << "mode " << i;
  }
}

TEST(SoftBodies, ShapesAreOrthonormalAndCarryNoMomentum) {
  constexpr double kSingle = 1e-5;
  const auto ball = make_soft_ball(0.3, 4, kRubber, 12, 0.05);
  const ModalVolume& volume = *ball->data().volume_block;
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(12, 12), momentum = Eigen::MatrixXd::Zero(6, 12);
  for (Index n = 0; n < volume.basis.vertices(); ++n)
    for (Index i = 0; i < 12; ++i) {
      const Vec3 p = volume.mass_times_basis.shape(n, i).cast<double>();
      momentum.col(i) << momentum.col(i).head<3>() + p,
          momentum.col(i).tail<3>() + volume.rest[static_cast<std::size_t>(n)].cross(p);
      for (Index j = 0; j < 12; ++j) product(i, j) += p.dot(volume.basis.shape(n, j).cast<double>());
    }
  EXPECT_LE((product - Eigen::MatrixXd::Identity(12, 12)).cwiseAbs().maxCoeff(), kSingle);
  EXPECT_LE(momentum.cwiseAbs().maxCoeff(), kSingle * std::sqrt(ball->data().mass));
  for (std::size_t i = 0; i < 12; ++i)
    EXPECT_NEAR(ball->data().decays[i], 0.05 * std::sqrt(ball->data().eigenvalues[i]), 1e-9);
  EXPECT_NEAR(ball->data().mass, 1100.0 * ball->data().volume, 1e-9);
}

/// The ball's lowest modes twist its halves against each other, five of them at x = ω r / c_s = 2.5011 (A. E. H. Love,
/// A Treatise on the Mathematical Theory of Elasticity, 1927, chapter XII). Cells, which know directions, tell them
/// apart.
TEST(SoftBodies, ABallTwistsInFiveModesThatCellsHardlyTellApart) {
  const double radius = 0.3, wave = std::sqrt(kRubber.shear_modulus() / kRubber.density);
  double last = 1.0;
  for (const Index cells : {3, 4, 6}) {
    const auto ball = make_soft_ball(radius, cells, kRubber, 6);
    std::vector<double> x;
    for (const double lambda : ball->data().eigenvalues) x.push_back(std::sqrt(lambda) * radius / wave);
    const double spread = x[4] - x[0], mean = (x[0] + x[1] + x[2] + x[3] + x[4]) / 5.0;
    EXPECT_LT(spread, last) << cells << " cells";
    last = spread;
    if (cells < 6) continue;
    EXPECT_NEAR(mean, 2.5011, 0.02);
    EXPECT_GT(x[5] - x[4], 2.0 * spread);  // the next ones are of another kind
  }
}

TEST(SoftBodies, ArgumentsAreChecked) {
  EXPECT_THROW(make_soft_box({0.1, 0.0, 0.1}, {2, 2, 2}, kRubber, 3), InvalidArgument);
  EXPECT_THROW(make_soft_box({0.1, 0.1, 0.1}, {2, 0, 2}, kRubber, 3), InvalidArgument);
  EXPECT_THROW(make_soft_box({0.1, 0.1, 0.1}, {2, 2, 2}, {}, 3), InvalidArgument);
  EXPECT_THROW(make_soft_box({0.1, 0.1, 0.1}, {1, 1, 1}, kRubber, 9), InvalidArgument);
  EXPECT_THROW(make_soft_box({0.1, 0.1, 0.1}, {2, 2, 2}, kRubber, 3, -0.1), InvalidArgument);
  EXPECT_THROW(make_soft_ball(0.1, 1, kRubber, 3), InvalidArgument);
  EXPECT_EQ(make_soft_box({0.1, 0.1, 0.1}, {1, 1, 1}, kRubber, 8)->modes(), 8);  // as many as there may be
}

}  // namespace
}  // namespace limber
