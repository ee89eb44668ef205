// A row-major matrix for the vector loops of the dense solvers: 64-byte aligned, lengths and strides multiples of kPad.
#pragma once

#include <cstddef>

namespace limber::internal {

inline constexpr std::size_t kPad = 8;  ///< doubles in 64 bytes

constexpr std::size_t padded(std::size_t n) { return (n + kPad - 1) / kPad * kPad; }

/// Rows are padded; what is behind the last number of each is read and written, so it must be finite.
struct MatrixView {
  double* values;
  std::size_t stride;
  double* row(std::size_t i) const { return values + i * stride; }
};

/// A few rows of a sparse matrix where they are not zero, in columns from `column` on: numbers from `values` on,
/// `stride` apart from row to row. Width and stride padded.
struct RowBlock {
  std::size_t rows = 0, column = 0, width = 0, values = 0, stride = 0;
};

/// Lᵀ K R, and where it goes (dense_kernels.h).
struct Congruence {
  RowBlock left{}, right{};
  const double* K = nullptr;                    ///< 3 × 3, symmetric
  std::size_t to = 0, stride = 0, columns = 0;  ///< columns of L that count
};

/// Numbers of one row that go to adjacent places in another; counts padded.
struct RowRun {
  std::size_t from = 0, to = 0, count = 0;
};

}  // namespace limber::internal
