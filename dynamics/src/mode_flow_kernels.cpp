#include "mode_flow_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mode_flow_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

// docs/derivations/oscillator.md, "Many modes at once", has the formulas. Every product that is added is an explicit
// MulAdd in a fixed order, so that all instruction sets with FMA round alike.
HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, 8>;
using V = hn::Vec<D>;
using Bits = hn::RebindToUnsigned<D>;

constexpr double inverse_factorial(int n) {
  double product = 1.0;
  for (; n > 1; --n) product *= n;
  return 1.0 / product;
}

/// 1/First! + y/(First + Stride)! + y²/(First + 2 Stride)! + …, `Terms` terms.
template <int First, int Stride, int Terms>
HWY_INLINE V FactorialSeries(V y) {
  const D d;
  V sum = hn::Set(d, inverse_factorial(First + Stride * (Terms - 1)));
  for (int n = Terms - 2; n >= 0; --n) sum = hn::MulAdd(sum, y, hn::Set(d, inverse_factorial(First + Stride * n)));
  return sum;
}

/// e^{−x} and 1 − e^{−x}, each to its own last digits, x ≥ 0.
struct Decay {
  V left, gone;
};

HWY_INLINE Decay Decayed(V x) {
  const D d;
  const Bits bits;
  constexpr double kLog2e = 1.4426950408889634, kLn2High = 0x1.62e42fefa0000p-1, kLn2Low = 0x1.cf79abc9e3b3ap-40;
  constexpr double kExponent = 0x1.8p52 + 1023.0;  // a sum with it has the rounded number in its last bits
  x = hn::Min(x, hn::Set(d, 708.0));               // less than e⁻⁷⁰⁸ is no normal number
  const V sum = hn::NegMulAdd(x, hn::Set(d, kLog2e), hn::Set(d, kExponent));
  const V k = hn::Sub(sum, hn::Set(d, kExponent));
  const V power = hn::BitCast(d, hn::ShiftLeft<52>(hn::BitCast(bits, sum)));
  const V r =
      hn::NegMulAdd(k, hn::Set(d, kLn2Low), hn::NegMulAdd(k, hn::Set(d, kLn2High), hn::Neg(x)));  // |r| ≤ ½ ln 2
  const V p = hn::MulAdd(hn::Mul(r, r), FactorialSeries<2, 1, 12>(r), r);                         // eʳ − 1
  return {hn::MulAdd(power, p, power), hn::NegMulAdd(power, p, hn::Sub(hn::Set(d, 1.0), power))};
}

/// cos x and sin x, x ≥ 0.
struct Circle {
  V cos, sin;
};

HWY_INLINE Circle OnCircle(V x) {
  const D d;
  const Bits bits;
  constexpr double kTwoOverPi = 0.63661977236758134, kHalfPi = 0x1.921fb54442d18p0, kHalfPiLow = 0x1.1a62633145c07p-54;
  constexpr double kInteger = 0x1p52;
  // Beyond 2⁵² a phase has no digit left that would tell where on the circle it is.
  x = hn::Min(x, hn::Set(d, 0x1p52));
  const V sum = hn::MulAdd(x, hn::Set(d, kTwoOverPi), hn::Set(d, kInteger));  // its last bits: quarter turns
  const V quarters = hn::Sub(sum, hn::Set(d, kInteger));
  // The first difference is exact, as is the product in it.
  const V r = hn::NegMulAdd(quarters, hn::Set(d, kHalfPiLow), hn::NegMulAdd(quarters, hn::Set(d, kHalfPi), x));
  const V y = hn::Neg(hn::Mul(r, r));
  const V s = hn::MulAdd(hn::Mul(r, y), FactorialSeries<3, 2, 8>(y), r);
  const V c = hn::MulAdd(y, FactorialSeries<2, 2, 9>(y), hn::Set(d, 1.0));
  const auto n = hn::BitCast(bits, sum);
  const auto odd = hn::MaskFromVec(hn::BitCast(d, hn::Sub(hn::Zero(bits), hn::And(n, hn::Set(bits, 1)))));
  const V half_turn = hn::BitCast(d, hn::ShiftLeft<63>(hn::ShiftRight<1>(n)));
  const V negative_cos = hn::Xor(half_turn, hn::BitCast(d, hn::ShiftLeft<63>(n)));
  return {hn::Xor(hn::IfThenElse(odd, s, c), negative_cos), hn::Xor(hn::IfThenElse(odd, c, s), half_turn)};
}

