#include "manifold/slab_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "manifold/slab_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, kDirections>;
constexpr std::size_t kLanesAtOnce = hn::MaxLanes(Lanes());

HWY_ATTR void PlaceBox(const Directions& n, const float* HWY_RESTRICT center, const float* HWY_RESTRICT half,
                       float* HWY_RESTRICT low, float* HWY_RESTRICT high) {
  const Lanes d;
  for (std::size_t i = 0; i < kDirections; i += kLanesAtOnce) {
    const auto x = hn::Load(d, n.x + i), y = hn::Load(d, n.y + i), z = hn::Load(d, n.z + i);
    const auto middle =
        hn::MulAdd(x, hn::Set(d, center[0]), hn::MulAdd(y, hn::Set(d, center[1]), hn::Mul(z, hn::Set(d, center[2]))));
    const auto reach =
        hn::MulAdd(hn::Abs(x), hn::Set(d, half[0]),
                   hn::MulAdd(hn::Abs(y), hn::Set(d, half[1]), hn::Mul(hn::Abs(z), hn::Set(d, half[2]))));
    hn::Store(hn::Sub(middle, reach), d, low + i);
    hn::Store(hn::Add(middle, reach), d, high + i);
  }
}

HWY_ATTR void PlacePoints(const Directions& n, const float* HWY_RESTRICT points, std::size_t count,
                          float* HWY_RESTRICT low, float* HWY_RESTRICT high) {
  const Lanes d;
  for (std::size_t i = 0; i < kDirections; i += kLanesAtOnce) {
    const auto x = hn::Load(d, n.x + i), y = hn::Load(d, n.y + i), z = hn::Load(d, n.z + i);
    const auto along = [&](const float* p) HWY_ATTR {
      return hn::MulAdd(x, hn::Set(d, p[0]), hn::MulAdd(y, hn::Set(d, p[1]), hn::Mul(z, hn::Set(d, p[2]))));
    };
    auto least = along(points), most = least;
    for (std::size_t p = 1; p < count; ++p) {
      const auto at = along(points + 3 * p);
      least = hn::Min(least, at), most = hn::Max(most, at);
    }
    hn::Store(least, d, low + i);
    hn::Store(most, d, high + i);
  }
}

// The first root of g − s c + b s², c = g₀ − g₁ + b, without division by b; none: beyond all times. What overflows is
// no number, and says nothing.
HWY_ATTR float EarliestInStretch(const Slab& a, const Slab& b, const SlabWay& way, float kept, float bent) {
  const Lanes d;
  const auto zero = hn::Zero(d), never = hn::Set(d, 1e30f);
  auto latest = zero;
  for (std::size_t i = 0; i < kDirections; i += kLanesAtOnce) {
    const auto p0 = hn::Load(d, way.between[0] + i), p1 = hn::Load(d, way.between[1] + i);
    const auto ahead = hn::Sub(hn::Add(hn::Load(d, a.low[0] + i), p0), hn::Load(d, b.high[0] + i));
    const auto behind = hn::Sub(hn::Sub(hn::Load(d, b.low[0] + i), hn::Load(d, a.high[0] + i)), p0);
    const auto ahead_then = hn::Sub(hn::Add(hn::Load(d, a.low[1] + i), p1), hn::Load(d, b.high[1] + i));
    const auto behind_then = hn::Sub(hn::Sub(hn::Load(d, b.low[1] + i), hn::Load(d, a.high[1] + i)), p1);
    const auto is_ahead = hn::Ge(ahead, behind);
    const auto gap = hn::Sub(hn::Max(ahead, behind), hn::Set(d, kept));
    const auto then = hn::Sub(hn::IfThenElse(is_ahead, ahead_then, behind_then), hn::Set(d, kept));
    const auto bend = hn::Set(d, bent);
    const auto closing = hn::Add(hn::Sub(gap, then), bend);
    const auto square = hn::NegMulAdd(hn::Mul(hn::Set(d, 4.0f), bend), gap, hn::Mul(closing, closing));
    const auto sum = hn::Add(closing, hn::Sqrt(hn::Max(square, zero)));
    const auto apart = hn::Or(hn::Lt(square, zero), hn::Le(sum, zero));
    const auto time = hn::IfThenElse(apart, never, hn::Div(hn::Add(gap, gap), sum));
    const auto told = hn::And(hn::Gt(gap, zero), hn::Gt(time, latest));
    latest = hn::IfThenElse(told, time, latest);
  }
  return hn::GetLane(hn::MaxOfLanes(d, latest));
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(PlaceBox);
HWY_EXPORT(PlacePoints);
HWY_EXPORT(EarliestInStretch);

void place_box(const Directions& directions, const float* center, const float* half, float* low, float* high) {
  HWY_DYNAMIC_DISPATCH(PlaceBox)(directions, center, half, low, high);
}

void place_points(const Directions& directions, const float* points, std::size_t count, float* low, float* high) {
  HWY_DYNAMIC_DISPATCH(PlacePoints)(directions, points, count, low, high);
}

float earliest_in_stretch(const Slab& a, const Slab& b, const SlabWay& way, float kept, float bend) {
  return HWY_DYNAMIC_DISPATCH(EarliestInStretch)(a, b, way, kept, bend);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
