/// @file lanczos.h
/// The modes nearest to −s: the eigenvalues of largest size of P (K + sM)⁻¹ Pᵀ M by ARPACK's implicitly restarted
/// Lanczos method, in the M inner product.
#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "eigen/elastic_inverse.h"

namespace limber::internal {

struct LanczosOptions {
  int count = 1;            ///< eigenpairs wanted; ≥ 1
  int subspace = 0;         ///< Lanczos vectors, count < subspace ≤ size
  double tolerance = 1e-8;  ///< relative, on 1/λ; a step of inverse iteration follows
  std::uint64_t seed = 0;   ///< of the start vector: the same seed, the same bits
};

/// @param found vectors to look besides, XᵀMX = I; may have no columns. @param mass_times_found M X
/// @return M-orthonormal vectors, ascending λ. Fewer than `count` if ARPACK did not converge on all.
/// One caller at a time: ARPACK keeps its state in static variables, so calls wait for each other.
Eigen::MatrixXd lanczos(const ScaledProblem& problem, SpectralInverse& inverse, const Eigen::MatrixXd& found,
                        const Eigen::MatrixXd& mass_times_found, const LanczosOptions& options);

}  // namespace limber::internal
