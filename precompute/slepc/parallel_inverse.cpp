#include "parallel_inverse.h"

namespace limber::internal {
namespace {

constexpr int kMaxRefinements = 8;
constexpr double kRefined = 1e-12;     // a correction this small, relative to the answer, was the last
constexpr double kContraction = 0.25;  // a correction must be this much smaller than the one before

}  // namespace

ParallelInverse::ParallelInverse(DistributedBody& body)
    : body_(body),
      factor_(body.pinned_stiffness(), body.elimination_order(), ParallelFactor::Keeps::kFactor, body.stages()) {
  if (factor_.negative_pivots() != 0)
    throw ComputationError(
        "the body is so near to a mechanism that its stiffness is not positive definite in floating point: use "
        "--engine arpack, which shifts it");
}

ParallelInverse::ParallelInverse(DistributedBody& body, double sigma)
    : body_(body),
      shift_(-sigma),
      factor_(body.shifted_stiffness(-sigma), body.elimination_order(), ParallelFactor::Keeps::kFactor, body.stages()) {
}

Eigen::MatrixXd ParallelInverse::balanced(const Eigen::Ref<const Eigen::MatrixXd>& F) const {
  return F - body_.MN() * DistributedBody::dot(body_.N(), F);
}

Eigen::MatrixXd ParallelInverse::apply(const Eigen::Ref<const Eigen::MatrixXd>& F) {
  Eigen::MatrixXd B = balanced(F);
  if (shift_ == 0.0) B(body_.pinned_rows(), Eigen::all).setZero();
  Eigen::MatrixXd U = factor_.solve(B);
  U -= body_.N() * DistributedBody::dot(body_.MN(), U);
  return U;
}

Eigen::MatrixXd ParallelInverse::apply_accurately(const Eigen::Ref<const Eigen::MatrixXd>& F) {
  Eigen::MatrixXd U = apply(F);
  const auto lengths = [&](const Eigen::MatrixXd& X) -> Eigen::ArrayXd {
    return DistributedBody::dot(X.cwiseProduct(body_.mass_times(X)), Eigen::MatrixXd::Ones(X.rows(), 1)).cwiseSqrt();
  };
  double change_before = 1.0;
  for (int step = 0; step < kMaxRefinements; ++step) {
    Eigen::MatrixXd residual = balanced(F) - body_.stiffness_times(U);
    if (shift_ != 0.0) residual -= shift_ * body_.mass_times(U);
    const Eigen::MatrixXd correction = apply(residual);
    const double change = (lengths(correction) / lengths(U)).maxCoeff();
    if (change > kContraction * change_before) break;  // no longer improves
    U += correction;
    if (change < kRefined) break;
    change_before = change;
  }
  return U;
}

}  // namespace limber::internal
