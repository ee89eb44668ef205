// What steps tell of a matrix: against the update itself, applied densely one pair after another.
#include "solver/secant_pairs.h"

#include <gtest/gtest.h>

namespace limber::internal {
namespace {

constexpr Eigen::Index kSize = 30;

/// Smooth numbers without order.
VectorX numbers(int seed) {
  VectorX out(kSize);
  for (Eigen::Index i = 0; i < kSize; ++i) out[i] = std::sin(1.7 * static_cast<double>(i * i) + 3.1 * seed);
  return out;
}

/// A convex energy's second derivative, and the inverse of a matrix that is wrong along a few directions.
struct Problem {
  Problem() {
    A = MatrixX::Identity(kSize, kSize);
    for (int k = 0; k < 4; ++k) A += (5.0 + k) * numbers(k).normalized() * numbers(k).normalized().transpose();
  }
  MatrixX A{}, kept = MatrixX::Identity(kSize, kSize);  // H⁻¹
};

TEST(SecantPairs, AreTheUpdateOfBroydenFletcherGoldfarbAndShanno) {
  const Problem p;
  SecantPairs pairs;
  MatrixX inverse = p.kept;
  for (int k = 0; k < 6; ++k) {
    const VectorX s = numbers(10 + k), y = p.A * s;
    pairs.add(s, y, p.kept * y);
    const MatrixX left = MatrixX::Identity(kSize, kSize) - s * y.transpose() / s.dot(y);
    inverse = left * inverse * left.transpose() + s * s.transpose() / s.dot(y);
    const VectorX r = numbers(40 + k);
    VectorX u = -p.kept * r;
    pairs.correct(r, u);
    EXPECT_LT((u + inverse * r).norm(), 1e-11 * u.norm()) << k;
    u = -p.kept * y;
    pairs.correct(y, u);
    EXPECT_LT((u + s).norm(), 1e-11 * s.norm()) << "the last step is known";
  }
}

TEST(SecantPairs, TheOldestGiveWay) {
  const Problem p;
  SecantPairs all, last;
  for (int k = 0; k < 20; ++k) {
    const VectorX s = numbers(10 + k), y = p.A * s;
    all.add(s, y, p.kept * y);
    if (k >= 12) last.add(s, y, p.kept * y);
  }
  const VectorX r = numbers(3);
  VectorX u = -r, v = -r;
  all.correct(r, u), last.correct(r, v);
  EXPECT_LT((u - v).norm(), 1e-12 * u.norm());
}

TEST(SecantPairs, WhereNothingPushesBackNothingIsLearnt) {
  const Problem p;
  SecantPairs pairs;
  const VectorX s = numbers(1);
  pairs.add(s, -s, -s);
  VectorX u = -s;
  pairs.correct(s, u);
  EXPECT_EQ(u, VectorX(-s));
}

}  // namespace
}  // namespace limber::internal
