#include "row_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "game/row_kernels.cpp"
// Arrays of vectors, as in bundle_sweep_kernels.cpp.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, 8>;
using Wide = hn::Vec<Doubles>;
constexpr std::size_t kDoubles = hn::MaxLanes(Doubles()), kParts = 8 / kDoubles;
constexpr std::size_t kTogether = 3;  // rows in one pass: those of a ball joint

HWY_INLINE HWY_ATTR Wide Get(const Double8& from, std::size_t part) {
  return hn::Load(Doubles(), from.v + kDoubles * part);
}

/// A sum of products, block by block.
struct Sum {
  Wide part[kParts];
};

HWY_INLINE HWY_ATTR void Clear(Sum& sum) {
  for (Wide& part : sum.part) part = hn::Zero(Doubles());
}

HWY_INLINE HWY_ATTR void Add(const Double8& a, const Double8& b, Sum& sum) {
  for (std::size_t p = 0; p < kParts; ++p) sum.part[p] = hn::MulAdd(Get(a, p), Get(b, p), sum.part[p]);
}

template <class D>
HWY_INLINE HWY_ATTR double Fold(D, hn::Vec<D> x) {
  if constexpr (hn::MaxLanes(D()) == 1) {
    return hn::GetLane(x);
  } else {
    const hn::Half<D> half;
    return Fold(half, hn::Add(hn::LowerHalf(half, x), UpperHalf(half, x)));
  }
}

/// Of its eight numbers: halves onto each other, as long as there are any.
HWY_INLINE HWY_ATTR double Total(Sum& sum) {
  for (std::size_t half = kParts / 2; half > 0; half /= 2)
    for (std::size_t p = 0; p < half; ++p) sum.part[p] = hn::Add(sum.part[p], sum.part[p + half]);
  return Fold(Doubles(), sum.part[0]);
}

/// So many rows of a group times x.
template <std::size_t count>
HWY_INLINE HWY_ATTR void MultiplySome(const Double8* numbers, const GameGroup& group, std::size_t first,
                                      const Double8* x, double* product) {
  Sum sums[count];
  for (Sum& sum : sums) Clear(sum);
  for (const GameSide& side : group.sides) {
    if (side.frame < 0) continue;
    const auto blocks = static_cast<std::size_t>(side.blocks);
    const Double8 *row = numbers + side.at + first * blocks, *of_body = x + side.body;
    for (std::size_t b = 0; b < blocks; ++b)
      for (std::size_t i = 0; i < count; ++i) Add(row[i * blocks + b], of_body[b], sums[i]);
  }
  for (std::size_t i = 0; i < count; ++i) product[i] = Total(sums[i]);
}

HWY_ATTR void MultiplyRows(const RowArrays& J, const Double8* x, double* product) {
  for (const GameGroup* group = J.groups; group != J.groups + J.count; ++group) {
    std::size_t i = 0;
    for (; i + kTogether <= group->count; i += kTogether)
      MultiplySome<kTogether>(J.numbers, *group, i, x, product + group->first + i);
    for (; i < group->count; ++i) MultiplySome<1>(J.numbers, *group, i, x, product + group->first + i);
  }
}

/// @param next from row to row
template <std::size_t count>
HWY_INLINE HWY_ATTR void AddSome(const Double8* row, std::size_t next, const double* forces, const Double8& weight,
                                 Double8& y) {
  const Doubles d;
  for (std::size_t p = 0; p < kParts; ++p) {
    Wide sum = hn::Mul(hn::Set(d, forces[0]), Get(row[0], p));
    for (std::size_t i = 1; i < count; ++i) sum = hn::MulAdd(hn::Set(d, forces[i]), Get(row[i * next], p), sum);
    hn::Store(hn::MulAdd(Get(weight, p), sum, Get(y, p)), d, y.v + kDoubles * p);
  }
}

HWY_ATTR void AddAnswerOfRows(const RowArrays& J, const double* forces, Double8* y) {
  for (const GameGroup* group = J.groups; group != J.groups + J.count; ++group)
    for (const GameSide& side : group->sides) {
      if (side.frame < 0) continue;
      const auto blocks = static_cast<std::size_t>(side.blocks);
      for (std::size_t b = 0; b < blocks; ++b) {
        const Double8* row = J.numbers + side.at + b;
        const Double8& weight = b == 0 ? J.weights[side.frame] : kOnes;
        Double8& to = y[side.body + static_cast<std::int32_t>(b)];
        const double* force = forces + group->first;
        std::size_t i = 0;
        for (; i + kTogether <= group->count; i += kTogether, row += kTogether * blocks)
          AddSome<kTogether>(row, blocks, force + i, weight, to);
        for (; i < group->count; ++i, row += blocks) AddSome<1>(row, blocks, force + i, weight, to);
      }
    }
}

