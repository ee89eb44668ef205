#include "limber/solvers/pivoted_cholesky.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace limber::internal {
namespace {

constexpr double kPivotTolerance = 1e-12;

/// n × n of a rank, with eigenvalues over four decades.
Eigen::MatrixXd semidefinite(int n, int rank, std::mt19937& random) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd X(n, rank);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < rank; ++j) X(i, j) = normal(random) * std::pow(10.0, -2.0 * j / rank);
  return X * X.transpose();
}

void factor(PivotedCholesky& cholesky, MatrixBuffer& memory, const Eigen::MatrixXd& S) {
  const auto n = static_cast<std::size_t>(S.rows());
  const MatrixView view = memory.need(n, n);
  for (std::size_t i = 0; i < n; ++i) {
    std::fill_n(view.row(i), view.stride, 0.0);
    for (std::size_t j = 0; j < n; ++j) view.row(i)[j] = S(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
  }
  cholesky.factor(view, n, kPivotTolerance);
}

TEST(PivotedCholesky, FindsTheRankAndTheFactor) {
  std::mt19937 random(1);
  MatrixBuffer memory;
  PivotedCholesky cholesky;
  for (const auto& [n, rank] : {std::pair{1, 1}, {5, 5}, {9, 3}, {24, 17}, {40, 1}}) {
    const Eigen::MatrixXd S = semidefinite(n, rank, random);
    factor(cholesky, memory, S);
    ASSERT_EQ(cholesky.rank(), static_cast<std::size_t>(rank));
    Eigen::MatrixXd L(n, rank);
    for (int j = 0; j < rank; ++j)
      for (int i = 0; i < n; ++i) L(i, j) = cholesky.columns().row(static_cast<std::size_t>(j))[i];
    EXPECT_LE((L * L.transpose() - S).norm(), 1e-13 * S.norm());
  }
}

TEST(PivotedCholesky, AppliesThePseudoinverse) {
  std::mt19937 random(2);
  MatrixBuffer memory;
  PivotedCholesky cholesky;
  for (const auto& [n, rank] : {std::pair{6, 6}, {9, 4}, {24, 17}}) {
    const Eigen::MatrixXd S = semidefinite(n, rank, random);
    const Eigen::VectorXd b = Eigen::VectorXd::LinSpaced(n, -1.0, 1.0);
    const Eigen::VectorXd expected = S.completeOrthogonalDecomposition().solve(b);
    factor(cholesky, memory, S);
    AlignedBuffer vector;
    double* x = vector.need(static_cast<std::size_t>(n));
    std::fill_n(x, padded(static_cast<std::size_t>(n)), 0.0);
    std::copy_n(b.data(), n, x);
    cholesky.apply_pseudoinverse(x);
    EXPECT_LE((Eigen::Map<Eigen::VectorXd>(x, n) - expected).norm(), 1e-7 * expected.norm()) << n << " " << rank;
  }
}

}  // namespace
}  // namespace limber::internal
