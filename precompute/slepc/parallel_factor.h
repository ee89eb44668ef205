/// @file parallel_factor.h
/// MUMPS's LDLᵀ of a matrix whose rows are shared out among processes. MUMPS itself, not by way of PETSc, which hands
/// no order of elimination on: Debian's MUMPS has neither METIS nor Scotch to find one.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "petsc_objects.h"
#include "stages.h"

namespace limber::internal {

class ParallelFactor {
 public:
  enum class Keeps { kFactor, kPivotSigns, kEstimate };  ///< the last: analyses alone
  /// Collective, as all below. @param A is released before it is factored
  /// @param place_in_order of each row, from 1; looked at on the first process alone
  /// @param stages takes "assemble", since the last lap, "analyse" and "factor", or all as "certify"
  /// @throws ComputationError where there is not enough memory or the matrix is singular
  ParallelFactor(OwnedMat A, const std::vector<int>& place_in_order, Keeps keeps, Stages& stages);
  ParallelFactor(ParallelFactor&&) noexcept;
  ~ParallelFactor();

  int negative_pivots() const;
  /// All columns at once: reading the factor from memory is most of the time.
  Eigen::MatrixXd solve(const Eigen::MatrixXd& B);
  double entries() const;         ///< of L, in all; estimated where it is not made
  double flops() const;           ///< that make it
  double largest_memory() const;  ///< estimated bytes that MUMPS takes in the process that has most

 private:
  struct Mumps;
  std::unique_ptr<Mumps> mumps_;
};

}  // namespace limber::internal
