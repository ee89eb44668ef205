// What the vector loops of contact share: the coordinates of eight pairs of bodies in lanes, what rows read of them and
// move. Compiled once for each instruction set by what includes it.

#if defined(LIMBER_CONSTRAINTS_BUNDLE_LANES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LIMBER_CONSTRAINTS_BUNDLE_LANES_INL_H_
#undef LIMBER_CONSTRAINTS_BUNDLE_LANES_INL_H_
#else
#define LIMBER_CONSTRAINTS_BUNDLE_LANES_INL_H_
#endif

#include "bundle_kernels.h"
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Lanes = hn::CappedTag<float, kBundleLanes>;
using Vector = hn::Vec<Lanes>;
constexpr std::size_t kLanesAtOnce = hn::MaxLanes(Lanes());

HWY_INLINE HWY_ATTR Vector Get(const Block8& from, std::size_t lane) { return hn::Load(Lanes(), from.v + lane); }
HWY_INLINE HWY_ATTR void Put(Vector x, Block8& to, std::size_t lane) { hn::Store(x, Lanes(), to.v + lane); }

/// a · b + c, of three components.
HWY_INLINE HWY_ATTR Vector AddDot(const Block8* a, const Vector* b, Vector c, std::size_t lane) {
  for (std::size_t i = 0; i < 3; ++i) c = hn::MulAdd(Get(a[i], lane), b[i], c);
  return c;
}

// Four numbers of each lane's own record, as four vectors over the lanes, and back.
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE HWY_ATTR void Gather4(const float* const* from, std::size_t at, Vector* to) {
  for (std::size_t i = 0; i < 4; ++i) to[i] = hn::Set(Lanes(), from[0][at + i]);
}
HWY_INLINE HWY_ATTR void Scatter4(const Vector* from, float* const* to, std::size_t at) {
  for (std::size_t i = 0; i < 4; ++i)
    if (to[0] != nullptr) hn::Store(from[i], Lanes(), to[0] + at + i);
}
#else
using Fours = hn::CappedTag<float, 4>;
using Four = hn::Vec<Fours>;

HWY_INLINE HWY_ATTR void Transpose(Four* x) {
  const Fours d;
  const Four a = hn::InterleaveLower(d, x[0], x[2]), b = hn::InterleaveLower(d, x[1], x[3]);
  const Four e = hn::InterleaveUpper(d, x[0], x[2]), f = hn::InterleaveUpper(d, x[1], x[3]);
  x[0] = hn::InterleaveLower(d, a, b), x[1] = hn::InterleaveUpper(d, a, b);
  x[2] = hn::InterleaveLower(d, e, f), x[3] = hn::InterleaveUpper(d, e, f);
}

template <class D>
HWY_INLINE HWY_ATTR hn::Vec<D> Joined(D d, const Four& lower, const Four& upper) {
  if constexpr (hn::MaxLanes(D()) == 8)
    return hn::Combine(d, upper, lower);
  else
    return lower;
}

template <class V>
HWY_INLINE HWY_ATTR Four PartOf(const V& x, std::size_t four) {
  if constexpr (sizeof(V) > sizeof(Four))
    return four == 0 ? hn::LowerHalf(Fours(), x) : hn::UpperHalf(Fours(), x);
  else
    return x;
}

HWY_INLINE HWY_ATTR void Gather4(const float* const* from, std::size_t at, Vector* to) {
  Four x[2][4];
  for (std::size_t g = 0; g < kLanesAtOnce / 4; ++g) {
    for (std::size_t l = 0; l < 4; ++l) x[g][l] = hn::LoadU(Fours(), from[4 * g + l] + at);
    Transpose(x[g]);
  }
  for (std::size_t i = 0; i < 4; ++i) to[i] = Joined(Lanes(), x[0][i], x[kLanesAtOnce / 4 - 1][i]);
}

/// Null: nowhere.
HWY_INLINE HWY_ATTR void Scatter4(const Vector* from, float* const* to, std::size_t at) {
  for (std::size_t g = 0; g < kLanesAtOnce / 4; ++g) {
    Four x[4];
    for (std::size_t i = 0; i < 4; ++i) x[i] = PartOf(from[i], g);
    Transpose(x);
    for (std::size_t l = 0; l < 4; ++l)
      if (to[4 * g + l] != nullptr) hn::StoreU(x[l], Fours(), to[4 * g + l] + at);
  }
}
#endif

/// Both bodies of the pairs in some lanes: what of their coordinates the contacts see and move. Origins are seen by
/// their difference, in displacements: w = root_a y_a − root_b y_b.
struct Sides {
  Vector apart[3];    // w
  Vector parted[3];   // Σ of forces, world: what w came by less
  Vector turn[2][3];  // coordinates
  Vector rate[3];     // root_a² + root_b²
};

