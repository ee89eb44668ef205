#include "hierarchy/bounds_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "hierarchy/bounds_kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Many = hn::CappedTag<float, kBoundsLanes>;  // eight lanes, or as many as there are

// Half floats; the box of a large body is bound by reading them.
HWY_INLINE HWY_ATTR hn::Vec<Many> Coefficients(const std::uint16_t* HWY_RESTRICT bits) {
  const hn::Rebind<std::uint16_t, Many> d;
  const hn::Rebind<hwy::float16_t, Many> half;
  return hn::PromoteTo(Many(), hn::BitCast(half, hn::Load(d, bits)));
}

#if HWY_TARGET == HWY_SCALAR

// Without vectors of four.
HWY_ATTR void MakeBox(const StateView& state, const float* constants, const std::uint16_t* row, NodeBox* box) {
  for (std::size_t axis = 0; axis < 3; ++axis, row += state.stride) {
    float center = 0.0f, by_mode = 0.0f;
    for (std::size_t i = 0; i < state.stride; ++i) {
      center += hn::GetLane(Coefficients(row + i)) * state.amplitudes[i];
      by_mode += hn::GetLane(Coefficients(row + 3 * state.stride + i)) * state.magnitudes[i];
    }
    const float by_energy = constants[8 + axis] * state.norm;
    const float half = constants[4 + axis] + (by_mode < by_energy ? by_mode : by_energy);
    center += constants[axis];
    box->low[axis] = center - half;
    box->high[axis] = center + half;
  }
}

struct Sides {
  float center[3], half[3];
  explicit Sides(const NodeBox& box) {
    for (int i = 0; i < 3; ++i) {
      center[i] = 0.5f * (box.low[i] + box.high[i]);
      half[i] = 0.5f * (box.high[i] - box.low[i]);
    }
  }
};

inline float Magnitude(float x) { return x < 0.0f ? -x : x; }

bool Within(const BoxFrames& f, const NodeBox& box_a, const NodeBox& box_b) {
  const Sides a(box_a), b(box_b);
  float from_a[3];
  for (int i = 0; i < 3; ++i) {
    float reach = a.half[i] + f.slack_a[i];
    from_a[i] = f.p[i] - a.center[i];
    for (int j = 0; j < 3; ++j) {
      from_a[i] += f.columns[j][i] * b.center[j];
      reach += Magnitude(f.columns[j][i]) * b.half[j];
    }
    if (Magnitude(from_a[i]) > reach) return false;
  }
  for (int j = 0; j < 3; ++j) {
    float reach = b.half[j] + f.slack_b[j], along = 0.0f;
    for (int i = 0; i < 3; ++i) {
      along += f.columns[j][i] * from_a[i];
      reach += Magnitude(f.columns[j][i]) * a.half[i];
    }
    if (Magnitude(along) > reach) return false;
  }
  return true;
}

HWY_ATTR std::uint64_t BoxesWithin(const BoxFrames& frames, const NodeBox& one, const NodeBox* many, std::size_t count,
                                   bool many_of_b) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i)
    if (many_of_b ? Within(frames, one, many[i]) : Within(frames, many[i], one)) bits |= std::uint64_t{1} << i;
  return bits;
}

#else

using Four = hn::FixedTag<float, 4>;
using Quad = hn::Vec<Four>;

HWY_INLINE HWY_ATTR Quad Fold(hn::Vec<Many> v) {
#if HWY_MAX_BYTES >= 32
  return hn::Add(hn::LowerHalf(Four(), v), hn::UpperHalf(Four(), v));
#else
  return v;
#endif
}

// (Σx, Σy, Σz, 0) of three vectors of four.
HWY_INLINE HWY_ATTR Quad SumOfEach(Quad x, Quad y, Quad z) {
  const Four d;
  const Quad zero = hn::Zero(d);
  const Quad xz = hn::Add(hn::InterleaveLower(d, x, z), hn::InterleaveUpper(d, x, z));
  const Quad y0 = hn::Add(hn::InterleaveLower(d, y, zero), hn::InterleaveUpper(d, y, zero));
  return hn::Add(hn::InterleaveLower(d, xz, y0), hn::InterleaveUpper(d, xz, y0));
}

