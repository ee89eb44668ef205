/// @file limber/precompute/eigenvalue_count.h
/// How many eigenvalues of K w = λ M w lie below a number, without computing any of them.
///
/// Sylvester: K − σM = L D Lᵀ has as many negative pivots in D as there are λ < σ. The factorisation pivots (MUMPS), so
/// the count is that of a matrix within round-off of K − σM: choose σ well inside a gap of the spectrum.
#pragma once

#include <memory>
#include <span>

#include "limber/precompute/sparse_matrix.h"

namespace limber {
namespace internal {
class IndefiniteFactor;
}

/// Counts for several σ share one symbolic factorisation.
class EigenvalueCounter {
 public:
  /// @param K 3n × 3n, symmetric. @param node_mass n × n, as from assemble_mass(). Both must outlive the counter.
  /// @param node_order order of elimination of the n nodes
  /// @throws ComputationError if MUMPS cannot analyse the matrix
  EigenvalueCounter(const SparseMatrix& K, const SparseMatrix& node_mass, std::span<const Index> node_order);
  ~EigenvalueCounter();
  EigenvalueCounter(const EigenvalueCounter&) = delete;
  EigenvalueCounter& operator=(const EigenvalueCounter&) = delete;

  /// Number of λ < σ. @throws ComputationError if the factorisation fails (memory, or σ is an eigenvalue)
  int below(double sigma);

 private:
  const SparseMatrix& K_;
  const SparseMatrix& node_mass_;
  std::unique_ptr<internal::IndefiniteFactor> factor_;
};

}  // namespace limber
