/// @file parallel_inverse.h
/// SpectralInverse over many processes: P (K + sM)⁻¹ Pᵀ, with K pinned where s = 0.
#pragma once

#include <Eigen/Core>

#include "distributed_body.h"
#include "parallel_factor.h"

namespace limber::internal {

class ParallelInverse {
 public:
  /// K⁺. @throws ComputationError where the pinned K is not positive definite in floating point
  explicit ParallelInverse(DistributedBody& body);
  /// Between eigenvalues: s = −σ.
  ParallelInverse(DistributedBody& body, double sigma);

  Eigen::MatrixXd apply(const Eigen::Ref<const Eigen::MatrixXd>& F);
  /// Improved by residuals that stiffness_times() gives, as SpectralInverse::apply_accurately().
  Eigen::MatrixXd apply_accurately(const Eigen::Ref<const Eigen::MatrixXd>& F);

  DistributedBody& body() { return body_; }
  const ParallelFactor& factor() const { return factor_; }
  double shift() const { return shift_; }  ///< s

 private:
  DistributedBody& body_;
  double shift_ = 0.0;
  ParallelFactor factor_;

  Eigen::MatrixXd balanced(const Eigen::Ref<const Eigen::MatrixXd>& F) const;
};

}  // namespace limber::internal