HWY_INLINE HWY_ATTR void MakeBox(const StateView& state, const float* HWY_RESTRICT constants,
                                 const std::uint16_t* HWY_RESTRICT row, NodeBox* box) {
  const Many d;
  const Four four;
  const std::size_t n = state.stride;
  auto cx = hn::Zero(d), cy = cx, cz = cx, dx = cx, dy = cx, dz = cx;
  for (std::size_t i = 0; i < n; i += hn::Lanes(d)) {
    const auto z = hn::Load(d, state.amplitudes + i), m = hn::Load(d, state.magnitudes + i);
    cx = hn::MulAdd(Coefficients(row + i), z, cx);
    cy = hn::MulAdd(Coefficients(row + n + i), z, cy);
    cz = hn::MulAdd(Coefficients(row + 2 * n + i), z, cz);
    dx = hn::MulAdd(Coefficients(row + 3 * n + i), m, dx);
    dy = hn::MulAdd(Coefficients(row + 4 * n + i), m, dy);
    dz = hn::MulAdd(Coefficients(row + 5 * n + i), m, dz);
  }
  const Quad center = hn::Add(hn::Load(four, constants), SumOfEach(Fold(cx), Fold(cy), Fold(cz)));
  const Quad by_mode = SumOfEach(Fold(dx), Fold(dy), Fold(dz));
  const Quad by_energy = hn::Mul(hn::Load(four, constants + 8), hn::Set(four, state.norm));
  const Quad half = hn::Add(hn::Load(four, constants + 4), hn::Min(by_mode, by_energy));
  hn::Store(hn::Sub(center, half), four, box->low);
  hn::Store(hn::Add(center, half), four, box->high);
}

struct Sides {
  Quad center, half;
};

HWY_INLINE HWY_ATTR Sides SidesOf(const NodeBox& box) {
  const Four d;
  const Quad low = hn::Load(d, box.low), high = hn::Load(d, box.high), halve = hn::Set(d, 0.5f);
  return {hn::Mul(halve, hn::Add(low, high)), hn::Mul(halve, hn::Sub(high, low))};
}

/// A matrix by its columns.
struct Columns {
  Quad x, y, z;
};

HWY_INLINE HWY_ATTR Columns LoadColumns(const float (*columns)[4]) {
  const Four d;
  return {hn::Load(d, columns[0]), hn::Load(d, columns[1]), hn::Load(d, columns[2])};
}

HWY_INLINE HWY_ATTR Columns Magnitudes(const Columns& m) { return {hn::Abs(m.x), hn::Abs(m.y), hn::Abs(m.z)}; }

HWY_INLINE HWY_ATTR Quad Product(const Columns& m, Quad v, Quad plus) {
  return hn::MulAdd(m.x, hn::Broadcast<0>(v),
                    hn::MulAdd(m.y, hn::Broadcast<1>(v), hn::MulAdd(m.z, hn::Broadcast<2>(v), plus)));
}

// Both vectors' fourth lanes are of no meaning.
HWY_INLINE HWY_ATTR bool AllWithin(Quad along_a, Quad reach_a, Quad along_b, Quad reach_b) {
  const Four d;
  const auto apart = hn::Or(hn::Gt(hn::Abs(along_a), reach_a), hn::Gt(hn::Abs(along_b), reach_b));
  return hn::AllFalse(d, hn::And(apart, hn::FirstN(d, 3)));
}

HWY_ATTR std::uint64_t BoxesWithin(const BoxFrames& frames, const NodeBox& one, const NodeBox* many, std::size_t count,
                                   bool many_of_b) {
  const Four d;
  const Columns R = LoadColumns(frames.columns), Rt = LoadColumns(frames.rows);
  const Columns R_size = Magnitudes(R), Rt_size = Magnitudes(Rt);
  const Quad slack_a = hn::Load(d, frames.slack_a), slack_b = hn::Load(d, frames.slack_b);
  const Quad p = hn::Load(d, frames.p), zero = hn::Zero(d);
  const Sides fixed = SidesOf(one);
  std::uint64_t bits = 0;
  if (many_of_b) {
    const Quad from_fixed = hn::Sub(p, fixed.center), reach_a = hn::Add(fixed.half, slack_a);
    const Quad reach_b = Product(Rt_size, fixed.half, slack_b);
    for (std::size_t i = 0; i < count; ++i) {
      const Sides b = SidesOf(many[i]);
      const Quad from_a = Product(R, b.center, from_fixed), from_b = Product(Rt, from_a, zero);
      if (AllWithin(from_a, Product(R_size, b.half, reach_a), from_b, hn::Add(reach_b, b.half)))
        bits |= std::uint64_t{1} << i;
    }
  } else {
    const Quad to_fixed = Product(R, fixed.center, p), reach_a = Product(R_size, fixed.half, slack_a);
    const Quad reach_b = hn::Add(fixed.half, slack_b);
    for (std::size_t i = 0; i < count; ++i) {
      const Sides a = SidesOf(many[i]);
      const Quad from_a = hn::Sub(to_fixed, a.center), from_b = Product(Rt, from_a, zero);
      if (AllWithin(from_a, hn::Add(reach_a, a.half), from_b, Product(Rt_size, a.half, reach_b)))
        bits |= std::uint64_t{1} << i;
    }
  }
  return bits;
}

#endif  // HWY_TARGET

