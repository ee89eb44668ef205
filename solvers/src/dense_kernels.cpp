#include "dense_kernels.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "dense_kernels.cpp"
// Accumulators are arrays of vectors, which vectors of a length unknown to the compiler cannot form: those machines run
// the fixed 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, kPad>;
using Vector = hn::Vec<Doubles>;
constexpr std::size_t kLanes = hn::MaxLanes(Doubles());
constexpr std::size_t kVectors = kPad / kLanes;  // of one padded block

HWY_ATTR bool AllFinite(const double* x, std::size_t n) {
  const Doubles d;
  Vector sum = hn::Zero(d);
  std::size_t i = 0;
  for (; i + kLanes <= n; i += kLanes) sum = hn::MulAdd(hn::LoadU(d, x + i), hn::Zero(d), sum);  // ∞·0 is NaN
  double tail = 0.0;
  for (; i < n; ++i) tail += x[i] * 0.0;
  return hn::AllTrue(d, hn::Eq(sum, hn::Zero(d))) && tail == 0.0;
}

// Eight partial sums, added in one order whatever the vector's length.
HWY_INLINE HWY_ATTR double SumOfBlock(const Vector* parts) {
  const Doubles d;
  HWY_ALIGN double p[kPad];
  for (std::size_t v = 0; v < kVectors; ++v) hn::Store(parts[v], d, p + v * kLanes);
  return ((p[0] + p[4]) + (p[2] + p[6])) + ((p[1] + p[5]) + (p[3] + p[7]));
}

HWY_ATTR double Dot(const double* x, const double* y, std::size_t n) {
  const Doubles d;
  Vector sum[kVectors];
  for (std::size_t v = 0; v < kVectors; ++v) sum[v] = hn::Zero(d);
  for (std::size_t i = 0; i < n; i += kPad)
    for (std::size_t v = 0; v < kVectors; ++v)
      sum[v] = hn::MulAdd(hn::Load(d, x + i + v * kLanes), hn::Load(d, y + i + v * kLanes), sum[v]);
  return SumOfBlock(sum);
}

HWY_ATTR void AddScaled(double* HWY_RESTRICT y, double a, const double* HWY_RESTRICT x, std::size_t n) {
  const Doubles d;
  const Vector va = hn::Set(d, a);
  for (std::size_t i = 0; i < n; i += kLanes)
    hn::Store(hn::MulAdd(va, hn::Load(d, x + i), hn::Load(d, y + i)), d, y + i);
}

// kBlocks·kPad columns of combine_rows(), in registers.
template <std::size_t kBlocks>
HWY_INLINE HWY_ATTR void CombineColumns(double* out, const double* init, MatrixView M, const int* rows,
                                        const double* coefficients, std::size_t count, std::size_t column) {
  const Doubles d;
  constexpr std::size_t kCount = kBlocks * kVectors;
  Vector sum[kCount];
  for (std::size_t v = 0; v < kCount; ++v)
    sum[v] = init == nullptr ? hn::Zero(d) : hn::Load(d, init + column + v * kLanes);
  for (std::size_t i = 0; i < count; ++i) {
    const double* row = M.row(rows ? static_cast<std::size_t>(rows[i]) : i) + column;
    const Vector a = hn::Set(d, coefficients[i]);
    for (std::size_t v = 0; v < kCount; ++v) sum[v] = hn::MulAdd(a, hn::Load(d, row + v * kLanes), sum[v]);
  }
  for (std::size_t v = 0; v < kCount; ++v) hn::Store(sum[v], d, out + column + v * kLanes);
}

// Columns at a time: the accumulators hide the latency of the multiply-adds and fit the registers.
constexpr std::size_t kWide = kVectors == 1 ? 8 : 4;

HWY_ATTR void CombineRows(double* out, const double* init, MatrixView M, const int* rows, const double* coefficients,
                          std::size_t count, std::size_t n) {
  std::size_t column = 0;
  for (; column + kWide * kPad <= n; column += kWide * kPad)
    CombineColumns<kWide>(out, init, M, rows, coefficients, count, column);
  for (; column + 2 * kPad <= n; column += 2 * kPad) CombineColumns<2>(out, init, M, rows, coefficients, count, column);
  if (column < n) CombineColumns<1>(out, init, M, rows, coefficients, count, column);
}

