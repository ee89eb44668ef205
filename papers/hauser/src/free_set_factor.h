// The Cholesky factor of the block of A that belongs to the free forces, A_PP = RᵀR, kept while forces enter and leave.
#pragma once

#include <vector>

#include "limber/solvers/aligned_buffer.h"

namespace limber::internal {

class FreeSetFactor {
 public:
  /// Empties the set; room for `capacity` forces.
  void reset(std::size_t capacity);

  std::size_t size() const { return size_; }

  /// Adds a force at the end of the set.
  /// @param column size() numbers with padding: A_Pj; overwritten by R⁻ᵀA_Pj
  /// @return false, and nothing is added, if its row depends on those in the set
  bool append(double* column, double diagonal);

  /// Takes the force at `position` out; those behind it move up.
  void remove(std::size_t position);

  /// x ← A_PP⁻¹x; the first `first` numbers of x are known to be zero. x has padding.
  void solve(double* x, std::size_t first = 0) const;

  /// x ← R⁻¹x: with append()'s column, A_PP⁻¹A_Pj.
  void solve_upper(double* x) const;

 private:
  void solve_lower(double* x, std::size_t first) const;  // x ← R⁻ᵀx

  std::size_t size_ = 0;
  MatrixBuffer memory_;
  MatrixView R_{};  // its rows above the diagonal, zero at and below it; the diagonal apart
  std::vector<double> diagonal_, inverse_;
};

}  // namespace limber::internal
