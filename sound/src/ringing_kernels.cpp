#include "ringing_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "ringing_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lane = hn::CappedTag<double, kRingingGroup>;
using Vector = hn::Vec<Lane>;

/// One vector of modes: fade·p and the address of z.
struct Column {
  Vector p_re, p_im, re, im;
  double* z;
};

HWY_ATTR HWY_INLINE Column LoadColumn(const double* p, double* z, double fade) {
  const Lane d;
  const auto f = hn::Set(d, fade);
  return {hn::Mul(f, hn::Load(d, p)), hn::Mul(f, hn::Load(d, p + kRingingGroup)), hn::Load(d, z),
          hn::Load(d, z + kRingingGroup), z};
}

// Products are explicit MulAdds in a fixed order, so that all instruction sets with FMA round alike.
HWY_ATTR HWY_INLINE void Turn(Column& c) {
  const auto re = hn::NegMulAdd(c.p_im, c.im, hn::Mul(c.p_re, c.re));
  c.im = hn::MulAdd(c.p_im, c.re, hn::Mul(c.p_re, c.im));
  c.re = re;
}

HWY_ATTR HWY_INLINE void StoreColumn(const Column& c) {
  const Lane d;
  hn::Store(c.re, d, c.z);
  hn::Store(c.im, d, c.z + kRingingGroup);
}

/// Three groups side by side: a product of complex numbers waits for the one before, and the others fill the time.
HWY_ATTR void Ring(const double* HWY_RESTRICT p, double* HWY_RESTRICT z, const std::int32_t* HWY_RESTRICT active,
                   std::size_t count, double fade, std::size_t samples, double* HWY_RESTRICT lanes) {
  const Lane d;
  for (std::size_t i = 0; i < kRingingGroup; i += hn::Lanes(d)) {
    const auto column = [&](std::size_t g) HWY_ATTR {
      const std::size_t at = static_cast<std::size_t>(active[g]) * 2 * kRingingGroup + i;
      return LoadColumn(p + at, z + at, fade);
    };
    std::size_t g = 0;
    for (; g + 3 <= count; g += 3) {
      Column a = column(g), b = column(g + 1), c = column(g + 2);
      double* out = lanes + i;
      for (std::size_t n = 0; n < samples; ++n, out += kRingingGroup) {
        hn::Store(hn::Add(hn::Add(hn::Add(hn::Load(d, out), a.re), b.re), c.re), d, out);
        Turn(a), Turn(b), Turn(c);
      }
      StoreColumn(a), StoreColumn(b), StoreColumn(c);
    }
    for (; g < count; ++g) {
      Column a = column(g);
      double* out = lanes + i;
      for (std::size_t n = 0; n < samples; ++n, out += kRingingGroup) {
        hn::Store(hn::Add(hn::Load(d, out), a.re), d, out);
        Turn(a);
      }
      StoreColumn(a);
    }
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(Ring);

void ring(const double* p, double* z, const std::int32_t* active, std::size_t count, double fade, std::size_t samples,
          double* lanes) {
  HWY_DYNAMIC_DISPATCH(Ring)(p, z, active, count, fade, samples, lanes);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