HWY_ATTR void Rotate(double* x, double* y, double c, double s, std::size_t n) {
  const Doubles d;
  const Vector vc = hn::Set(d, c), vs = hn::Set(d, s);
  for (std::size_t i = 0; i < n; i += kLanes) {
    const Vector a = hn::Load(d, x + i), b = hn::Load(d, y + i);
    hn::Store(hn::MulAdd(vc, a, hn::Mul(vs, b)), d, x + i);
    hn::Store(hn::NegMulAdd(vs, a, hn::Mul(vc, b)), d, y + i);
  }
}

// Rows [i, i + kRows) of C in blocks of two padded columns.
template <std::size_t kRows, std::size_t kBlocks>
HWY_INLINE HWY_ATTR void GramBlock(MatrixView C, MatrixView X, std::size_t rows, std::size_t i, std::size_t column) {
  const Doubles d;
  constexpr std::size_t kCount = kBlocks * kVectors;
  Vector sum[kRows][kCount];
  for (std::size_t r = 0; r < kRows; ++r)
    for (std::size_t v = 0; v < kCount; ++v) sum[r][v] = hn::Zero(d);
  for (std::size_t k = 0; k < rows; ++k) {
    const double* x = X.row(k);
    Vector row[kCount];
    for (std::size_t v = 0; v < kCount; ++v) row[v] = hn::Load(d, x + column + v * kLanes);
    for (std::size_t r = 0; r < kRows; ++r) {
      const Vector a = hn::Set(d, x[i + r]);
      for (std::size_t v = 0; v < kCount; ++v) sum[r][v] = hn::MulAdd(a, row[v], sum[r][v]);
    }
  }
  for (std::size_t r = 0; r < kRows; ++r)
    for (std::size_t v = 0; v < kCount; ++v) hn::Store(sum[r][v], d, C.row(i + r) + column + v * kLanes);
}

// Rows of C at a time: with AVX-512 8 × 2 accumulators, else what sixteen registers hold.
constexpr std::size_t kGramRows = kVectors == 1 ? 8 : kVectors == 2 ? 4 : 2;
constexpr std::size_t kGramBlocks = kVectors == 1 ? 2 : 1;

HWY_ATTR void Gram(MatrixView C, MatrixView X, std::size_t rows, std::size_t n) {
  const std::size_t width = padded(n);
  std::size_t i = 0;
  for (; i + kGramRows <= n; i += kGramRows) {
    std::size_t column = i / kPad * kPad;  // on and above the diagonal
    for (; column + kGramBlocks * kPad <= width; column += kGramBlocks * kPad)
      GramBlock<kGramRows, kGramBlocks>(C, X, rows, i, column);
    if (column < width) GramBlock<kGramRows, 1>(C, X, rows, i, column);
  }
  for (; i < n; ++i)
    for (std::size_t column = i / kPad * kPad; column < width; column += kPad) GramBlock<1, 1>(C, X, rows, i, column);
  for (std::size_t r = 1; r < n; ++r)
    for (std::size_t c = 0; c < r; ++c) C.row(r)[c] = C.row(c)[r];
}

template <std::size_t kRows>
HWY_INLINE HWY_ATTR void MultiplyBlock(double* out, MatrixView M, const int* rows, const double* x, std::size_t i,
                                       std::size_t n) {
  const Doubles d;
  const double* row[kRows];
  for (std::size_t r = 0; r < kRows; ++r) row[r] = M.row(rows ? static_cast<std::size_t>(rows[i + r]) : i + r);
  Vector sum[kRows][kVectors];
  for (std::size_t r = 0; r < kRows; ++r)
    for (std::size_t v = 0; v < kVectors; ++v) sum[r][v] = hn::Zero(d);
  for (std::size_t j = 0; j < n; j += kPad)
    for (std::size_t v = 0; v < kVectors; ++v) {
      const Vector a = hn::Load(d, x + j + v * kLanes);
      for (std::size_t r = 0; r < kRows; ++r)
        sum[r][v] = hn::MulAdd(a, hn::Load(d, row[r] + j + v * kLanes), sum[r][v]);
    }
  for (std::size_t r = 0; r < kRows; ++r) out[i + r] = SumOfBlock(sum[r]);
}

HWY_ATTR void MultiplyRows(double* out, MatrixView M, const int* rows, const double* x, std::size_t count,
                           std::size_t n) {
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) MultiplyBlock<4>(out, M, rows, x, i, n);
  for (; i < count; ++i) MultiplyBlock<1>(out, M, rows, x, i, n);
}

