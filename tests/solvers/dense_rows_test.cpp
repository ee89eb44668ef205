// The dense solvers of joints and handles, against Eigen's decompositions.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <vector>

#include "limber/solvers/damped_least_squares.h"
#include "limber/solvers/unsymmetric_factor.h"

namespace limber::internal {
namespace {

using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

std::span<double> numbers(RowMajor& m) { return {m.data(), static_cast<std::size_t>(m.size())}; }
std::span<double> numbers(Eigen::VectorXd& v) { return {v.data(), static_cast<std::size_t>(v.size())}; }

TEST(UnsymmetricFactor, SolvesAsEigensLuDoes) {
  std::srand(3);
  UnsymmetricFactor factor;
  for (const int n : {1, 2, 7, 30}) {
    RowMajor A = RowMajor::Random(n, n), B = RowMajor::Random(n, 4);
    A(0, 0) = 0.0;  // no pivot where one would be taken first
    if (n == 1) A(0, 0) = 0.7;
    const RowMajor expected = Eigen::FullPivLU<RowMajor>(A).solve(B);
    ASSERT_TRUE(factor.factor(numbers(A), static_cast<std::size_t>(n)));
    factor.solve(numbers(B), 4);
    EXPECT_LT((B - expected).norm(), 1e-11 * expected.norm()) << n;
  }
}

TEST(UnsymmetricFactor, SaysThatAMatrixHasNoInverse) {
  RowMajor A(2, 2);
  A << 1.0, 2.0, 0.5, 1.0;
  UnsymmetricFactor factor;
  EXPECT_FALSE(factor.factor(numbers(A), 2));
}

/// By singular values: x = Σ v σ/(σ² + damping²) (u·b).
TEST(DampedLeastSquares, IsWhatSingularValuesSayForAnyRank) {
  std::srand(5);
  DampedLeastSquares rows;
  for (const int n : {1, 3, 12})
    for (const int rank : {1, n / 2, n})
      for (const double damping : {1e-9, 1e-3, 1.0}) {
        RowMajor A = RowMajor::Random(n, rank) * RowMajor::Random(rank, n);
        const Eigen::VectorXd b = Eigen::VectorXd::Random(n);
        const Eigen::JacobiSVD<Eigen::MatrixXd> svd(A, Eigen::ComputeFullU | Eigen::ComputeFullV);
        Eigen::VectorXd gains = svd.singularValues();
        // What is zero but for round-off is no direction to go in by the damping of 1e-9 either.
        for (double& s : gains) s = s < 1e-13 * svd.singularValues()[0] ? 0.0 : s / (s * s + damping * damping);
        const Eigen::VectorXd expected = svd.matrixV() * gains.asDiagonal() * svd.matrixU().transpose() * b;
        Eigen::VectorXd x = b;
        rows.factor(numbers(A), static_cast<std::size_t>(n), damping);
        rows.solve(numbers(x));
        EXPECT_LT((A * (x - expected)).norm(), 1e-9 * (1.0 + expected.norm())) << n << ' ' << rank << ' ' << damping;
      }
}

}  // namespace
}  // namespace limber::internal
