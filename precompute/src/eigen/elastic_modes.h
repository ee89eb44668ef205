/// @file elastic_modes.h
/// The lowest elastic eigenpairs of a scaled problem, and their completeness.
#pragma once

#include <Eigen/Core>

#include "eigen/elastic_inverse.h"
#include "eigen/lanczos.h"
#include "limber/precompute/eigenvalue_count.h"

namespace limber::internal {

struct EigenPairs {
  Eigen::VectorXd lambda;  ///< ascending
  Eigen::MatrixXd W, MW;   ///< WᵀMW = I, one column per λ

  Eigen::Index count() const { return lambda.size(); }
  void keep_first(Eigen::Index count);
};

/// One block step of inverse iteration on X and a Rayleigh–Ritz projection onto the result. Since K (K⁺ M X) = M X, the
/// projection needs no product with K, in whose round-off the lowest eigenvalues of a slender body would drown.
EigenPairs refined(const ScaledProblem& problem, ElasticInverse& inverse, const Eigen::MatrixXd& X);

/// The lowest pairs: `wanted` at least, as far as there are so many, and as many more as it takes to end at a gap.
/// @param options tolerance and seed; its counts are set here
/// @param[out] pairs_to_keep how many of them were asked for, a cluster at the end completed
EigenPairs lowest_modes(const ScaledProblem& problem, ElasticInverse& inverse, Eigen::Index wanted,
                        LanczosOptions options, Eigen::Index& pairs_to_keep);

/// Makes sure that no eigenvalue below the last pair is missing: counts those below a number in the widest gap at the
/// end of the list. If the count says that some are, looks for them orthogonally to those found and counts again.
/// @throws ComputationError if the count still differs after that
void complete(const ScaledProblem& problem, ElasticInverse& inverse, EigenvalueCounter& counter, EigenPairs& pairs,
              Eigen::Index wanted, Eigen::Index& pairs_to_keep);

/// Turns every cluster of eigenvalues that cannot be told apart into its canonical form, with equal λ.
void make_clusters_canonical(EigenPairs& pairs);

}  // namespace limber::internal