HWY_ATTR void AddCongruences(double* C, double* J, const Congruence* all, std::size_t count) {
  const Doubles d;
  for (const Congruence* c = all; c != all + count; ++c) {
    const MatrixView to{C + c->to, c->stride}, L{J + c->left.values, c->left.stride},
        R{J + c->right.values, c->right.stride};
    const std::size_t rows = c->left.rows;
    const double* K = c->K;
    for (std::size_t j = 0; j < c->right.width; j += kLanes) {
      Vector right[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)}, weighted[3];
      for (std::size_t r = 0; r < rows; ++r) right[r] = hn::Load(d, R.row(r) + j);
      for (std::size_t r = 0; r < 3; ++r)
        weighted[r] =
            hn::MulAdd(hn::Set(d, K[3 * r]), right[0],
                       hn::MulAdd(hn::Set(d, K[3 * r + 1]), right[1], hn::Mul(hn::Set(d, K[3 * r + 2]), right[2])));
      for (std::size_t i = 0; i < c->columns; ++i) {
        Vector sum = hn::Load(d, to.row(i) + j);
        for (std::size_t r = 0; r < rows; ++r) sum = hn::MulAdd(hn::Set(d, L.row(r)[i]), weighted[r], sum);
        hn::Store(sum, d, to.row(i) + j);
      }
    }
  }
}

HWY_ATTR void MultiplyEach(double* out, const RowBlock* blocks, std::size_t count, const double* J, const double* x) {
  const Doubles d;
  for (const RowBlock* b = blocks; b != blocks + count; ++b, out += kRowsOfEach) {
    Vector sum[kRowsOfEach][kVectors];
    for (std::size_t r = 0; r < kRowsOfEach; ++r)
      for (std::size_t v = 0; v < kVectors; ++v) sum[r][v] = hn::Zero(d);
    for (std::size_t j = 0; j < b->width; j += kPad)
      for (std::size_t v = 0; v < kVectors; ++v) {
        const Vector from = hn::Load(d, x + b->column + j + v * kLanes);
        for (std::size_t r = 0; r < b->rows; ++r)
          sum[r][v] = hn::MulAdd(from, hn::Load(d, J + b->values + r * b->stride + j + v * kLanes), sum[r][v]);
      }
    for (std::size_t r = 0; r < kRowsOfEach; ++r) out[r] = SumOfBlock(sum[r]);
  }
}

HWY_ATTR void AddTransposed(double* x, const RowBlock* blocks, std::size_t count, const double* J, const double* y,
                            std::size_t stride) {
  const Doubles d;
  for (const RowBlock* b = blocks; b != blocks + count; ++b, y += stride)
    for (std::size_t j = 0; j < b->width; j += kLanes) {
      Vector sum = hn::Load(d, x + b->column + j);
      for (std::size_t r = 0; r < b->rows; ++r)
        sum = hn::MulAdd(hn::Set(d, y[r]), hn::Load(d, J + b->values + r * b->stride + j), sum);
      hn::Store(sum, d, x + b->column + j);
    }
}

HWY_ATTR bool InvertPositive(MatrixView A, std::size_t n) {
  const Doubles d;
  const std::size_t columns = padded(n);
  for (std::size_t k = 0; k < n; ++k) {
    double* row = A.row(k);
    if (!(row[k] > 0.0) || !(row[k] < 1e300)) return false;
    // Column k is masked: a vector that is read right after one of its numbers was written waits for it.
    const Vector pivot = hn::Set(d, 1.0 / row[k]), at = hn::Set(d, static_cast<double>(k));
    for (std::size_t j = 0; j < columns; j += kLanes) {
      const auto own = hn::Eq(hn::Iota(d, static_cast<double>(j)), at);
      hn::Store(hn::IfThenElse(own, pivot, hn::Mul(pivot, hn::Load(d, row + j))), d, row + j);
    }
    for (std::size_t i = 0; i < n; ++i) {
      if (i == k) continue;
      double* other = A.row(i);
      const Vector part = hn::Set(d, other[k]);
      for (std::size_t j = 0; j < columns; j += kLanes) {
        const auto own = hn::Eq(hn::Iota(d, static_cast<double>(j)), at);
        const Vector rest = hn::IfThenZeroElse(own, hn::Load(d, other + j));
        hn::Store(hn::NegMulAdd(part, hn::Load(d, row + j), rest), d, other + j);
      }
    }
  }
  return true;
}

