#include "surface_point_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "surface_point_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Eight modes at a time, in as many vectors as it takes: the sums do not depend on the instruction set.
constexpr std::size_t kModes = 8;
using Doubles = hn::CappedTag<double, kModes>;
using Floats = hn::Rebind<float, Doubles>;
constexpr std::size_t kLanes = hn::MaxLanes(Doubles());

// Rows have zeros behind their last mode, z and g have not.
HWY_INLINE HWY_ATTR void Copy(const double* from, std::size_t count, double* to) {
  for (std::size_t i = 0; i < count; ++i) to[i] = from[i];
}

HWY_INLINE HWY_ATTR void AddEight(const SurfaceRows& rows, std::size_t first, double* g) {
  const Doubles d;
  for (std::size_t i = 0; i < kModes; i += kLanes) {
    auto sum = hn::LoadU(d, g + i);
    for (std::size_t r = 0; r < rows.count; ++r)
      sum = hn::MulAdd(hn::Set(d, rows.weight[r]), hn::PromoteTo(d, hn::Load(Floats(), rows.row[r] + first + i)), sum);
    hn::StoreU(sum, d, g + i);
  }
}

HWY_ATTR void AddRows(const SurfaceRows& rows, std::size_t modes, double* g) {
  std::size_t i = 0;
  for (; i + kModes <= modes; i += kModes) AddEight(rows, i, g + i);
  if (i == modes) return;
  double buffer[kModes] = {};
  Copy(g + i, modes - i, buffer);
  AddEight(rows, i, buffer);
  Copy(buffer, modes - i, g + i);
}

HWY_INLINE HWY_ATTR void TimesEight(const SurfaceRows& rows, std::size_t first, const double* z,
                                    double (*sums)[kModes]) {
  const Doubles d;
  for (std::size_t i = 0; i < kModes; i += kLanes) {
    const auto amplitude = hn::LoadU(d, z + i);
    for (std::size_t r = 0; r < rows.count; ++r) {
      const auto u = hn::Mul(hn::Set(d, rows.weight[r]), hn::PromoteTo(d, hn::Load(Floats(), rows.row[r] + first + i)));
      double* sum = sums[r % 3] + i;
      hn::StoreU(hn::MulAdd(u, amplitude, hn::LoadU(d, sum)), d, sum);
    }
  }
}

HWY_ATTR void RowsTimes(const SurfaceRows& rows, std::size_t modes, const double* z, double* u) {
  double sums[3][kModes] = {};
  std::size_t i = 0;
  for (; i + kModes <= modes; i += kModes) TimesEight(rows, i, z + i, sums);
  if (i < modes) {
    double buffer[kModes] = {};
    Copy(z + i, modes - i, buffer);
    TimesEight(rows, i, buffer, sums);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double* s = sums[axis];
    u[axis] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(AddRows);
HWY_EXPORT(RowsTimes);

void add_rows(const SurfaceRows& rows, std::size_t modes, double* g) { HWY_DYNAMIC_DISPATCH(AddRows)(rows, modes, g); }

void rows_times(const SurfaceRows& rows, std::size_t modes, const double* z, double* u) {
  HWY_DYNAMIC_DISPATCH(RowsTimes)(rows, modes, z, u);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
