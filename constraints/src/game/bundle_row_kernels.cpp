#include "bundle_kernels.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "game/bundle_row_kernels.cpp"
// Arrays of vectors cannot be formed of vectors of a length unknown to the compiler: those machines run the fixed
// 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

#include "bundle_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {

/// The turns' parts of a side's three rows: ± scale (lever × axis).
HWY_INLINE HWY_ATTR void MakeTurns(const PairBundle& bundle, BundleContact& c, std::size_t s, std::size_t lane) {
  Vector r[3];
  for (std::size_t i = 0; i < 3; ++i) r[i] = s == 0 ? Get(c.lever[s][i], lane) : hn::Neg(Get(c.lever[s][i], lane));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Vector n[3] = {Get(c.axes[axis][0], lane), Get(c.axes[axis][1], lane), Get(c.axes[axis][2], lane)};
    Vector moment[3];
    for (std::size_t i = 0; i < 3; ++i)
      moment[i] = hn::NegMulAdd(r[(i + 2) % 3], n[(i + 1) % 3], hn::Mul(r[(i + 1) % 3], n[(i + 2) % 3]));
    for (std::size_t i = 0; i < 3; ++i)
      Put(AddDot(bundle.scale[s][i], moment, hn::Zero(Lanes()), lane), c.turn[s][axis][i], lane);
  }
}

/// Products of two of the rows, by frames.
HWY_INLINE HWY_ATTR Vector FrameProduct(const BundleContact& c, std::size_t x, std::size_t y, const Vector* rate,
                                        std::size_t lane) {
  Vector sum = hn::Zero(Lanes());
  for (std::size_t i = 0; i < 3; ++i) {
    sum = hn::MulAdd(hn::Mul(rate[i], Get(c.axes[x][i], lane)), Get(c.axes[y][i], lane), sum);
    for (std::size_t s = 0; s < 2; ++s) sum = hn::MulAdd(Get(c.turn[s][x][i], lane), Get(c.turn[s][y][i], lane), sum);
  }
  return sum;
}

/// 1/x; 0 where it is not positive.
HWY_INLINE HWY_ATTR Vector Inverse(Vector x) {
  return hn::IfThenElseZero(hn::Gt(x, hn::Zero(Lanes())), hn::Div(hn::Set(Lanes(), 1.0f), x));
}

/// The largest eigenvalue of a symmetric 2 × 2 block.
HWY_INLINE HWY_ATTR Vector LargestOf(Vector a, Vector b, Vector off) {
  const Vector half = hn::Set(Lanes(), 0.5f), apart = hn::Mul(half, hn::Sub(a, b));
  return hn::MulAdd(half, hn::Add(a, b), hn::Sqrt(hn::MulAdd(apart, apart, hn::Mul(off, off))));
}

HWY_INLINE HWY_ATTR void MakeMasses(const PairBundle& bundle, BundleContact& c, const Block8* rows, const Modes& shapes,
                                    const Vector* rate, std::size_t lane) {
  constexpr std::size_t kPairs[6][2] = {{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}};
  Vector of[6];
  for (std::size_t i = 0; i < 6; ++i) of[i] = FrameProduct(c, kPairs[i][0], kPairs[i][1], rate, lane);
  Put(Inverse(of[0]), c.inverse_push, lane);
  for (std::int32_t m = 0; m < bundle.modes[0] + bundle.modes[1]; ++m)
    for (std::size_t i = 0; i < 6; ++i)
      of[i] = hn::MulAdd(Get(rows[3 * m + kPairs[i][0]], lane), Get(rows[3 * m + kPairs[i][1]], lane), of[i]);
  Put(Inverse(hn::Add(of[0], Get(c.compliance, lane))), c.inverse_normal, lane);
  Put(of[1], c.coupling[0], lane);
  Put(of[2], c.coupling[1], lane);
  // One step for both tangents: what slides is braked against its slip.
  Put(Inverse(LargestOf(of[3], of[5], of[4])), c.inverse_tangent, lane);
  Vector bent[3] = {hn::Zero(Lanes()), hn::Zero(Lanes()), hn::Zero(Lanes())};
  AddModes(bundle, rows, 3, shapes, lane, bent);
  Put(hn::Sub(Get(c.rest, lane), bent[0]), c.rest, lane);
}