HWY_ATTR void MultiplyBlocks(MatrixView out, MatrixView A, MatrixView X, std::size_t n, std::size_t columns) {
  const Doubles d;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < columns; j += kPad) {
      Vector sum[kVectors];
      for (std::size_t v = 0; v < kVectors; ++v) sum[v] = hn::Zero(d);
      for (std::size_t k = 0; k < n; ++k) {
        const Vector a = hn::Set(d, A.row(i)[k]);
        for (std::size_t v = 0; v < kVectors; ++v)
          sum[v] = hn::MulAdd(a, hn::Load(d, X.row(k) + j + v * kLanes), sum[v]);
      }
      for (std::size_t v = 0; v < kVectors; ++v) hn::Store(sum[v], d, out.row(i) + j + v * kLanes);
    }
}

// Rows [r, r + kRows) of subtract_runs(), each padded block of columns in registers.
template <std::size_t kRows>
HWY_INLINE HWY_ATTR void SubtractRun(MatrixView to, const double* left, MatrixView W, std::size_t r, std::size_t n,
                                     const RowRun& run) {
  const Doubles d;
  for (std::size_t j = 0; j < run.count; j += kPad) {
    Vector sum[kRows][kVectors];
    for (std::size_t k = 0; k < kRows; ++k)
      for (std::size_t v = 0; v < kVectors; ++v) sum[k][v] = hn::Load(d, to.row(r + k) + run.to + j + v * kLanes);
    for (std::size_t q = 0; q < n; ++q) {
      Vector row[kVectors];
      for (std::size_t v = 0; v < kVectors; ++v) row[v] = hn::Load(d, W.row(q) + run.from + j + v * kLanes);
      for (std::size_t k = 0; k < kRows; ++k) {
        const Vector a = hn::Set(d, left[q * W.stride + r + k]);
        for (std::size_t v = 0; v < kVectors; ++v) sum[k][v] = hn::NegMulAdd(a, row[v], sum[k][v]);
      }
    }
    for (std::size_t k = 0; k < kRows; ++k)
      for (std::size_t v = 0; v < kVectors; ++v) hn::Store(sum[k][v], d, to.row(r + k) + run.to + j + v * kLanes);
  }
}

// Rows at a time: their sums hide the latency of the multiply-adds and, two registers each, fit sixteen.
constexpr std::size_t kRunRows = kVectors <= 2 ? 6 : 3;

HWY_ATTR void SubtractRuns(MatrixView to, const double* left, MatrixView W, std::size_t rows, std::size_t n,
                           const RowRun* runs, std::size_t count) {
  for (const RowRun* run = runs; run != runs + count; ++run) {
    std::size_t r = 0;
    for (; r + kRunRows <= rows; r += kRunRows) SubtractRun<kRunRows>(to, left, W, r, n, *run);
    for (; r < rows; ++r) SubtractRun<1>(to, left, W, r, n, *run);
  }
}

// Rows [r, r + kRows) of spread_blocks(): their sums stay in registers over all blocks.
template <std::size_t kRows>
HWY_INLINE HWY_ATTR void SpreadRows(double* y, const RowBlock* blocks, std::size_t count, const double* G,
                                    const double* x, std::size_t r) {
  const Doubles d;
  Vector sum[kRows][kVectors];
  for (std::size_t k = 0; k < kRows; ++k)
    for (std::size_t v = 0; v < kVectors; ++v) sum[k][v] = hn::Zero(d);
  for (const RowBlock* b = blocks; b != blocks + count; ++b) {
    const double* row = G + b->values + r * b->stride;
    for (std::size_t j = 0; j < b->width; j += kPad)
      for (std::size_t v = 0; v < kVectors; ++v) {
        const Vector from = hn::Load(d, x + b->column + j + v * kLanes);
        for (std::size_t k = 0; k < kRows; ++k)
          sum[k][v] = hn::MulAdd(from, hn::Load(d, row + k * b->stride + j + v * kLanes), sum[k][v]);
      }
  }
  for (std::size_t k = 0; k < kRows; ++k) y[r + k] += SumOfBlock(sum[k]);
}