/// Two sides of rows on one body.
struct Meeting {
  const Double8 *a, *b, *weight;
  std::size_t blocks;
};

/// Some rows by some columns, part by part of their blocks. @param lower what is above the diagonal is left at 0
template <bool lower>
HWY_INLINE HWY_ATTR void MultiplySquare(const Meeting* begin, const Meeting* end, const std::size_t* rows,
                                        const std::size_t* columns, Sum (*sums)[kTogether]) {
  for (std::size_t p = 0; p < kParts; ++p) {
    Wide sum[kTogether][kTogether];
    for (auto& row : sum)
      for (Wide& x : row) x = hn::Zero(Doubles());
    for (const Meeting* at = begin; at != end; ++at)
      for (std::size_t b = 0; b < at->blocks; ++b) {
        const Wide weight = Get(b == 0 ? *at->weight : kOnes, p);
        Wide column[kTogether];
        for (std::size_t j = 0; j < kTogether; ++j) column[j] = Get(at->b[columns[j] * at->blocks + b], p);
        for (std::size_t i = 0; i < kTogether; ++i) {
          const Wide row = hn::Mul(weight, Get(at->a[rows[i] * at->blocks + b], p));
          for (std::size_t j = 0; j < (lower ? i + 1 : kTogether); ++j)
            sum[i][j] = hn::MulAdd(row, column[j], sum[i][j]);
        }
      }
    for (std::size_t i = 0; i < kTogether; ++i)
      for (std::size_t j = 0; j < kTogether; ++j) sums[i][j].part[p] = sum[i][j];
  }
}

/// Those from one on, the last again and again beyond their end.
HWY_INLINE HWY_ATTR void ListSome(const RowsOfGroup& of, std::size_t first, std::size_t* to) {
  for (std::size_t i = 0; i < kTogether; ++i)
    to[i] = static_cast<std::size_t>(of.rows[first + i < of.count ? first + i : of.count - 1]);
}

template <bool lower>
HWY_INLINE HWY_ATTR void MultiplySome(const Meeting* begin, const Meeting* end, const RowsOfGroup& rows,
                                      const RowsOfGroup& columns, std::size_t i, std::size_t j, double* to) {
  std::size_t some_rows[kTogether], some_columns[kTogether];
  ListSome(rows, i, some_rows);
  ListSome(columns, j, some_columns);
  Sum sums[kTogether][kTogether];
  MultiplySquare<lower>(begin, end, some_rows, some_columns, sums);
  for (std::size_t k = 0; k < kTogether && i + k < rows.count; ++k)
    for (std::size_t l = 0; l < (lower ? k + 1 : kTogether) && j + l < columns.count; ++l)
      to[(i + k) * columns.count + j + l] = Total(sums[k][l]);
}

HWY_ATTR void MultiplyPair(const RowArrays& J, const RowsOfGroup& rows, const RowsOfGroup& columns, double* to) {
  Meeting meetings[4];
  Meeting* end = meetings;
  for (const GameSide& a : rows.group->sides)
    for (const GameSide& b : columns.group->sides)
      if (a.frame >= 0 && a.frame == b.frame)
        *end++ = {J.numbers + a.at, J.numbers + b.at, J.weights + a.frame, static_cast<std::size_t>(a.blocks)};
  const bool lower = rows.group == columns.group;
  for (std::size_t i = 0; i < rows.count; i += kTogether)
    for (std::size_t j = 0; j < (lower ? i + 1 : columns.count); j += kTogether)
      if (lower && i == j)
        MultiplySome<true>(meetings, end, rows, columns, i, j, to);
      else
        MultiplySome<false>(meetings, end, rows, columns, i, j, to);
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(MultiplyRows);
HWY_EXPORT(AddAnswerOfRows);
HWY_EXPORT(MultiplyPair);

void multiply_rows(const RowArrays& J, const Double8* y, double* product) {
  HWY_DYNAMIC_DISPATCH(MultiplyRows)(J, y, product);
}

void add_answer_of_rows(const RowArrays& J, const double* forces, Double8* y) {
  HWY_DYNAMIC_DISPATCH(AddAnswerOfRows)(J, forces, y);
}

void multiply_pair(const RowArrays& J, const RowsOfGroup& rows, const RowsOfGroup& columns, double* to) {
  HWY_DYNAMIC_DISPATCH(MultiplyPair)(J, rows, columns, to);
}

}  // namespace limber::internal
#endif