/// Eight modes of a point from one on, by axis: eight numbers each.
HWY_INLINE HWY_ATTR void MakeEightModes(const ModePoint& point, std::size_t first, Block8* to) {
  const Lanes d;
  for (std::size_t at = 0; at < 8; at += kLanesAtOnce) {
    const std::size_t mode = first + at;
    const Vector root = hn::LoadU(d, point.roots + mode);
    Vector shape[3];
    for (std::size_t i = 0; i < 3; ++i) {
      shape[i] = hn::Mul(hn::Set(d, point.weight[0]), hn::LoadU(d, point.rows[0][i] + mode));
      for (std::size_t c = 1; c < point.corners; ++c)
        shape[i] = hn::MulAdd(hn::Set(d, point.weight[c]), hn::LoadU(d, point.rows[c][i] + mode), shape[i]);
      shape[i] = hn::Mul(root, shape[i]);
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float* n = point.axes[axis];
      Put(hn::MulAdd(hn::Set(d, n[1]), shape[1],
                     hn::MulAdd(hn::Set(d, n[2]), shape[2], hn::Mul(hn::Set(d, n[0]), shape[0]))),
          to[axis], at);
    }
  }
}

HWY_ATTR void MakeModeRows(const ModePoint* const* points, std::int32_t modes, Block8* rows) {
  Block8 eight[kBundleLanes][3];
  for (std::int32_t first = 0; first < modes; first += 8, rows += 24) {
    const auto mode = static_cast<std::size_t>(first);
    for (std::size_t l = 0; l < kBundleLanes; ++l) {
      const ModePoint* point = points[l];
      if (point != nullptr && mode < 8 * point->blocks)
        MakeEightModes(*point, mode, eight[l]);
      else
        for (Block8& axis : eight[l]) axis = {};
    }
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce)
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float* from[kLanesAtOnce];
        for (std::size_t l = 0; l < kLanesAtOnce; ++l) from[l] = eight[lane + l][axis].v;
        Vector v[8];
        Gather4(from, 0, v);
        Gather4(from, 4, v + 4);
        for (std::size_t i = 0; i < 8; ++i) Put(v[i], rows[3 * i + axis], lane);
      }
  }
}

HWY_ATTR void MakeBundleRows(const BundleArrays& all, const Block8* shapes) {
  for (std::size_t b = 0; b < all.count; ++b) {
    const PairBundle& bundle = all.bundles[b];
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      const Modes modes(all, bundle);
      ReadModes(all, bundle, shapes, lane, modes);
      Vector rate[3];
      for (std::size_t i = 0; i < 3; ++i) {
        const Vector a = Get(bundle.root[0][i], lane), b = Get(bundle.root[1][i], lane);
        rate[i] = hn::MulAdd(a, a, hn::Mul(b, b));
      }
      for (std::int32_t k = 0; k < bundle.count; ++k) {
        BundleContact& c = all.contacts[bundle.first + k];
        for (std::size_t s = 0; s < 2; ++s) MakeTurns(bundle, c, s, lane);
        MakeMasses(bundle, c, RowsOf(all, bundle, k), modes, rate, lane);
      }
    }
  }
}

/// How points of two bodies come apart, by components.
HWY_INLINE HWY_ATTR void Travel(const BundleContact& c, const Vector (*frames)[12], std::size_t lane, Vector* apart) {
  for (std::size_t i = 0; i < 3; ++i) {
    Vector of[2];
    for (std::size_t s = 0; s < 2; ++s) {
      of[s] = frames[s][i];
      for (std::size_t j = 0; j < 3; ++j) of[s] = hn::MulAdd(frames[s][3 + 3 * i + j], Get(c.arm[s][j], lane), of[s]);
    }
    apart[i] = hn::Sub(of[0], of[1]);
  }
}