HWY_ATTR void SpreadBlocks(double* y, const RowBlock* blocks, std::size_t count, const double* G, const double* x) {
  const std::size_t rows = count == 0 ? 0 : blocks->rows;
  std::size_t r = 0;
  for (; r + kRunRows <= rows; r += kRunRows) SpreadRows<kRunRows>(y, blocks, count, G, x, r);
  for (; r < rows; ++r) SpreadRows<1>(y, blocks, count, G, x, r);
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(AllFinite);
HWY_EXPORT(Dot);
HWY_EXPORT(AddScaled);
HWY_EXPORT(CombineRows);
HWY_EXPORT(Rotate);
HWY_EXPORT(Gram);
HWY_EXPORT(MultiplyRows);
HWY_EXPORT(AddCongruences);
HWY_EXPORT(MultiplyEach);
HWY_EXPORT(AddTransposed);
HWY_EXPORT(InvertPositive);
HWY_EXPORT(MultiplyBlocks);
HWY_EXPORT(SubtractRuns);
HWY_EXPORT(SpreadBlocks);

bool all_finite(const double* x, std::size_t n) { return HWY_DYNAMIC_DISPATCH(AllFinite)(x, n); }

double dot(const double* x, const double* y, std::size_t n) { return HWY_DYNAMIC_DISPATCH(Dot)(x, y, padded(n)); }

void add_scaled(double* y, double a, const double* x, std::size_t n) {
  HWY_DYNAMIC_DISPATCH(AddScaled)(y, a, x, padded(n));
}

void combine_rows(double* out, const double* init, MatrixView M, const int* rows, const double* coefficients,
                  std::size_t count, std::size_t n) {
  HWY_DYNAMIC_DISPATCH(CombineRows)(out, init, M, rows, coefficients, count, padded(n));
}

void rotate(double* x, double* y, double c, double s, std::size_t n) {
  HWY_DYNAMIC_DISPATCH(Rotate)(x, y, c, s, padded(n));
}

void gram(MatrixView C, MatrixView X, std::size_t rows, std::size_t n) { HWY_DYNAMIC_DISPATCH(Gram)(C, X, rows, n); }

void multiply_rows(double* out, MatrixView M, const int* rows, const double* x, std::size_t count, std::size_t n) {
  HWY_DYNAMIC_DISPATCH(MultiplyRows)(out, M, rows, x, count, padded(n));
}

void add_congruences(double* C, double* J, const Congruence* all, std::size_t count) {
  HWY_DYNAMIC_DISPATCH(AddCongruences)(C, J, all, count);
}

void multiply_each(double* out, const RowBlock* blocks, std::size_t count, const double* J, const double* x) {
  HWY_DYNAMIC_DISPATCH(MultiplyEach)(out, blocks, count, J, x);
}

void add_each(double* x, const RowBlock* blocks, std::size_t count, const double* J, const double* y) {
  HWY_DYNAMIC_DISPATCH(AddTransposed)(x, blocks, count, J, y, kRowsOfEach);
}

bool invert_positive(MatrixView A, std::size_t n) { return HWY_DYNAMIC_DISPATCH(InvertPositive)(A, n); }

void multiply_block(MatrixView out, MatrixView A, MatrixView X, std::size_t n, std::size_t columns) {
  HWY_DYNAMIC_DISPATCH(MultiplyBlocks)(out, A, X, n, columns);
}

void subtract_runs(MatrixView to, const double* left, MatrixView W, std::size_t rows, std::size_t n, const RowRun* runs,
                   std::size_t count) {
  HWY_DYNAMIC_DISPATCH(SubtractRuns)(to, left, W, rows, n, runs, count);
}

void gather_blocks(double* x, const RowBlock* blocks, std::size_t count, const double* G, const double* y) {
  HWY_DYNAMIC_DISPATCH(AddTransposed)(x, blocks, count, G, y, 0);
}

void spread_blocks(double* y, const RowBlock* blocks, std::size_t count, const double* G, const double* x) {
  HWY_DYNAMIC_DISPATCH(SpreadBlocks)(y, blocks, count, G, x);
}

void transpose(MatrixView T, MatrixView M, std::size_t rows, std::size_t n) {
  for (std::size_t j = 0; j < n; ++j) std::fill(T.row(j) + rows, T.row(j) + T.stride, 0.0);
  for (std::size_t block = 0; block < n; block += kPad)  // a line of each row of M at a time
    for (std::size_t i = 0; i < rows; ++i)
      for (std::size_t j = block; j < std::min(block + kPad, n); ++j) T.row(j)[i] = M.row(i)[j];
}

}  // namespace limber::internal
#endif  // HWY_ONCE
