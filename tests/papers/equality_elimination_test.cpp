// Problems of contacts that joints are taken out of, against the whole problem.
#include "limber/hauser/equality_elimination.h"

#include <gmock/gmock.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "counted_new.h"
#include "random_rows.h"

namespace limber {
namespace {

using namespace testing;

// Forces of random rows: the condition number of S, up to about 1e6 here, times round-off.
constexpr double kForces = 1e-9;
// Round-off of eigenvalues, relative.
constexpr double kHeld = 1e-12;

/// Rows of joints (some twice, as in a closed loop) and contacts over one set of motions.
struct Eliminated {
  Matrix A;
  Eigen::VectorXd b;
  int equalities = 0;
};

Eliminated make_loop(int equalities, int contacts, int d, int redundant, std::mt19937& random) {
  const Rows rows = make_rows(equalities + contacts, d, equalities + contacts, random);
  Matrix J = rows.J;
  for (int i = 0; i < redundant; ++i) J.row(equalities - 1 - i) = J.row(i) + J.row(i + 1);
  J.topRows(equalities / 2) *= 1e-3;  // rows in other units
  const Matrix A = J * J.transpose();
  return {.A = 0.5 * (A + A.transpose()), .b = J * random_vector(d, random), .equalities = equalities};
}

TEST(EqualityElimination, ReducedProblemIsTheWholeOneWithJointsHeld) {
  std::mt19937 random(6);
  EqualityElimination elimination;
  for (const int redundant : {0, 1, 3}) {
    const Eliminated s = make_loop(9, 7, 30, redundant, random);
    const auto e = s.equalities, c = static_cast<int>(s.b.size()) - e;
    Matrix A(c, c);
    Eigen::VectorXd b(c), f(s.b.size()), f_e(e);
    const auto result =
        elimination.reduce(span_of(s.A), span_of(s.b), e, {A.data(), static_cast<std::size_t>(A.size())}, span_of(b));
    EXPECT_EQ(result.rank, e - redundant);
    const Eigen::VectorXd f_c = random_vector(c, random);
    elimination.recover(span_of(f_c), span_of(f_e));
    f << f_e, f_c;
    const Eigen::VectorXd w = s.A * f + s.b;
    const double size = s.b.norm() + s.A.norm() * f_c.norm();
    EXPECT_LT(w.head(e).norm(), kForces * size) << redundant;
    EXPECT_LT((w.tail(c) - (A * f_c + b)).norm(), kForces * size) << redundant;
    EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A).eigenvalues()[0], -kHeld * s.A.norm());
  }
}

TEST(EqualityElimination, WithoutJointsNothingChanges) {
  std::mt19937 random(7);
  EqualityElimination elimination;
  const Eliminated s = make_loop(0, 5, 10, 0, random);
  Matrix A(5, 5);
  Eigen::VectorXd b(5);
  elimination.reduce(span_of(s.A), span_of(s.b), 0, {A.data(), 25}, span_of(b));
  EXPECT_EQ(A, s.A);
  EXPECT_EQ(b, s.b);
}

TEST(EqualityElimination, DoesNotAllocateOnceWarm) {
  std::mt19937 random(8);
  EqualityElimination elimination;
  const Eliminated s = make_loop(12, 8, 30, 2, random);
  Matrix A(8, 8);
  Eigen::VectorXd b(8), f_e(12);
  const auto run = [&] {
    elimination.reduce(span_of(s.A), span_of(s.b), 12, {A.data(), 64}, span_of(b));
    elimination.recover(span_of(b), span_of(f_e));
  };
  run();
  const long before = testing::allocations();
  run();
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
