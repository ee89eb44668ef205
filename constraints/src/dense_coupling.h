// A in full, for islands of few rows.
#pragma once

#include <vector>

#include "aligned_buffer.h"
#include "free_set_factor.h"
#include "row_coupling.h"

namespace limber {

/// LU with row exchanges of a small matrix, in place.
class DenseLu {
 public:
  bool factor(MatrixView M, std::size_t n);
  void solve(double* x) const;
  void reserve(std::size_t n) { pivots_.reserve(n); }

 private:
  MatrixView M_{};
  std::size_t n_ = 0;
  std::vector<std::size_t> pivots_;
};

class DenseCoupling final : public RowCoupling {
 public:
  /// @param A n × n, kept by reference until scale()
  void set(std::span<const double> A, std::size_t n) { given_ = A, n_ = n; }

  std::size_t rows() const override { return n_; }
  Mat3 own_block(std::size_t first, std::size_t count) const override;
  void scale(std::span<const double> s) override;
  void multiply(double* out, const double* x) override { multiply_rows(out, A_, nullptr, x, n_, n_); }
  bool convex_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) override;
  bool map_step(std::span<const ProjectionDerivative> P, double rho, const double* d, double* dy) override;
  bool factor_shifted(double shift) override;
  void solve_shifted(double* x) override;
  void begin_sweeps(const double* f) override;
  Vec3 answer(std::size_t first, std::size_t count) const override;
  void move(std::size_t first, std::size_t count, const Vec3& change) override;

 private:
  /// Columns of S, P' = S Sᵀ, those of one cone or row next to each other.
  struct Column {
    std::size_t first = 0, rows = 0;
    Vec3 s = Vec3::Zero();
  };

  std::span<const double> given_;
  std::size_t n_ = 0;
  MatrixView A_{};
  MatrixBuffer A_memory_, newton_memory_;
  AlignedBuffer coefficients_memory_, row_memory_, zero_memory_, product_memory_, answer_memory_;
  std::vector<Column> columns_;
  std::vector<std::size_t> active_;
  DenseLu lu_;
  FreeSetFactor shifted_;
};

}  // namespace limber
