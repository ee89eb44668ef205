#include "bundle_kernels.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "game/bundle_kernels.cpp"
// Arrays of vectors cannot be formed of vectors of a length unknown to the compiler: those machines run the fixed
// 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
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

/// The modes of both bodies, in the lanes that have any: a vector a mode, in the memory of a function or in a bundle's.
constexpr std::int32_t kModesAtHand = 64;
struct ModesAtHand {
  alignas(32) float v[kModesAtHand * kLanesAtOnce];
};
struct Modes {
  Modes(const BundleArrays& all, const PairBundle& bundle, ModesAtHand& at_hand) {
    y[0] = bundle.modes[0] + bundle.modes[1] <= kModesAtHand ? at_hand.v : all.room[bundle.room].v;
    y[1] = y[0] + static_cast<std::size_t>(bundle.modes[0]) * kLanesAtOnce;
  }
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
  Coordinates(const BundleArrays& all, const PairBundle& bundle) : modes(all, bundle, at_hand) {}
  Sides sides;
  ModesAtHand at_hand;
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

/// Adds what the modes give to the three rows' numbers.
HWY_INLINE HWY_ATTR void AddModes(const PairBundle& bundle, const Block8* rows, const Modes& modes, std::size_t lane,
                                  Vector* u) {
  for (std::size_t s = 0; s < 2; ++s)
    for (std::int32_t i = 0; i < bundle.modes[s]; ++i, rows += 3)
      for (std::size_t axis = 0; axis < 3; ++axis)
        u[axis] = hn::MulAdd(Get(rows[axis], lane), hn::Load(Lanes(), modes.of(s, i)), u[axis]);
}

HWY_INLINE HWY_ATTR void MoveModes(const PairBundle& bundle, const Block8* rows, const Vector* by, std::size_t lane,
                                   const Modes& modes) {
  for (std::size_t s = 0; s < 2; ++s)
    for (std::int32_t i = 0; i < bundle.modes[s]; ++i, rows += 3) {
      Vector y = hn::Load(Lanes(), modes.of(s, i));
      for (std::size_t axis = 0; axis < 3; ++axis) y = hn::MulAdd(by[axis], Get(rows[axis], lane), y);
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

/// The three rows' numbers for the coordinates as they are.
HWY_INLINE HWY_ATTR void ReadRows(const PairBundle& bundle, const BundleContact& c, const Block8* rows,
                                  const Coordinates& y, std::size_t lane, Vector* u) {
  for (std::size_t axis = 0; axis < 3; ++axis) u[axis] = ReadAxis(c, axis, y.sides, lane);
  AddModes(bundle, rows, y.modes, lane, u);
}

/// What changes of the three forces move.
HWY_INLINE HWY_ATTR void MoveCoordinates(const PairBundle& bundle, const BundleContact& c, const Block8* rows,
                                         const Vector* by, std::size_t lane, Coordinates& y) {
  MoveSides(c, 3, by, y.sides, lane);
  MoveModes(bundle, rows, by, lane, y.modes);
}

/// How much is left open along the normal: at most 0 where the law is met.
HWY_INLINE HWY_ATTR Vector Approach(const BundleContact& c, Vector u, std::size_t lane) {
  const Vector open = hn::Sub(Get(c.target, lane), hn::Add(u, Get(c.gap, lane)));
  const Vector change = hn::Sub(Get(c.force[0], lane), Get(c.before, lane));
  return hn::NegMulAdd(Get(c.compliance, lane), change, open);
}

/// The share of a vector that is no longer than `most`. Squares of small numbers vanish: then the share errs to less.
HWY_INLINE HWY_ATTR Vector ShareWithin(Vector square, Vector most) {
  const Lanes d;
  const Vector length = hn::Sqrt(hn::Max(square, hn::Set(d, std::numeric_limits<float>::min())));
  return hn::IfThenElse(hn::Lt(square, hn::Mul(most, most)), hn::Set(d, 1.0f), hn::Div(most, length));
}

/// The force that meets a normal's law, `plain` the one of either sign that leaves nothing open: the larger of that and
/// the f > 0 with f (u − fall) = 2 release, u what it opens the gap by.
HWY_INLINE HWY_ATTR Vector NormalForce(const BundleContact& c, Vector plain, std::size_t lane) {
  const Lanes d;
  const Vector mass = Get(c.inverse_normal, lane), zero = hn::Zero(d);
  const Vector lifted = hn::MulAdd(mass, Get(c.fall, lane), plain);
  const Vector energy = hn::Mul(hn::Set(d, 8.0f), hn::Mul(Get(c.release, lane), mass));
  const Vector root = hn::Mul(hn::Set(d, 0.5f), hn::Add(lifted, hn::Sqrt(hn::MulAdd(lifted, lifted, energy))));
  return hn::Max(plain, hn::IfThenElse(hn::Gt(energy, zero), root, zero));
}

/// @param u the rows' numbers. @param change out: of the forces
HWY_INLINE HWY_ATTR void SolveOne(const PairBundle& bundle, BundleContact& c, const Vector* u, std::size_t lane,
                                  Vector* change) {
  const Lanes d;
  const Vector zero = hn::Zero(d), before = Get(c.force[0], lane);
  Vector wanted[2];
  const Vector plain = hn::MulAdd(Approach(c, u[0], lane), Get(c.inverse_normal, lane), before);
  const Vector normal = bundle.rebounds ? NormalForce(c, plain, lane) : hn::Max(zero, plain);
  change[0] = hn::Sub(normal, before);
  for (std::size_t t = 0; t < 2; ++t) {
    const Vector slip = hn::Add(u[1 + t], Get(c.slip[t], lane));
    wanted[t] = hn::NegMulAdd(Get(c.inverse_tangent, lane), hn::MulAdd(Get(c.coupling[t], lane), change[0], slip),
                              Get(c.force[1 + t], lane));
  }
  const Vector square = hn::MulAdd(wanted[0], wanted[0], hn::Mul(wanted[1], wanted[1]));
  const Vector most = hn::IfThenElseZero(hn::Gt(normal, zero), hn::Mul(Get(c.friction, lane), normal));
  const Vector share = ShareWithin(square, most);
  Put(normal, c.force[0], lane);
  for (std::size_t t = 0; t < 2; ++t) {
    const Vector tangent = hn::Mul(share, wanted[t]);
    change[1 + t] = hn::Sub(tangent, Get(c.force[1 + t], lane));
    Put(tangent, c.force[1 + t], lane);
  }
}

/// Moves what turns by moments about the world's axes.
HWY_INLINE HWY_ATTR void TurnSides(const PairBundle& bundle, const Vector* by, Sides& sides, std::size_t lane) {
  const Vector against[3] = {hn::Neg(by[0]), hn::Neg(by[1]), hn::Neg(by[2])};
  for (std::size_t s = 0; s < 2; ++s)
    for (std::size_t i = 0; i < 3; ++i)
      sides.turn[s][i] = AddDot(bundle.scale[s][i], s == 0 ? by : against, sides.turn[s][i], lane);
}

/// Resistance to rolling and spinning, after the forces: of no radius, no moment.
HWY_INLINE HWY_ATTR void RollOne(const PairBundle& bundle, BundleContact& c, Sides& sides, std::size_t lane) {
  const Lanes d;
  Vector wanted[3], change[3], square = hn::Zero(d);
  for (std::size_t i = 0; i < 3; ++i) {
    Vector turn = hn::Zero(d);
    for (std::size_t k = 0; k < 3; ++k) {
      turn = hn::MulAdd(Get(bundle.scale[0][k][i], lane), sides.turn[0][k], turn);
      turn = hn::NegMulAdd(Get(bundle.scale[1][k][i], lane), sides.turn[1][k], turn);
    }
    wanted[i] = hn::NegMulAdd(Get(bundle.inverse_turn, lane), turn, Get(c.moment[i], lane));
    square = hn::MulAdd(wanted[i], wanted[i], square);
  }
  const Vector most = hn::Mul(Get(c.radius, lane), Get(c.force[0], lane));
  const Vector share = ShareWithin(square, most);
  for (std::size_t i = 0; i < 3; ++i) {
    const Vector moment = hn::Mul(share, wanted[i]);
    change[i] = hn::Sub(moment, Get(c.moment[i], lane));
    Put(moment, c.moment[i], lane);
  }
  TurnSides(bundle, change, sides, lane);
}

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
  AddModes(bundle, rows, shapes, lane, bent);
  Put(hn::Sub(Get(c.rest, lane), bent[0]), c.rest, lane);
}

HWY_ATTR void MakeModeRows(const ModePoint& point, Block8* rows) {
  const Lanes d;
  for (std::size_t k = 0; k < point.blocks; ++k, rows += 3)
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      const std::size_t mode = 8 * k + lane;
      const Vector root = hn::LoadU(d, point.roots + mode);
      Vector shape[3];
      for (std::size_t i = 0; i < 3; ++i) {
        shape[i] = hn::Mul(hn::Set(d, point.weight[0]), hn::LoadU(d, point.rows[0][i] + mode));
        for (std::size_t c = 1; c < 3; ++c)
          shape[i] = hn::MulAdd(hn::Set(d, point.weight[c]), hn::LoadU(d, point.rows[c][i] + mode), shape[i]);
        shape[i] = hn::Mul(root, shape[i]);
      }
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const float* n = point.axes[axis];
        const Vector sum = hn::MulAdd(hn::Set(d, n[1]), shape[1],
                                      hn::MulAdd(hn::Set(d, n[2]), shape[2], hn::Mul(hn::Set(d, n[0]), shape[0])));
        Put(sum, rows[axis], lane);
      }
    }
}