/// Twelve numbers of each side's frame.
HWY_INLINE HWY_ATTR void ReadShifts(const PairBundle& bundle, const FrameShift* frames,
                                    const float (FrameShift::*first)[3], std::size_t lane, Vector (*to)[12]) {
  for (std::size_t s = 0; s < 2; ++s) {
    const float* from[kLanesAtOnce];
    for (std::size_t l = 0; l < kLanesAtOnce; ++l) from[l] = frames[bundle.frame[s][lane + l]].*first;
    for (std::size_t i = 0; i < 12; i += 4) Gather4(from, i, to[s] + i);
  }
}

/// What led bodies are carried by in the substep.
HWY_INLINE HWY_ATTR void AddCarried(const BundleArrays& all, const PairBundle& bundle, const FrameShift* frames,
                                    std::size_t lane) {
  Vector carried[2][12], apart[3];
  ReadShifts(bundle, frames, &FrameShift::carried, lane, carried);
  for (std::int32_t k = 0; k < bundle.count; ++k) {
    BundleContact& c = all.contacts[bundle.first + k];
    Travel(c, carried, lane, apart);
    Put(AddDot(c.axes[0], apart, Get(c.gap, lane), lane), c.gap, lane);
    for (std::size_t t = 0; t < 2; ++t) Put(AddDot(c.axes[1 + t], apart, Get(c.slip[t], lane), lane), c.slip[t], lane);
  }
}

/// @param bent what the modes give to the rows' numbers
HWY_INLINE HWY_ATTR bool MeasureOne(BundleContact& c, const Vector (*frames)[12], const Vector* bent,
                                    std::size_t lane) {
  const Lanes d;
  const Vector zero = hn::Zero(d);
  Vector apart[3];
  Travel(c, frames, lane, apart);
  const Vector straight = AddDot(c.axes[0], apart, Get(c.rest, lane), lane), force = Get(c.force[0], lane);
  const Vector now = hn::Add(straight, bent[0]);
  const Vector yields = hn::Mul(Get(c.compliance, lane), force), gap = hn::Add(now, yields);
  const Vector part = hn::Neg(hn::Add(gap, Get(c.slop, lane)));
  Put(now, c.now, lane);
  Put(straight, c.gap, lane);
  for (std::size_t t = 0; t < 2; ++t) Put(hn::Sub(Get(c.running[t], lane), bent[1 + t]), c.slip[t], lane);
  Put(hn::Sub(hn::Min(gap, zero), yields), c.target, lane);
  Put(force, c.before, lane);
  Put(zero, c.push, lane);
  Put(part, c.part, lane);
  return !hn::AllTrue(d, hn::Le(part, zero));
}

HWY_ATTR void MeasureBundles(const BundleArrays& all, const FrameShift* frames, const Block8* shapes) {
  const Lanes d;
  for (std::size_t b = 0; b < all.count; ++b) {
    PairBundle& bundle = all.bundles[b];
    bundle.overlaps = false;
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Vector come[2][12];
      ReadShifts(bundle, frames, &FrameShift::shift, lane, come);
      const Modes modes(all, bundle);
      ReadModes(all, bundle, shapes, lane, modes);
      for (std::int32_t k = 0; k < bundle.count; ++k) {
        Vector bent[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
        AddModes(bundle, RowsOf(all, bundle, k), 3, modes, lane, bent);
        if (MeasureOne(all.contacts[bundle.first + k], come, bent, lane)) bundle.overlaps = true;
      }
      if (bundle.carried) AddCarried(all, bundle, frames, lane);
    }
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(MakeModeRows);
HWY_EXPORT(MakeBundleRows);
HWY_EXPORT(MeasureBundles);

void make_mode_rows(const ModePoint* const* points, std::int32_t modes, Block8* rows) {
  HWY_DYNAMIC_DISPATCH(MakeModeRows)(points, modes, rows);
}

void make_bundle_rows(const BundleArrays& bundles, const Block8* shapes) {
  HWY_DYNAMIC_DISPATCH(MakeBundleRows)(bundles, shapes);
}

void measure_bundles(const BundleArrays& bundles, const FrameShift* frames, const Block8* shapes) {
  HWY_DYNAMIC_DISPATCH(MeasureBundles)(bundles, frames, shapes);
}

}  // namespace limber::internal
#endif
