#include "oscillator_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "oscillator_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kStride = kBlockModes * kBlockCoefficients;

// Every product is an explicit MulAdd in a fixed order, so that all instruction sets with FMA round alike.
HWY_ATTR void AdvanceBlocks(const double* HWY_RESTRICT c, std::size_t blocks, double* HWY_RESTRICT z,
                            double* HWY_RESTRICT v, const double* HWY_RESTRICT g) {
  const hn::CappedTag<double, kBlockModes> d;
  for (std::size_t b = 0; b < blocks; ++b, c += kStride, z += kBlockModes, v += kBlockModes, g += kBlockModes) {
    for (std::size_t i = 0; i < kBlockModes; i += hn::Lanes(d)) {
      const auto z0 = hn::Load(d, z + i), v0 = hn::Load(d, v + i), g0 = hn::Load(d, g + i);
      const auto S = hn::Load(d, c + kZv * kBlockModes + i);
      const auto z_g = hn::Mul(hn::Load(d, c + kZg * kBlockModes + i), g0);
      const auto z_vg = hn::MulAdd(S, v0, z_g);
      const auto v_vg = hn::MulAdd(hn::Load(d, c + kVv * kBlockModes + i), v0, hn::Mul(S, g0));
      hn::Store(hn::MulAdd(hn::Load(d, c + kZz * kBlockModes + i), z0, z_vg), d, z + i);
      hn::Store(hn::MulAdd(hn::Load(d, c + kVz * kBlockModes + i), z0, v_vg), d, v + i);
    }
  }
}

HWY_ATTR void AdvanceBlocksFree(const double* HWY_RESTRICT c, std::size_t blocks, double* HWY_RESTRICT z,
                                double* HWY_RESTRICT v) {
  const hn::CappedTag<double, kBlockModes> d;
  for (std::size_t b = 0; b < blocks; ++b, c += kStride, z += kBlockModes, v += kBlockModes) {
    for (std::size_t i = 0; i < kBlockModes; i += hn::Lanes(d)) {
      const auto z0 = hn::Load(d, z + i), v0 = hn::Load(d, v + i);
      const auto z_v = hn::Mul(hn::Load(d, c + kZv * kBlockModes + i), v0);
      const auto v_v = hn::Mul(hn::Load(d, c + kVv * kBlockModes + i), v0);
      hn::Store(hn::MulAdd(hn::Load(d, c + kZz * kBlockModes + i), z0, z_v), d, z + i);
      hn::Store(hn::MulAdd(hn::Load(d, c + kVz * kBlockModes + i), z0, v_v), d, v + i);
    }
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(AdvanceBlocks);
HWY_EXPORT(AdvanceBlocksFree);

void advance_blocks(const double* coefficients, std::size_t blocks, double* z, double* v, const double* g) {
  HWY_DYNAMIC_DISPATCH(AdvanceBlocks)(coefficients, blocks, z, v, g);
}

void advance_blocks_free(const double* coefficients, std::size_t blocks, double* z, double* v) {
  HWY_DYNAMIC_DISPATCH(AdvanceBlocksFree)(coefficients, blocks, z, v);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
