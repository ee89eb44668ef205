#include "skin_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "skin_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Rows are taken eight numbers at a time, then four, then one by one; each number gets the same operations whatever the
// vectors' width, so the sums do not depend on the instruction set.
constexpr std::size_t kWide = 8;

template <class D>
HWY_INLINE HWY_ATTR hn::Vec<D> Promoted(D d, const float* from) {
  return hn::PromoteTo(d, hn::LoadU(hn::Rebind<float, D>(), from));
}
template <class D>
HWY_INLINE HWY_ATTR hn::Vec<D> Promoted(D d, const double* from) {
  return hn::LoadU(d, from);
}

// Calls step(tag, place) for vectors that cover count numbers from `first` on, a multiple of their length.
template <std::size_t Count, class Step>
HWY_INLINE HWY_ATTR void Cover(std::size_t first, const Step& step) {
  const hn::CappedTag<double, Count> d;
  for (std::size_t i = 0; i < Count; i += hn::MaxLanes(d)) step(d, first + i);
}
template <class Step>
HWY_INLINE HWY_ATTR void CoverRow(std::size_t k, const Step& step) {
  std::size_t i = 0;
  for (; i + kWide <= k; i += kWide) Cover<kWide>(i, step);
  if (i + kWide / 2 <= k) Cover<kWide / 2>(i, step), i += kWide / 2;
  for (; i < k; ++i) Cover<1>(i, step);
}

HWY_ATTR void RowsTimes(const float* rows, std::size_t count, std::size_t k, const double* z, double* products) {
  for (std::size_t r = 0; r < count; ++r, rows += k) {
    HWY_ALIGN double s[kWide] = {};
    CoverRow(k, [&](auto d, std::size_t i) HWY_ATTR {
      double* sum = s + i % kWide;
      hn::StoreU(hn::MulAdd(Promoted(d, rows + i), hn::LoadU(d, z + i), hn::LoadU(d, sum)), d, sum);
    });
    products[r] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
  }
}

template <std::size_t Rows, class T>
HWY_INLINE HWY_ATTR void AddRows(const double* A, const T* in, std::size_t k, double* out) {
  CoverRow(k, [&](auto d, std::size_t i) HWY_ATTR {
    const auto x = Promoted(d, in + i), y = Promoted(d, in + k + i), z = Promoted(d, in + 2 * k + i);
    for (std::size_t r = 0; r < Rows; ++r) {
      double* to = out + r * k + i;
      const auto sum = hn::MulAdd(hn::Set(d, A[3 * r + 2]), z, hn::LoadU(d, to));
      hn::StoreU(hn::MulAdd(hn::Set(d, A[3 * r]), x, hn::MulAdd(hn::Set(d, A[3 * r + 1]), y, sum)), d, to);
    }
  });
}

HWY_ATTR void AddProductF(const double* A, const float* in, std::size_t k, double* out) { AddRows<3>(A, in, k, out); }
HWY_ATTR void AddProductD(const double* A, const double* in, std::size_t k, double* out) { AddRows<3>(A, in, k, out); }
HWY_ATTR void AddRowF(const double* v, const float* in, std::size_t k, double* out) { AddRows<1>(v, in, k, out); }
HWY_ATTR void AddRowD(const double* v, const double* in, std::size_t k, double* out) { AddRows<1>(v, in, k, out); }

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(RowsTimes);
HWY_EXPORT(AddProductF);
HWY_EXPORT(AddProductD);
HWY_EXPORT(AddRowF);
HWY_EXPORT(AddRowD);

void rows_times(const float* rows, std::size_t count, std::size_t k, const double* z, double* products) {
  HWY_DYNAMIC_DISPATCH(RowsTimes)(rows, count, k, z, products);
}
void add_product(const double* A, const float* in, std::size_t k, double* out) {
  HWY_DYNAMIC_DISPATCH(AddProductF)(A, in, k, out);
}
void add_product(const double* A, const double* in, std::size_t k, double* out) {
  HWY_DYNAMIC_DISPATCH(AddProductD)(A, in, k, out);
}
void add_row(const double* v, const float* in, std::size_t k, double* out) {
  HWY_DYNAMIC_DISPATCH(AddRowF)(v, in, k, out);
}
void add_row(const double* v, const double* in, std::size_t k, double* out) {
  HWY_DYNAMIC_DISPATCH(AddRowD)(v, in, k, out);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