/// The members of ModePropagator.
struct Flow {
  V z_z, S, v_v, H;
};

HWY_INLINE Flow Select(hn::Mask<D> mask, const Flow& yes, const Flow& no) {
  return {hn::IfThenElse(mask, yes.z_z, no.z_z), hn::IfThenElse(mask, yes.S, no.S),
          hn::IfThenElse(mask, yes.v_v, no.v_v), hn::IfThenElse(mask, yes.H, no.H)};
}

/// Any damping, both roots times h below ½: Taylor's series H/h² = Σ b_n/n!, S/h = Σ b_n/(n − 1)!.
HWY_INLINE Flow ShortFlow(V lambda, V xi, V h) {
  const D d;
  constexpr int kTerms = 16;
  const V q = hn::Mul(hn::Mul(lambda, h), h), p = hn::Mul(hn::Add(xi, xi), h);
  V before = hn::Zero(d), b = hn::Set(d, 1.0), H = hn::Zero(d), S = hn::Zero(d);
  for (int n = 2; n <= kTerms; ++n) {
    H = hn::MulAdd(b, hn::Set(d, inverse_factorial(n)), H);
    S = hn::MulAdd(b, hn::Set(d, inverse_factorial(n - 1)), S);
    const V next = hn::Neg(hn::MulAdd(p, b, hn::Mul(q, before)));
    before = b;
    b = next;
  }
  const V z_z = hn::NegMulAdd(q, H, hn::Set(d, 1.0));
  return {z_z, hn::Mul(S, h), hn::NegMulAdd(p, S, z_z), hn::Mul(hn::Mul(H, h), h)};
}

HWY_INLINE Flow OscillatingFlow(V lambda, V xi, V root, V h) {
  const D d;
  const V theta = hn::Max(hn::Mul(root, h), hn::Set(d, 1e-300));  // sin θ/θ is 1 there
  const V e = Decayed(hn::Mul(xi, h)).left;
  const Circle on = OnCircle(theta);
  const V S = hn::Mul(hn::Mul(e, h), hn::Div(on.sin, theta)), C = hn::Mul(e, on.cos);
  const V z_z = hn::MulAdd(xi, S, C);
  return {z_z, S, hn::NegMulAdd(xi, S, C), hn::Div(hn::Sub(hn::Set(d, 1.0), z_z), lambda)};
}

HWY_INLINE Flow DecayingFlow(V lambda, V xi, V root, V h) {
  const D d;
  const V tiny = hn::Set(d, 1e-300);  // (1 − e^{−x})/x is 1 there
  const V r2 = hn::Add(xi, root), r1 = hn::Div(lambda, r2);
  const V x1 = hn::Max(hn::Mul(r1, h), tiny), apart = hn::Max(hn::Mul(hn::Add(root, root), h), tiny);
  const Decay slow = Decayed(x1), between = Decayed(apart);
  const V mean = hn::Mul(slow.left, hn::Div(between.gone, apart));
  const V S = hn::Mul(h, mean), r1S = hn::Mul(r1, S);
  return {hn::Add(slow.left, r1S), S, hn::Sub(hn::Mul(slow.left, between.left), r1S),
          hn::Mul(hn::Div(h, r2), hn::Sub(hn::Div(slow.gone, x1), mean))};
}

