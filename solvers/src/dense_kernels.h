// The vector loops of the dense solvers. Raw pointers only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
//
// Arrays are 64-byte aligned and lengths and strides multiples of kPad (aligned_buffer.h): no loop has a tail. What is
// behind the last number is read and written, so it must be finite. Every result is the same bits on every instruction
// set that has fused multiply-add: sums run over rows in order, and dot products over eight partial sums.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "limber/solvers/matrix_view.h"

namespace limber::internal {

/// Whether x[0 … n) holds neither an infinity nor a NaN. x may have any alignment, n any value.
bool all_finite(const double* x, std::size_t n);

/// The power of two next below 1/x; 1 for x = 0. @pre x ≥ 0, finite
inline double inverse_power_of_two(double x) {
  if (x == 0.0) return 1.0;
  const std::uint64_t exponent = std::bit_cast<std::uint64_t>(x) >> 52;
  return std::bit_cast<double>(std::max<std::uint64_t>(2046 - exponent, 1) << 52);
}

double dot(const double* x, const double* y, std::size_t n);

/// y += a x
void add_scaled(double* y, double a, const double* x, std::size_t n);

/// out = init + Σ_i coefficients[i]·M.row(rows[i]) over n columns. `rows` null: 0, 1, …; `init` null: 0;
/// out may be init.
void combine_rows(double* out, const double* init, MatrixView M, const int* rows, const double* coefficients,
                  std::size_t count, std::size_t n);

/// For each: C += Lᵀ K R at C + to, `stride` from row to row; L and R blocks of J, of at most 3 rows.
void add_congruences(double* C, double* J, const Congruence* all, std::size_t count);

/// Numbers that multiply_each() and add_each() have for each block.
inline constexpr std::size_t kRowsOfEach = 3;
/// out = J x for each block of at most 3 rows, 3 numbers each: 0 where there are fewer rows.
void multiply_each(double* out, const RowBlock* blocks, std::size_t count, const double* J, const double* x);
/// x += Jᵀ y for each, block after block.
void add_each(double* x, const RowBlock* blocks, std::size_t count, const double* J, const double* y);

/// A ← A⁻¹, n × n, symmetric and positive definite: Gauss–Jordan without exchanges. @return false where a pivot is not
/// positive
bool invert_positive(MatrixView A, std::size_t n);

/// Out = A X: n × n and n rows of `columns` numbers, padded.
void multiply_block(MatrixView out, MatrixView A, MatrixView X, std::size_t n, std::size_t columns);

/// To −= Lᵀ W, run after run: `rows` columns of L from `left` on, n rows of L and W.
void subtract_runs(MatrixView to, const double* left, MatrixView W, std::size_t rows, std::size_t n, const RowRun* runs,
                   std::size_t count);

/// x += Gᵀ y, block after block; all blocks are of the same rows.
void gather_blocks(double* x, const RowBlock* blocks, std::size_t count, const double* G, const double* y);

/// y += G x over blocks of the same rows.
void spread_blocks(double* y, const RowBlock* blocks, std::size_t count, const double* G, const double* x);

/// (x, y) ← (c x + s y, c y − s x)
void rotate(double* x, double* y, double c, double s, std::size_t n);

/// C = XᵀX for the `rows` rows of X, n columns. All of C is written.
void gram(MatrixView C, MatrixView X, std::size_t rows, std::size_t n);

/// out[i] = M.row(rows[i])·x over n columns. `rows` null: 0, 1, …
void multiply_rows(double* out, MatrixView M, const int* rows, const double* x, std::size_t count, std::size_t n);

/// T = Mᵀ for `rows` × n numbers of M, with zeros in the padding of T.
void transpose(MatrixView T, MatrixView M, std::size_t rows, std::size_t n);

}  // namespace limber::internal