HWY_ATTR void MakeBundleRows(const BundleArrays& all, const Block8* shapes) {
  for (std::size_t b = 0; b < all.count; ++b) {
    const PairBundle& bundle = all.bundles[b];
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      ModesAtHand at_hand;
      const Modes modes(all, bundle, at_hand);
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

/// As PairBundle has them.
struct Works {
  Vector open, yielded, given;
};

HWY_INLINE HWY_ATTR void AddWorks(const BundleContact& c, std::size_t lane, Works& works) {
  const Vector force = Get(c.force[0], lane), compliance = Get(c.compliance, lane);
  const Vector before = Get(c.before, lane), kept = hn::Mul(hn::Set(Lanes(), 0.5f), hn::Mul(compliance, before));
  const Vector came = hn::Sub(Get(c.gap, lane), hn::Min(Get(c.now, lane), hn::Zero(Lanes())));
  works.open = hn::MulAdd(force, came, works.open);
  for (std::size_t t = 0; t < 2; ++t)
    works.open = hn::MulAdd(Get(c.force[1 + t], lane), Get(c.slip[t], lane), works.open);
  works.yielded = hn::MulAdd(hn::Mul(compliance, force), force, works.yielded);
  works.given = hn::MulAdd(kept, before, hn::Add(works.given, Get(c.release, lane)));
}

HWY_INLINE HWY_ATTR void AddUp(BundleContact& c, std::size_t lane) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    Put(hn::Add(Get(c.sum[axis], lane), Get(c.force[axis], lane)), c.sum[axis], lane);
}

HWY_ATTR void SweepBundles(const BundleArrays& all, bool backward, Block8* motion) {
  const Lanes d;
  for (std::size_t i = 0; i < all.count; ++i) {
    PairBundle& bundle = all.bundles[backward ? all.count - 1 - i : i];
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Works works{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
      Coordinates y(all, bundle);
      ReadCoordinates(all, bundle, motion, lane, y);
      for (std::int32_t j = 0; j < bundle.count; ++j) {
        const std::int32_t k = backward ? bundle.count - 1 - j : j;
        BundleContact& c = all.contacts[bundle.first + k];
        const Block8* rows = RowsOf(all, bundle, k);
        Vector u[3], change[3];
        ReadRows(bundle, c, rows, y, lane, u);
        SolveOne(bundle, c, u, lane, change);
        MoveCoordinates(bundle, c, rows, change, lane, y);
        if (bundle.rolls) RollOne(bundle, c, y.sides, lane);
        if (backward)
          AddUp(c, lane);
        else
          AddWorks(c, lane, works);
      }
      WriteCoordinates(all, bundle, motion, lane, y);
      if (backward) continue;
      Put(works.open, bundle.open, lane);
      Put(works.yielded, bundle.yielded, lane);
      Put(works.given, bundle.given, lane);
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
HWY_INLINE HWY_ATTR bool MeasureOne(BundleContact& c, const Vector (*frames)[12], const Vector* bent, float share,
                                    float most, std::size_t lane) {
  const Lanes d;
  const Vector zero = hn::Zero(d);
  Vector apart[3];
  Travel(c, frames, lane, apart);
  const Vector straight = AddDot(c.axes[0], apart, Get(c.rest, lane), lane), force = Get(c.force[0], lane);
  const Vector now = hn::Add(straight, bent[0]);
  const Vector yields = hn::Mul(Get(c.compliance, lane), force), gap = hn::Add(now, yields);
  const Vector part = hn::Min(hn::Mul(hn::Set(d, share), hn::Neg(hn::Add(gap, Get(c.slop, lane)))), hn::Set(d, most));
  Put(now, c.now, lane);
  Put(straight, c.gap, lane);
  for (std::size_t t = 0; t < 2; ++t) Put(hn::Sub(Get(c.running[t], lane), bent[1 + t]), c.slip[t], lane);
  Put(hn::Sub(hn::Min(gap, zero), yields), c.target, lane);
  Put(force, c.before, lane);
  Put(zero, c.push, lane);
  Put(part, c.part, lane);
  return !hn::AllTrue(d, hn::Le(part, zero));
}

HWY_ATTR void MeasureBundles(const BundleArrays& all, const FrameShift* frames, const Block8* shapes, float share,
                             float most) {
  const Lanes d;
  for (std::size_t b = 0; b < all.count; ++b) {
    PairBundle& bundle = all.bundles[b];
    bundle.overlaps = false;
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Vector come[2][12];
      ReadShifts(bundle, frames, &FrameShift::shift, lane, come);
      ModesAtHand at_hand;
      const Modes modes(all, bundle, at_hand);
      ReadModes(all, bundle, shapes, lane, modes);
      for (std::int32_t k = 0; k < bundle.count; ++k) {
        Vector bent[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
        AddModes(bundle, RowsOf(all, bundle, k), modes, lane, bent);
        if (MeasureOne(all.contacts[bundle.first + k], come, bent, share, most, lane)) bundle.overlaps = true;
      }
      if (bundle.carried) AddCarried(all, bundle, frames, lane);
    }
  }
}

HWY_INLINE HWY_ATTR void PushOne(BundleContact& c, Sides& sides, std::size_t lane) {
  const Lanes d;
  const Vector zero = hn::Zero(d), part = Get(c.part, lane), before = Get(c.push, lane);
  const Vector open = hn::Sub(part, ReadAxis(c, 0, sides, lane));
  const Vector push = hn::Max(zero, hn::MulAdd(open, Get(c.inverse_push, lane), before));
  const Vector change = hn::IfThenElseZero(hn::Gt(part, zero), hn::Sub(push, before));
  Put(hn::Add(before, change), c.push, lane);
  MoveSides(c, 1, &change, sides, lane);
}

HWY_ATTR void PushBundles(const BundleArrays& all, bool backward, Block8* pushes) {
  for (std::size_t i = 0; i < all.count; ++i) {
    const PairBundle& bundle = all.bundles[backward ? all.count - 1 - i : i];
    for (std::size_t lane = 0; lane < kBundleLanes && bundle.overlaps; lane += kLanesAtOnce) {
      Sides sides;
      ReadSides(bundle, bundle.frame, pushes, lane, sides);
      for (std::int32_t k = 0; k < bundle.count; ++k)
        PushOne(all.contacts[bundle.first + (backward ? bundle.count - 1 - k : k)], sides, lane);
      WriteSides(bundle, bundle.frame, all.standing, pushes, lane, sides);
    }
  }
}

HWY_ATTR void FindResiduals(const BundleArrays& all, const Block8* motion) {
  const Lanes d;
  for (std::size_t b = 0; b < all.count; ++b) {
    PairBundle& bundle = all.bundles[b];
    Vector largest = hn::Zero(d);
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Coordinates y(all, bundle);
      ReadCoordinates(all, bundle, motion, lane, y);
      for (std::int32_t k = 0; k < bundle.count; ++k) {
        const BundleContact& c = all.contacts[bundle.first + k];
        Vector u[3];
        ReadRows(bundle, c, RowsOf(all, bundle, k), y, lane, u);
        const Vector approach = Approach(c, u[0], lane);
        const auto presses = hn::Gt(Get(c.force[0], lane), hn::Zero(d));
        const auto is_there = hn::Gt(Get(c.inverse_normal, lane), hn::Zero(d));
        const Vector left = hn::IfThenElseZero(is_there, hn::IfThenElse(presses, hn::Abs(approach), approach));
        largest = hn::Max(largest, left);
      }
    }
    bundle.residual = hn::GetLane(hn::MaxOfLanes(d, largest));
  }
}

HWY_ATTR void ApplyBundleForces(const BundleArrays& all, Block8* motion) {
  for (std::size_t b = 0; b < all.count; ++b) {
    const PairBundle& bundle = all.bundles[b];
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Coordinates y(all, bundle);
      ReadCoordinates(all, bundle, motion, lane, y);
      for (std::int32_t k = 0; k < bundle.count; ++k) {
        const BundleContact& c = all.contacts[bundle.first + k];
        const Vector by[3] = {Get(c.force[0], lane), Get(c.force[1], lane), Get(c.force[2], lane)};
        MoveCoordinates(bundle, c, RowsOf(all, bundle, k), by, lane, y);
        const Vector moment[3] = {Get(c.moment[0], lane), Get(c.moment[1], lane), Get(c.moment[2], lane)};
        if (bundle.rolls) TurnSides(bundle, moment, y.sides, lane);
      }
      WriteCoordinates(all, bundle, motion, lane, y);
    }
  }
}

HWY_ATTR void ScaleBundleForces(const BundleArrays& all, const Block8* shares) {
  for (std::size_t b = 0; b < all.count; ++b)
    for (std::int32_t k = 0; k < all.bundles[b].count; ++k) {
      BundleContact& c = all.contacts[all.bundles[b].first + k];
      for (std::size_t axis = 0; axis < 3; ++axis)
        for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
          Put(hn::Mul(Get(shares[b], lane), Get(c.force[axis], lane)), c.force[axis], lane);
          Put(hn::Mul(Get(shares[b], lane), Get(c.moment[axis], lane)), c.moment[axis], lane);
        }
    }
}

/// @param start, end the normal's numbers by the free motion and by that found, less what carries bodies
HWY_INLINE HWY_ATTR void NoteOne(BundleContact& c, Vector start, Vector end, std::size_t lane) {
  const Lanes d;
  const Vector carried = hn::Sub(Get(c.gap, lane), Get(c.now, lane));  // of rigid bodies, which do not bend
  const Vector zero = hn::Zero(d), stage = Get(c.stage, lane), together = hn::Set(d, kTogether),
               parted = hn::Set(d, kParted);
  const Vector mean = hn::MulAdd(hn::Set(d, 2.0f), hn::Sub(carried, Get(c.fall, lane)), hn::Add(start, end));
  const Vector given = hn::Mul(hn::Set(d, 0.5f), hn::Mul(Get(c.force[0], lane), mean));
  // Contacts without a rebound, beside one that has it, stay open.
  const auto presses = hn::And(hn::Gt(Get(c.rebound, lane), zero), hn::Gt(Get(c.force[0], lane), zero));
  const auto is_between = hn::And(hn::Gt(stage, zero), hn::Lt(stage, parted));
  const Vector next =
      hn::IfThenElseZero(hn::Or(presses, is_between), hn::Min(hn::Add(stage, hn::Set(d, 1.0f)), parted));
  const Vector left = hn::Max(zero, hn::Sub(Get(c.energy, lane), given));
  const Vector kept = hn::IfThenElse(hn::Eq(next, together), hn::Mul(Get(c.rebound, lane), left), left);
  const Vector energy = hn::IfThenElseZero(hn::And(hn::Gt(next, zero), hn::Lt(next, parted)), kept);
  Put(next, c.stage, lane);
  Put(energy, c.energy, lane);
  Put(hn::IfThenElseZero(hn::Ge(next, together), energy), c.release, lane);
}

HWY_ATTR void NoteBundleRebounds(const BundleArrays& all, const Block8* free, const Block8* motion) {
  for (std::size_t b = 0; b < all.count; ++b) {
    const PairBundle& bundle = all.bundles[b];
    for (std::size_t lane = 0; lane < kBundleLanes && bundle.rebounds; lane += kLanesAtOnce) {
      Sides start, end;
      ReadSides(bundle, bundle.motion, free, lane, start);
      ReadSides(bundle, bundle.motion, motion, lane, end);
      for (std::int32_t k = 0; k < bundle.count; ++k) {
        BundleContact& c = all.contacts[bundle.first + k];
        NoteOne(c, ReadAxis(c, 0, start, lane), ReadAxis(c, 0, end, lane), lane);
      }
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
HWY_EXPORT(SweepBundles);
HWY_EXPORT(PushBundles);
HWY_EXPORT(FindResiduals);
HWY_EXPORT(ApplyBundleForces);
HWY_EXPORT(ScaleBundleForces);
HWY_EXPORT(NoteBundleRebounds);

void make_mode_rows(const ModePoint& point, Block8* rows) { HWY_DYNAMIC_DISPATCH(MakeModeRows)(point, rows); }

void make_bundle_rows(const BundleArrays& bundles, const Block8* shapes) {
  HWY_DYNAMIC_DISPATCH(MakeBundleRows)(bundles, shapes);
}

void measure_bundles(const BundleArrays& bundles, const FrameShift* frames, const Block8* shapes, float share,
                     float most) {
  HWY_DYNAMIC_DISPATCH(MeasureBundles)(bundles, frames, shapes, share, most);
}

void sweep_bundles(const BundleArrays& bundles, bool backward, Block8* motion) {
  HWY_DYNAMIC_DISPATCH(SweepBundles)(bundles, backward, motion);
}

void push_bundles(const BundleArrays& bundles, bool backward, Block8* pushes) {
  HWY_DYNAMIC_DISPATCH(PushBundles)(bundles, backward, pushes);
}

void find_residuals(const BundleArrays& bundles, const Block8* motion) {
  HWY_DYNAMIC_DISPATCH(FindResiduals)(bundles, motion);
}

void apply_bundle_forces(const BundleArrays& bundles, Block8* motion) {
  HWY_DYNAMIC_DISPATCH(ApplyBundleForces)(bundles, motion);
}

void scale_bundle_forces(const BundleArrays& bundles, const Block8* shares) {
  HWY_DYNAMIC_DISPATCH(ScaleBundleForces)(bundles, shares);
}

void note_bundle_rebounds(const BundleArrays& bundles, const Block8* free, const Block8* motion) {
  HWY_DYNAMIC_DISPATCH(NoteBundleRebounds)(bundles, free, motion);
}

}  // namespace limber::internal
#endif
