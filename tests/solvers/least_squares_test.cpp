// Equality rows of any rank against Eigen's complete orthogonal decomposition and by their conditions.
#include "limber/solvers/least_squares.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "counted_new.h"
#include "limber/core/error.h"
#include "random_rows.h"

namespace limber {
namespace {

using namespace testing;

// Singular values below this part of the largest are zero: the square root of the solver's rank cut.
constexpr double kSingular = 3.2e-6;

Eigen::VectorXd solve(LeastSquaresSolver& solver, const Rows& rows, const Eigen::VectorXd& r) {
  Eigen::VectorXd f(r.size());
  EXPECT_EQ(solver.factor(span_of(rows.J), span_of(rows.metric), static_cast<int>(r.size())).status,
            SolveStatus::kSolved);
  EXPECT_EQ(solver.solve(span_of(r), span_of(f)), SolveStatus::kSolved);
  return f;
}

/// (B Bᵀ)⁺ r = (B⁺)ᵀ B⁺ r, B = J D^½.
Eigen::VectorXd solve_by_orthogonal_decomposition(const Rows& rows, const Eigen::VectorXd& r) {
  Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> B;
  B.setThreshold(kSingular);
  B.compute(rows.J * rows.metric.cwiseSqrt().asDiagonal());
  const Eigen::VectorXd u = B.solve(r);
  return B.transpose().solve(u);
}

// Forces of random rows: the condition number of S, up to about 1e6 here, times round-off.
constexpr double kForces = 1e-9;
// What the held points miss, relative: round-off of the residual, which one refinement reaches.
constexpr double kHeld = 1e-12;

TEST(LeastSquares, AgreesWithTheOrthogonalDecomposition) {
  std::mt19937 random(1);
  LeastSquaresSolver solver;
  for (int n = 0; n < 200; ++n) {
    const int m = 1 + (7 * n) % 60, d = 1 + (11 * n) % 50;
    const int rank = n % 3 == 0 ? 1 + n % std::min(m, d) : std::min(m, d);
    const Rows rows = make_rows(m, d, std::min(rank, m), random);
    const Eigen::VectorXd r = random_vector(m, random);  // conflicting where m > rank
    const Eigen::VectorXd f = solve(solver, rows, r);
    const Eigen::VectorXd reference = solve_by_orthogonal_decomposition(rows, r);
    EXPECT_LT((f - reference).norm(), kForces * reference.norm()) << n << ": " << m << " × " << d;
  }
}

TEST(LeastSquares, HeldPointsReachTheirTargets) {
  std::mt19937 random(2);
  LeastSquaresSolver solver;
  for (const auto& [m, d, rank] : {std::array{3, 46, 3}, {30, 46, 30}, {46, 46, 46}, {90, 46, 20}, {300, 64, 64}}) {
    const Rows rows = make_rows(m, d, rank, random);
    const Eigen::VectorXd r = rows.J * random_vector(d, random);  // feasible
    const Eigen::VectorXd f = solve(solver, rows, r);
    EXPECT_LT((rows.S() * f - r).norm(), kHeld * r.norm()) << m << " rows of rank " << rank;
  }
}

TEST(LeastSquares, ConflictsAreMetInTheLeastSquaresSense) {
  std::mt19937 random(3);
  LeastSquaresSolver solver;
  const Rows rows = make_rows(40, 12, 12, random);
  const Eigen::VectorXd r = random_vector(40, random);
  const Eigen::VectorXd f = solve(solver, rows, r);
  const Eigen::VectorXd miss = r - rows.S() * f;
  EXPECT_GT(miss.norm(), 0.1);
  EXPECT_LT((rows.J.transpose() * miss).norm(), kHeld * rows.J.norm() * r.norm());  // no motion comes closer
}

TEST(LeastSquares, RedundantRowsShareTheForce) {
  LeastSquaresSolver solver;
  const Rows rows{.J = Matrix::Ones(5, 1), .metric = Eigen::VectorXd::Constant(1, 2.0)};
  const Eigen::VectorXd f = solve(solver, rows, Eigen::VectorXd::Constant(5, 1.0));
  for (const double x : f) EXPECT_NEAR(x, 0.1, kHeld);  // (2·11ᵀ) f = 1
  const auto result = solver.factor(span_of(rows.J), span_of(rows.metric), 5);
  EXPECT_EQ(result.rank, 1);
}

TEST(LeastSquares, RowsThatNothingMovesAreLeftAlone) {
  LeastSquaresSolver solver;
  const Rows rows{.J = Matrix::Zero(3, 4), .metric = Eigen::VectorXd::Ones(4)};
  EXPECT_EQ(solve(solver, rows, Eigen::VectorXd::Ones(3)).norm(), 0.0);
  const Rows none{.J = Matrix(3, 0), .metric = Eigen::VectorXd(0)};
  EXPECT_EQ(solve(solver, none, Eigen::VectorXd::Ones(3)).norm(), 0.0);
}

TEST(LeastSquares, NumbersThatAreNotFiniteAreAResultNotAnException) {
  LeastSquaresSolver solver;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> J = {nan}, one = {1.0}, bad = {nan}, negative = {-1.0};
  std::vector<double> f = {3.0};
  EXPECT_EQ(solver.factor(J, one, 1).status, SolveStatus::kInvalidInput);
  EXPECT_EQ(solver.solve(one, f), SolveStatus::kInvalidInput);
  EXPECT_EQ(f[0], 0.0);
  EXPECT_EQ(solver.factor(one, negative, 1).status, SolveStatus::kInvalidInput);
  EXPECT_EQ(solver.factor(one, one, 1).status, SolveStatus::kSolved);
  EXPECT_EQ(solver.solve(bad, f), SolveStatus::kInvalidInput);
  EXPECT_THROW(solver.factor(one, one, 2), InvalidArgument);
}

TEST(LeastSquares, SameBitsEveryTimeAndNoAllocationOnceWarm) {
  std::mt19937 random(5);
  LeastSquaresSolver solver, other;
  const Rows large = make_rows(120, 40, 30, random), small = make_rows(12, 40, 12, random);
  const Eigen::VectorXd r = random_vector(12, random), r_large = random_vector(120, random);
  const Eigen::VectorXd f = solve(solver, small, r);
  Eigen::VectorXd f_large = solve(other, large, r_large);
  EXPECT_EQ(solve(other, small, r), f);
  const long before = testing::allocations();
  other.factor(span_of(large.J), span_of(large.metric), 120);
  other.solve(span_of(r_large), span_of(f_large));
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