/// Each form where some lane needs it: which lanes share a vector does not change their bits.
HWY_INLINE Flow FlowOver(V lambda, V xi, V h) {
  const D d;
  const V delta_squared = hn::MulSub(xi, xi, lambda), root = hn::Sqrt(hn::Abs(delta_squared));
  const auto decays = hn::Gt(delta_squared, hn::Zero(d));
  const V larger_root = hn::IfThenElse(decays, hn::Add(xi, root), hn::Sqrt(lambda));
  const auto is_short = hn::Lt(hn::Mul(larger_root, h), hn::Set(d, 0.5));
  if (hn::AllTrue(d, is_short)) return ShortFlow(lambda, xi, h);
  Flow flow = hn::AllTrue(d, decays) ? DecayingFlow(lambda, xi, root, h) : OscillatingFlow(lambda, xi, root, h);
  if (!hn::AllFalse(d, decays) && !hn::AllTrue(d, decays))
    flow = Select(decays, DecayingFlow(lambda, xi, root, h), flow);
  return hn::AllFalse(d, is_short) ? flow : Select(is_short, ShortFlow(lambda, xi, h), flow);
}

/// The first of n lanes; the others are zero.
HWY_INLINE V LoadSome(const double* from, std::size_t n) {
  const D d;
  if (n >= hn::Lanes(d)) return hn::LoadU(d, from);
  HWY_ALIGN double lanes[8] = {};
  for (std::size_t i = 0; i < n; ++i) lanes[i] = from[i];
  return hn::Load(d, lanes);
}

HWY_INLINE void StoreSome(V v, double* to, std::size_t n) {
  const D d;
  if (n >= hn::Lanes(d)) return hn::StoreU(v, d, to);
  HWY_ALIGN double lanes[8];
  hn::Store(v, d, lanes);
  for (std::size_t i = 0; i < n; ++i) to[i] = lanes[i];
}

HWY_ATTR void FlowModes(const Oscillators& modes, double t, const double* HWY_RESTRICT z, const double* HWY_RESTRICT v,
                        const double* HWY_RESTRICT g, double* HWY_RESTRICT at_z, double* HWY_RESTRICT at_v) {
  const D d;
  for (std::size_t i = 0; i < modes.count; i += hn::Lanes(d)) {
    const std::size_t n = modes.count - i;
    const V lambda = LoadSome(modes.lambda + i, n), z0 = LoadSome(z + i, n), v0 = LoadSome(v + i, n),
            g0 = LoadSome(g + i, n);
    const Flow f = FlowOver(lambda, LoadSome(modes.decay + i, n), hn::Set(d, t));
    StoreSome(hn::MulAdd(f.z_z, z0, hn::MulAdd(f.S, v0, hn::Mul(f.H, g0))), at_z + i, n);
    StoreSome(hn::MulAdd(f.v_v, v0, hn::Mul(f.S, hn::NegMulAdd(lambda, z0, g0))), at_v + i, n);
  }
}

HWY_ATTR void AddImpulseFlow(const Oscillators& modes, double t, const double* HWY_RESTRICT j,
                             double* HWY_RESTRICT at_z, double* HWY_RESTRICT at_v) {
  const D d;
  for (std::size_t i = 0; i < modes.count; i += hn::Lanes(d)) {
    const std::size_t n = modes.count - i;
    const Flow f = FlowOver(LoadSome(modes.lambda + i, n), LoadSome(modes.decay + i, n), hn::Set(d, t));
    const V v0 = LoadSome(j + i, n);
    StoreSome(hn::MulAdd(f.S, v0, LoadSome(at_z + i, n)), at_z + i, n);
    StoreSome(hn::MulAdd(f.v_v, v0, LoadSome(at_v + i, n)), at_v + i, n);
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(FlowModes);
HWY_EXPORT(AddImpulseFlow);

void flow_modes(const Oscillators& modes, double t, const double* z, const double* v, const double* g, double* at_z,
                double* at_v) {
  HWY_DYNAMIC_DISPATCH(FlowModes)(modes, t, z, v, g, at_z, at_v);
}

void add_impulse_flow(const Oscillators& modes, double t, const double* j, double* at_z, double* at_v) {
  HWY_DYNAMIC_DISPATCH(AddImpulseFlow)(modes, t, j, at_z, at_v);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
