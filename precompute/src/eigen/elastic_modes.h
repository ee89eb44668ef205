/// @file elastic_modes.h
/// The lowest elastic eigenpairs of a scaled problem, and their completeness.
#pragma once

#include <Eigen/Core>

#include "eigen/elastic_inverse.h"
#include "eigen/lanczos.h"
#include "limber/core/error.h"
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
EigenPairs refined(const ScaledProblem& problem, SpectralInverse& inverse, const Eigen::MatrixXd& X);

/// The first place at or after `wanted` where a gap ends the list, or −1 if there is none among the pairs, of which the
/// problem has `available`.
Eigen::Index end_of_cluster(const Eigen::VectorXd& lambda, Eigen::Index wanted, Eigen::Index available);

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

/// The zero modes are as many as geometry says: none but those of N lies below half the first elastic eigenvalue. Where
/// round-off makes K resist even N by as much as that, there is nothing to see, and the caller is told.
/// @param pairs the lowest. @throws ComputationError if the count differs
void confirm_zero_modes(const ScaledProblem& problem, const EigenPairs& pairs, EigenvalueCounter& counter,
                        Warnings& warnings);

/// The pairs with low < λ < high, all of them: none that the count tells is missing.
/// @param inverse shifted to (low + high)/2, to which these are the nearest. @param count how many there are, by
/// inertia
/// @throws ComputationError if the count cannot be met
EigenPairs modes_between(const ScaledProblem& problem, SpectralInverse& inverse, double low, double high,
                         Eigen::Index count, LanczosOptions options);

/// Turns every cluster of eigenvalues that cannot be told apart into its canonical form, with equal λ.
void make_clusters_canonical(EigenPairs& pairs);

}  // namespace limber::internal