HWY_INLINE HWY_ATTR void ReadSides(const PairBundle& bundle, const std::int32_t (*at)[kBundleLanes], const Block8* y,
                                   std::size_t lane, Sides& sides) {
  const Lanes d;
  for (std::size_t i = 0; i < 3; ++i) sides.apart[i] = sides.parted[i] = sides.rate[i] = hn::Zero(d);
  for (std::size_t s = 0; s < 2; ++s) {
    const float* from[kLanesAtOnce];
    for (std::size_t l = 0; l < kLanesAtOnce; ++l) from[l] = y[at[s][lane + l]].v;
    Vector v[8];
    Gather4(from, 0, v);
    Gather4(from, 4, v + 4);
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector root = Get(bundle.root[s][i], lane);
      sides.rate[i] = hn::MulAdd(root, root, sides.rate[i]);
      sides.apart[i] = s == 0 ? hn::Mul(root, v[i]) : hn::NegMulAdd(root, v[i], sides.apart[i]);
      sides.turn[s][i] = v[3 + i];
    }
  }
}

HWY_INLINE HWY_ATTR void WriteSides(const PairBundle& bundle, const std::int32_t (*at)[kBundleLanes],
                                    std::int32_t standing, Block8* y, std::size_t lane, const Sides& sides) {
  const Lanes d;
  for (std::size_t s = 0; s < 2; ++s) {
    const float* from[kLanesAtOnce];
    float* to[kLanesAtOnce];
    for (std::size_t l = 0; l < kLanesAtOnce; ++l) {
      Block8& block = y[at[s][lane + l]];
      from[l] = block.v;
      to[l] = bundle.frame[s][lane + l] == standing ? nullptr : block.v;
    }
    Vector v[8];
    Gather4(from, 0, v);
    for (std::size_t i = 0; i < 3; ++i) {
      const Vector root = Get(bundle.root[s][i], lane);
      v[i] = s == 0 ? hn::MulAdd(root, sides.parted[i], v[i]) : hn::NegMulAdd(root, sides.parted[i], v[i]);
      v[3 + i] = sides.turn[s][i];
    }
    v[6] = v[7] = hn::Zero(d);
    Scatter4(v, to, 0);
    Scatter4(v + 4, to, 4);
  }
}

/// The modes of both bodies, in the lanes that have any: a vector a mode, in the arrays' room.
struct Modes {
  Modes(const BundleArrays& all, const PairBundle& bundle)
      : y{all.room->v, all.room->v + static_cast<std::size_t>(bundle.modes[0]) * kLanesAtOnce} {}
  float* of(std::size_t side, std::int32_t mode) const {
    return y[side] + static_cast<std::size_t>(mode) * kLanesAtOnce;
  }
  float* y[2];
};

HWY_INLINE HWY_ATTR void ReadModes(const BundleArrays& all, const PairBundle& bundle, const Block8* y, std::size_t lane,
                                   const Modes& modes) {
  for (std::size_t s = 0; s < 2; ++s)
    for (std::int32_t k = 0; 8 * k < bundle.modes[s]; ++k) {
      const float* from[kLanesAtOnce];
      for (std::size_t l = 0; l < kLanesAtOnce; ++l)
        from[l] = y[bundle.blocks[s][lane + l] > k ? bundle.motion[s][lane + l] + 1 + k : all.zeros].v;
      Vector v[8];
      Gather4(from, 0, v);
      Gather4(from, 4, v + 4);
      for (std::int32_t i = 0; i < 8; ++i) hn::Store(v[i], Lanes(), modes.of(s, 8 * k + i));
    }
}

HWY_INLINE HWY_ATTR void WriteModes(const PairBundle& bundle, Block8* y, std::size_t lane, const Modes& modes) {
  for (std::size_t s = 0; s < 2; ++s)
    for (std::int32_t k = 0; 8 * k < bundle.modes[s]; ++k) {
      float* to[kLanesAtOnce];
      for (std::size_t l = 0; l < kLanesAtOnce; ++l)
        to[l] = bundle.blocks[s][lane + l] > k ? y[bundle.motion[s][lane + l] + 1 + k].v : nullptr;
      Vector v[8];
      for (std::int32_t i = 0; i < 8; ++i) v[i] = hn::Load(Lanes(), modes.of(s, 8 * k + i));
      Scatter4(v, to, 0);
      Scatter4(v + 4, to, 4);
    }
}

/// All coordinates of both bodies.
struct Coordinates {
  Coordinates(const BundleArrays& all, const PairBundle& bundle) : modes(all, bundle) {}
  Sides sides;
  Modes modes;
};