HWY_ATTR void MakeBoxes(const StateView& state, const float* constants, const std::uint16_t* coefficients,
                        std::size_t count, std::uint32_t stamp, NodeBox* boxes) {
  for (std::size_t i = 0; i < count; ++i) {
    MakeBox(state, constants + i * kNodeConstants, coefficients + i * 6 * state.stride, boxes + i);
    boxes[i].stamp = stamp;
  }
}

HWY_ATTR StateSums PrepareState(const double* HWY_RESTRICT z, std::size_t modes, std::size_t stride,
                                const double* HWY_RESTRICT largest, const double* HWY_RESTRICT weights,
                                const double* HWY_RESTRICT scale, float* HWY_RESTRICT amplitudes,
                                float* HWY_RESTRICT magnitudes) {
  const hn::CappedTag<double, kBoundsLanes> d;
  const hn::Rebind<float, decltype(d)> f;
  constexpr std::size_t kLanes = hn::MaxLanes(d);
  auto farthest = hn::Zero(d), squared = hn::Zero(d);
  std::size_t i = 0;
  for (; i + kLanes <= modes; i += kLanes) {
    const auto a = hn::LoadU(d, z + i);
    const auto m = hn::Abs(a);
    farthest = hn::MulAdd(m, hn::LoadU(d, largest + i), farthest);
    squared = hn::MulAdd(hn::Mul(a, a), hn::LoadU(d, weights + i), squared);
    const auto to = hn::LoadU(d, scale + i);
    hn::Store(hn::DemoteTo(f, hn::Mul(a, to)), f, amplitudes + i);
    hn::Store(hn::DemoteTo(f, hn::Mul(m, to)), f, magnitudes + i);
  }
  StateSums sums{hn::GetLane(hn::SumOfLanes(d, farthest)), hn::GetLane(hn::SumOfLanes(d, squared))};
  for (; i < modes; ++i) {
    const double m = z[i] < 0.0 ? -z[i] : z[i];
    sums.farthest += m * largest[i];
    sums.squared_norm += z[i] * z[i] * weights[i];
    amplitudes[i] = static_cast<float>(z[i] * scale[i]), magnitudes[i] = static_cast<float>(m * scale[i]);
  }
  for (; i < stride; ++i) amplitudes[i] = magnitudes[i] = 0.0f;
  return sums;
}

// Eight partial sums per axis whatever the vector's length, added up in one order.
HWY_ATTR void MakeDisplacement(const float* HWY_RESTRICT rows, std::size_t stride, const double* HWY_RESTRICT z,
                               std::size_t padded_modes, double* HWY_RESTRICT u) {
  const hn::CappedTag<double, kBoundsLanes> d;
  const hn::Rebind<float, decltype(d)> f;
  constexpr std::size_t kLanes = hn::MaxLanes(d), kParts = kBoundsLanes / kLanes;
  for (std::size_t axis = 0; axis < 3; ++axis, rows += stride) {
    hn::Vec<decltype(d)> sum[kParts];
    for (std::size_t p = 0; p < kParts; ++p) sum[p] = hn::Zero(d);
    for (std::size_t i = 0; i < padded_modes; i += kBoundsLanes)
      for (std::size_t p = 0; p < kParts; ++p)
        sum[p] =
            hn::MulAdd(hn::PromoteTo(d, hn::Load(f, rows + i + p * kLanes)), hn::Load(d, z + i + p * kLanes), sum[p]);
    alignas(64) double s[kBoundsLanes];
    for (std::size_t p = 0; p < kParts; ++p) hn::Store(sum[p], d, s + p * kLanes);
    u[axis] = ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]));
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(PrepareState);
HWY_EXPORT(MakeBoxes);
HWY_EXPORT(MakeDisplacement);
HWY_EXPORT(BoxesWithin);

StateSums prepare_state(const double* z, std::size_t modes, std::size_t stride, const double* largest,
                        const double* weights, const double* scale, float* amplitudes, float* magnitudes) {
  return HWY_DYNAMIC_DISPATCH(PrepareState)(z, modes, stride, largest, weights, scale, amplitudes, magnitudes);
}

void make_boxes(const StateView& state, const float* constants, const std::uint16_t* coefficients, std::size_t count,
                std::uint32_t stamp, NodeBox* boxes) {
  HWY_DYNAMIC_DISPATCH(MakeBoxes)(state, constants, coefficients, count, stamp, boxes);
}

void make_displacement(const float* rows, std::size_t stride, const double* z, std::size_t padded_modes, double* u) {
  HWY_DYNAMIC_DISPATCH(MakeDisplacement)(rows, stride, z, padded_modes, u);
}

std::uint64_t boxes_within(const BoxFrames& frames, const NodeBox& one, const NodeBox* many, std::size_t count,
                           bool many_of_b) {
  return HWY_DYNAMIC_DISPATCH(BoxesWithin)(frames, one, many, count, many_of_b);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
