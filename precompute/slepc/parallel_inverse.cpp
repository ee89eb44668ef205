#include "parallel_inverse.h"

#include "eigen/refinement.h"

namespace limber::internal {
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
  const auto lengths = [&](const Eigen::MatrixXd& X) -> Eigen::ArrayXd {
    return DistributedBody::dot(X.cwiseProduct(body_.mass_times(X)), Eigen::MatrixXd::Ones(X.rows(), 1)).cwiseSqrt();
  };
  const auto residual = [&](const Eigen::MatrixXd& U) {
    Eigen::MatrixXd left = balanced(F) - body_.stiffness_times(U);
    if (shift_ != 0.0) left -= shift_ * body_.mass_times(U);
    return left;
  };
  return refined_answer(
      F, [&](const auto& X) { return apply(X); }, residual, lengths);
}

}  // namespace limber::internal