HWY_INLINE HWY_ATTR void ReadCoordinates(const BundleArrays& all, const PairBundle& bundle, const Block8* motion,
                                         std::size_t lane, Coordinates& y) {
  ReadSides(bundle, bundle.motion, motion, lane, y.sides);
  ReadModes(all, bundle, motion, lane, y.modes);
}

HWY_INLINE HWY_ATTR void WriteCoordinates(const BundleArrays& all, const PairBundle& bundle, Block8* motion,
                                          std::size_t lane, const Coordinates& y) {
  WriteSides(bundle, bundle.motion, all.standing, motion, lane, y.sides);
  WriteModes(bundle, motion, lane, y.modes);
}

/// The modes' rows of contact k of a bundle.
HWY_INLINE HWY_ATTR Block8* RowsOf(const BundleArrays& all, const PairBundle& bundle, std::int32_t k) {
  return all.rows + bundle.rows + 3 * k * (bundle.modes[0] + bundle.modes[1]);
}

/// Adds what the modes give to the rows' numbers of the first axes.
HWY_INLINE HWY_ATTR void AddModes(const PairBundle& bundle, const Block8* rows, std::size_t axes, const Modes& modes,
                                  std::size_t lane, Vector* u) {
  for (std::size_t s = 0; s < 2; ++s)
    for (std::int32_t i = 0; i < bundle.modes[s]; ++i, rows += 3)
      for (std::size_t axis = 0; axis < axes; ++axis)
        u[axis] = hn::MulAdd(Get(rows[axis], lane), hn::Load(Lanes(), modes.of(s, i)), u[axis]);
}

HWY_INLINE HWY_ATTR void MoveModes(const PairBundle& bundle, const Block8* rows, std::size_t axes, const Vector* by,
                                   std::size_t lane, const Modes& modes) {
  for (std::size_t s = 0; s < 2; ++s)
    for (std::int32_t i = 0; i < bundle.modes[s]; ++i, rows += 3) {
      Vector y = hn::Load(Lanes(), modes.of(s, i));
      for (std::size_t axis = 0; axis < axes; ++axis) y = hn::MulAdd(by[axis], Get(rows[axis], lane), y);
      hn::Store(y, Lanes(), modes.of(s, i));
    }
}

/// The row's number for the frames as they are.
HWY_INLINE HWY_ATTR Vector ReadAxis(const BundleContact& c, std::size_t axis, const Sides& sides, std::size_t lane) {
  Vector u = hn::Mul(Get(c.axes[axis][0], lane), sides.apart[0]);
  for (std::size_t i = 1; i < 3; ++i) u = hn::MulAdd(Get(c.axes[axis][i], lane), sides.apart[i], u);
  return AddDot(c.turn[1][axis], sides.turn[1], AddDot(c.turn[0][axis], sides.turn[0], u, lane), lane);
}

HWY_INLINE HWY_ATTR void MoveSides(const BundleContact& c, std::size_t axes, const Vector* by, Sides& sides,
                                   std::size_t lane) {
  for (std::size_t i = 0; i < 3; ++i) {
    Vector force = hn::Mul(by[0], Get(c.axes[0][i], lane));
    for (std::size_t axis = 1; axis < axes; ++axis) force = hn::MulAdd(by[axis], Get(c.axes[axis][i], lane), force);
    sides.apart[i] = hn::MulAdd(sides.rate[i], force, sides.apart[i]);
    sides.parted[i] = hn::Add(sides.parted[i], force);
    for (std::size_t s = 0; s < 2; ++s)
      for (std::size_t axis = 0; axis < axes; ++axis)
        sides.turn[s][i] = hn::MulAdd(by[axis], Get(c.turn[s][axis][i], lane), sides.turn[s][i]);
  }
}

/// The numbers of a contact's first rows for the coordinates as they are: of the normal's, or of all three.
HWY_INLINE HWY_ATTR void ReadRows(const PairBundle& bundle, const BundleContact& c, const Block8* rows,
                                  std::size_t axes, const Coordinates& y, std::size_t lane, Vector* u) {
  for (std::size_t axis = 0; axis < axes; ++axis) u[axis] = ReadAxis(c, axis, y.sides, lane);
  AddModes(bundle, rows, axes, y.modes, lane, u);
}

/// What changes of these rows' forces move.
HWY_INLINE HWY_ATTR void MoveCoordinates(const PairBundle& bundle, const BundleContact& c, const Block8* rows,
                                         std::size_t axes, const Vector* by, std::size_t lane, Coordinates& y) {
  MoveSides(c, axes, by, y.sides, lane);
  MoveModes(bundle, rows, axes, by, lane, y.modes);
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
