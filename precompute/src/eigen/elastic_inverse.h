/// @file elastic_inverse.h
/// K⁺: the displacement that a load gives a body free to float, without any shift of the spectrum.
///
/// With N an M-orthonormal basis of the null space of K and P = I − N (M N)ᵀ,
///
///   K⁺ = P K_pin⁻¹ Pᵀ
///
/// where K_pin holds d = dim N degrees of freedom, chosen so that N restricted to them is far from singular. Pᵀ f is a
/// load in equilibrium, so the pins carry nothing, and P takes the null motions out of the answer. K_pin is positive
/// definite, so CHOLMOD's LLᵀ serves; K⁺M has the eigenvalues 1/λ on the elastic modes and 0 on N.
///
/// A body so near to a mechanism that K_pin is not definite in floating point gets (K + sM)⁻¹ between P and Pᵀ instead,
/// with eigenvalues 1/(λ + s).
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "eigen/cholesky_solver.h"
#include "eigen/indefinite_factor.h"
#include "limber/precompute/sparse_matrix.h"

namespace limber::internal {

/// K w = λ M w on the free nodes of a body, in units where entries of K and M are about one.
struct ScaledProblem {
  SparseMatrix K;          ///< 3n × 3n
  SparseMatrix node_mass;  ///< n × n, acts alike on the three axes
  Eigen::MatrixXd N;       ///< null space of K, NᵀMN = I; may have no columns
  Eigen::MatrixXd MN;
  /// K X for a few columns, tet by tet: without the round-off of K's entries (see elastic_forces).
  std::function<Eigen::MatrixXd(const Eigen::MatrixXd&)> stiffness_times;

  Index size() const { return K.size; }
  Eigen::MatrixXd mass_times(const Eigen::Ref<const Eigen::MatrixXd>& X) const;
};

/// P (K + sM)⁻¹ Pᵀ for some s. On an elastic mode of eigenvalue λ it has the eigenvalue 1/(λ + s).
class SpectralInverse {
 public:
  virtual ~SpectralInverse() = default;

  /// P (K + sM)⁻¹ Pᵀ F
  Eigen::MatrixXd apply(const Eigen::Ref<const Eigen::MatrixXd>& F);

  /// The same, improved by residuals that stiffness_times() gives, as long as that changes it: for loads that are all
  /// of size F_i ~ M w_i, and bodies so slender or of such different stiffnesses that round-off of K shows.
  Eigen::MatrixXd apply_accurately(const Eigen::Ref<const Eigen::MatrixXd>& F);

  double shift() const { return shift_; }  ///< s
  int solves() const { return solves_; }   ///< right-hand sides so far

 protected:
  explicit SpectralInverse(const ScaledProblem& problem, double shift = 0.0) : problem_(problem), shift_(shift) {}

  const ScaledProblem& problem_;
  double shift_;

 private:
  /// An answer to a load that is orthogonal to N, up to motions of N.
  virtual Eigen::MatrixXd answer(const Eigen::Ref<const Eigen::MatrixXd>& balanced) = 0;

  int solves_ = 0;
};

/// As many degrees of freedom as N has columns, such that N cannot move without moving them.
std::vector<Index> choose_pins(const Eigen::MatrixXd& N);

/// K⁺; s = 0 unless K_pin does not factor.
class ElasticInverse final : public SpectralInverse {
 public:
  /// @param node_order from order_nodes(problem.K). Keeps a reference to the problem.
  /// @throws ComputationError if no factor can be had
  ElasticInverse(const ScaledProblem& problem, const std::vector<Index>& node_order);

  const std::vector<Index>& pinned() const { return pinned_; }

 private:
  std::vector<Index> pinned_, kept_;  // degrees of freedom, ascending
  CholeskySolver solver_;

  Eigen::MatrixXd answer(const Eigen::Ref<const Eigen::MatrixXd>& balanced) override;
  CholeskySolver factor(const std::vector<Index>& node_order);
};

/// Between eigenvalues: s = −σ, so that modes near σ have the largest eigenvalues, of both signs.
class ShiftedInverse final : public SpectralInverse {
 public:
  /// @throws ComputationError if K − σM does not factor, as where σ is an eigenvalue. Keeps a reference to the problem.
  ShiftedInverse(const ScaledProblem& problem, const std::vector<Index>& node_order, double sigma);

 private:
  IndefiniteFactor factor_;

  Eigen::MatrixXd answer(const Eigen::Ref<const Eigen::MatrixXd>& balanced) override;
};

}  // namespace limber::internal
