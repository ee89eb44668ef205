#include "frame_kernels.h"

#include <limits>
#include <numbers>

#include "../tuning.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "game/frame_kernels.cpp"
// Arrays of vectors, as in bundle_sweep_kernels.cpp.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Doubles = hn::CappedTag<double, kFramesAtOnce>;
using Wide = hn::Vec<Doubles>;
using Singles = hn::Rebind<float, Doubles>;
constexpr std::size_t kDoubles = hn::MaxLanes(Doubles());
constexpr const SmallStepTuning& kTurns = kConstraintsTuning.small_steps;

HWY_INLINE HWY_ATTR Wide Get(const Double8& from, std::size_t lane) { return hn::Load(Doubles(), from.v + lane); }
HWY_INLINE HWY_ATTR void Put(Wide x, Double8& to, std::size_t lane) { hn::Store(x, Doubles(), to.v + lane); }
HWY_INLINE HWY_ATTR Wide Get(const Block8& from, std::size_t lane) {
  return hn::PromoteTo(Doubles(), hn::Load(Singles(), from.v + lane));
}
HWY_INLINE HWY_ATTR void Put(Wide x, Block8& to, std::size_t lane) {
  hn::Store(hn::DemoteTo(Singles(), x), Singles(), to.v + lane);
}

/// Of the bodies' lanes, which come first.
HWY_INLINE HWY_ATTR bool HasBody(const EightFrames& f, std::size_t lane) {
  return lane < kFramesAtOnce && f.first[lane] >= 0;
}

/// M x, or Mᵀ x.
HWY_INLINE HWY_ATTR void Multiply(const Double8 (&m)[3][3], bool transposed, const Wide* x, std::size_t lane,
                                  Wide* to) {
  for (std::size_t i = 0; i < 3; ++i) {
    to[i] = hn::Mul(transposed ? Get(m[0][i], lane) : Get(m[i][0], lane), x[0]);
    for (std::size_t j = 1; j < 3; ++j)
      to[i] = hn::MulAdd(transposed ? Get(m[j][i], lane) : Get(m[i][j], lane), x[j], to[i]);
  }
}

/// R x, or Rᵀ x.
HWY_INLINE HWY_ATTR void Turn(const Wide (*R)[3], bool back, const Wide* x, Wide* to) {
  for (std::size_t i = 0; i < 3; ++i)
    to[i] = hn::MulAdd(back ? R[0][i] : R[i][0], x[0],
                       hn::MulAdd(back ? R[1][i] : R[i][1], x[1], hn::Mul(back ? R[2][i] : R[i][2], x[2])));
}

/// base + scale (a × b).
HWY_INLINE HWY_ATTR void AddCross(const Wide* base, Wide scale, const Wide* a, const Wide* b, Wide* to) {
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    to[i] = hn::MulAdd(scale, hn::NegMulAdd(a[k], b[j], hn::Mul(a[j], b[k])), base[i]);
  }
}

/// R of unit quaternions.
HWY_INLINE HWY_ATTR void Rotation(const Wide* q, Wide (*R)[3]) {
  const Doubles d;
  const Wide one = hn::Set(d, 1.0);
  Wide twice[3];
  for (std::size_t i = 0; i < 3; ++i) twice[i] = hn::Add(q[1 + i], q[1 + i]);
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    R[i][i] = hn::NegMulAdd(twice[k], q[1 + k], hn::NegMulAdd(twice[j], q[1 + j], one));
    const Wide product = hn::Mul(twice[i], q[1 + j]), spin = hn::Mul(twice[k], q[0]);
    R[i][j] = hn::Sub(product, spin);
    R[j][i] = hn::Add(product, spin);
  }
}

/// a b.
HWY_INLINE HWY_ATTR void Product(const Wide* a, const Wide* b, Wide* to) {
  to[0] = hn::NegMulAdd(a[1], b[1], hn::NegMulAdd(a[2], b[2], hn::NegMulAdd(a[3], b[3], hn::Mul(a[0], b[0]))));
  for (std::size_t i = 0; i < 3; ++i) {
    const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
    const Wide sum = hn::MulAdd(a[0], b[1 + i], hn::Mul(a[1 + i], b[0]));
    to[1 + i] = hn::NegMulAdd(a[1 + k], b[1 + j], hn::MulAdd(a[1 + j], b[1 + k], sum));
  }
}

/// The series first! (1/first! − x/(first + 2)! + …) to round-off up to 1, in pairs of terms: none waits for all
/// others.
HWY_INLINE HWY_ATTR Wide Series(double first, Wide x) {
  constexpr std::size_t kPairs = 4;
  const Doubles d;
  Wide pair[kPairs];
  double factor = 1.0, n = first;
  const auto next = [&] { return n += 2.0, factor /= -n * (n - 1.0); };
  for (std::size_t i = 0; i < kPairs; ++i) {
    const Wide even = hn::Set(d, i == 0 ? 1.0 : next());
    pair[i] = hn::MulAdd(hn::Set(d, next()), x, even);
  }
  const Wide square = hn::Mul(x, x), fourth = hn::Mul(square, square);
  const Wide rest = hn::MulAdd(hn::Set(d, next()), fourth, hn::MulAdd(pair[3], square, pair[2]));
  return hn::MulAdd(rest, fourth, hn::MulAdd(pair[1], square, pair[0]));
}

/// The same rotations, by 2π at most. Of angles beyond 1e16 nothing is known but round-off, which the bounds keep
/// there.
HWY_INLINE HWY_ATTR void TakeOffWholeTurns(Wide* r) {
  constexpr double kTurn = 2.0 * std::numbers::pi;
  const Doubles d;
  Wide square = hn::Mul(r[0], r[0]);
  for (std::size_t i = 1; i < 3; ++i) square = hn::MulAdd(r[i], r[i], square);
  const Wide angle = hn::Sqrt(square), per_two_turns = hn::Set(d, 0.5 / kTurn);
  const Wide rest = hn::NegMulAdd(hn::Round(hn::Mul(angle, per_two_turns)), hn::Set(d, 2.0 * kTurn), angle);
  const Wide bounded = hn::Max(hn::Set(d, -kTurn), hn::Min(rest, hn::Set(d, kTurn)));
  const Wide part = hn::Div(bounded, hn::Max(angle, hn::Set(d, std::numeric_limits<double>::min())));
  for (std::size_t i = 0; i < 3; ++i) r[i] = hn::Mul(part, r[i]);
}

/// Quaternions of rotation vectors, which become no longer than 2π: those of their quarters, by the series of sine and
/// cosine, squared twice.
HWY_INLINE HWY_ATTR void Turned(Wide* r, Wide* q) {
  const Doubles d;
  TakeOffWholeTurns(r);
  Wide quarter[3], square = hn::Zero(d);
  for (std::size_t i = 0; i < 3; ++i) {
    quarter[i] = hn::Mul(hn::Set(d, 0.125), r[i]);
    square = hn::MulAdd(quarter[i], quarter[i], square);
  }
  q[0] = Series(0.0, square);
  const Wide sine = Series(1.0, square);
  for (std::size_t i = 0; i < 3; ++i) q[1 + i] = hn::Mul(sine, quarter[i]);
  for (int i = 0; i < 2; ++i) {
    const Wide w = q[0];
    q[0] = hn::Mul(w, w);
    for (std::size_t k = 1; k < 4; ++k) {
      q[0] = hn::NegMulAdd(q[k], q[k], q[0]);
      q[k] = hn::Mul(hn::Add(w, w), q[k]);
    }
  }
}

/// The same attitudes, of length 1.
HWY_INLINE HWY_ATTR void Normalise(Wide* q) {
  Wide square = hn::Mul(q[0], q[0]);
  for (std::size_t i = 1; i < 4; ++i) square = hn::MulAdd(q[i], q[i], square);
  const Wide per = hn::Div(hn::Set(Doubles(), 1.0), hn::Sqrt(square));
  for (std::size_t i = 0; i < 4; ++i) q[i] = hn::Mul(per, q[i]);
}

/// About the principal axes.
HWY_INLINE HWY_ATTR void InverseInertia(const EightFrames& f, std::size_t lane, Wide* inverse) {
  for (std::size_t i = 0; i < 3; ++i) {
    const Wide per = Get(f.per_turn[i], lane);
    inverse[i] = hn::Mul(per, per);
  }
}

/// m in the middle of a free turn that begins with it, in principal axes: m + a ω × m = its start, by Newton's method.
/// It is never longer than that.
HWY_INLINE HWY_ATTR void MiddleMomentum(const Wide* inverse, Wide a, const Wide* start, Wide* m) {
  const Doubles d;
  const Wide one = hn::Set(d, 1.0), least = hn::Set(d, std::numeric_limits<double>::min());
  Wide c[3], square = hn::Zero(d);
  for (std::size_t i = 0; i < 3; ++i) {
    c[i] = hn::Mul(a, hn::Sub(inverse[(i + 1) % 3], inverse[(i + 2) % 3]));
    m[i] = start[i], square = hn::MulAdd(start[i], start[i], square);
  }
  for (int step = 0; step < kTurns.turn_iterations; ++step) {
    Wide off[3], row[3][3], cofactor[3][3];
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      off[i] = hn::MulAdd(hn::Mul(c[i], m[j]), m[k], hn::Sub(m[i], start[i]));
      row[i][i] = one, row[i][j] = hn::Mul(c[i], m[k]), row[i][k] = hn::Mul(c[i], m[j]);
    }
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const std::size_t i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
        cofactor[i][j] = hn::NegMulAdd(row[i1][j2], row[i2][j1], hn::Mul(row[i1][j1], row[i2][j2]));
      }
    const Wide determinant = hn::MulAdd(row[0][0], cofactor[0][0],
                                        hn::MulAdd(row[0][1], cofactor[0][1], hn::Mul(row[0][2], cofactor[0][2])));
    const Wide by = hn::Div(one, hn::Max(determinant, hn::Set(d, kTurns.least_turn_pivot)));
    Wide length = hn::Zero(d);
    for (std::size_t i = 0; i < 3; ++i) {
      const Wide sum =
          hn::MulAdd(cofactor[0][i], off[0], hn::MulAdd(cofactor[1][i], off[1], hn::Mul(cofactor[2][i], off[2])));
      m[i] = hn::NegMulAdd(by, sum, m[i]);
      length = hn::MulAdd(m[i], m[i], length);
    }
    if (hn::AllTrue(d, hn::Le(length, square))) continue;
    const Wide within = hn::Sqrt(hn::Min(one, hn::Div(square, hn::Max(length, least))));
    for (std::size_t i = 0; i < 3; ++i) m[i] = hn::Mul(within, m[i]);
  }
}

/// Turns attitudes about which a momentum has more than an energy, given twice, to where it has that, as little as may
/// be: along the slope of the energy. In principal axes of attitudes. @param by the turn, in those
HWY_INLINE HWY_ATTR void LoseEnergy(const Wide* inverse, const Wide* m, Wide twice, Wide* by) {
  const Doubles d;
  const Wide zero = hn::Zero(d), one = hn::Set(d, 1.0), least = hn::Set(d, 1e-300);
  Wide square = zero, energy = zero;
  for (std::size_t i = 0; i < 3; ++i) square = hn::MulAdd(m[i], m[i], square);
  const Wide per = hn::Div(one, hn::Sqrt(hn::Max(square, least)));
  Wide u[3], slope[3], length = zero;
  for (std::size_t i = 0; i < 3; ++i)
    u[i] = hn::Mul(per, m[i]), energy = hn::MulAdd(hn::Mul(inverse[i], u[i]), u[i], energy);
  for (std::size_t i = 0; i < 3; ++i) {
    slope[i] = hn::Mul(u[i], hn::Sub(inverse[i], energy));
    length = hn::MulAdd(slope[i], slope[i], length);
  }
  const Wide q = hn::Sqrt(length), per_slope = hn::Div(one, hn::Max(q, least));
  Wide across = zero;
  for (std::size_t i = 0; i < 3; ++i)
    slope[i] = hn::Mul(per_slope, slope[i]), across = hn::MulAdd(hn::Mul(inverse[i], slope[i]), slope[i], across);
  // On the circle through m and its slope e(θ) = e − 2p sin²θ + q sin 2θ; the nearest tan θ with e(θ) = e + change.
  const Wide p = hn::Mul(hn::Set(d, 0.5), hn::Sub(energy, across));
  const Wide radius = hn::Sqrt(hn::MulAdd(p, p, length));
  const Wide asked = hn::Sub(hn::Mul(hn::Mul(hn::Set(d, 1.0 + kTurns.turn_digits), twice), hn::Mul(per, per)), energy);
  const Wide change = hn::Min(zero, hn::Max(asked, hn::Neg(hn::Add(radius, p))));
  const Wide root = hn::Sqrt(hn::Max(zero, hn::NegMulAdd(change, hn::MulAdd(hn::Set(d, 2.0), p, change), length)));
  const Wide tangent = hn::Div(change, hn::Max(hn::Add(q, root), least));
  const Wide cosine = hn::Div(one, hn::Sqrt(hn::MulAdd(tangent, tangent, one)));
  by[0] = hn::Add(one, cosine);
  const Wide sine = hn::Mul(tangent, cosine);
  const Wide none[3] = {zero, zero, zero};
  AddCross(none, sine, u, slope, by + 1);
}

/// Makes them unit quaternions: about a momentum, by what Cayley's map is short of the angle x: that by which a body
/// turns about it in the mean.
/// @param action x |L|
HWY_INLINE HWY_ATTR void TurnAbout(const Wide* momentum, Wide action, Wide* q) {
  const Doubles d;
  Wide square = hn::Set(d, 1e-300), r[3], by[4], less[4], more[4], to[4];
  for (std::size_t i = 0; i < 3; ++i) square = hn::MulAdd(momentum[i], momentum[i], square);
  const Wide per = hn::Div(action, square);
  for (std::size_t i = 0; i < 3; ++i) r[i] = hn::Mul(per, momentum[i]), less[1 + i] = hn::Mul(hn::Set(d, -0.5), r[i]);
  less[0] = hn::Set(d, 1.0);
  Turned(r, by);
  Product(by, less, more);
  Product(more, q, to);
  Normalise(to);
  for (std::size_t i = 0; i < 4; ++i) q[i] = to[i];
}

/// Attitudes after a free turn; between, quaternions are of any length. @param q before and after. @param momentum
/// world
HWY_INLINE HWY_ATTR void TurnFreely(const EightFrames& f, const Wide* momentum, Wide time, std::size_t lane, Wide* q) {
  const Doubles d;
  Wide R[3][3], body[3], start[3], m[3], inverse[3], spin[3], by[4], to[4], end[3];
  Rotation(q, R);
  Turn(R, true, momentum, body);
  Multiply(f.principal, true, body, lane, start);
  InverseInertia(f, lane, inverse);
  Wide twice = hn::Zero(d);
  for (std::size_t i = 0; i < 3; ++i) twice = hn::MulAdd(hn::Mul(inverse[i], start[i]), start[i], twice);
  const Wide half = hn::Mul(hn::Set(d, 0.5), time);
  MiddleMomentum(inverse, half, start, m);
  for (std::size_t i = 0; i < 3; ++i) spin[i] = hn::Mul(half, hn::Mul(inverse[i], m[i]));
  Multiply(f.principal, false, spin, lane, by + 1);
  by[0] = hn::Set(d, 1.0);
  Product(q, by, to);
  TurnAbout(momentum, hn::Mul(time, twice), to);
  Rotation(to, R);
  Turn(R, true, momentum, body);
  Multiply(f.principal, true, body, lane, end);
  Wide now = hn::Zero(d);
  for (std::size_t i = 0; i < 3; ++i) now = hn::MulAdd(hn::Mul(inverse[i], end[i]), end[i], now);
  const auto gains = hn::Gt(now, hn::Mul(hn::Set(d, 1.0 + kTurns.turn_digits), twice));
  for (std::size_t i = 0; i < 4; ++i) q[i] = to[i];
  if (hn::AllFalse(d, gains)) return;
  LoseEnergy(inverse, end, twice, by);
  for (std::size_t i = 0; i < 3; ++i) end[i] = hn::Neg(by[1 + i]);
  Multiply(f.principal, false, end, lane, by + 1);
  Product(q, by, to);
  Normalise(to);
  for (std::size_t i = 0; i < 4; ++i) q[i] = hn::IfThenElse(gains, to[i], q[i]);
}

HWY_INLINE HWY_ATTR void TurnLanes(EightFrames& f, double time, std::size_t lane) {
  const Doubles d;
  const auto turns = hn::Gt(Get(f.turns_axes, lane), hn::Zero(d));
  if (hn::AllFalse(d, turns)) return;
  Wide x[3], momentum[3], q[4], R[3][3], torque[3];
  for (std::size_t i = 0; i < 3; ++i) x[i] = Get(f.now.turn[i], lane), torque[i] = Get(f.loads.torque[i], lane);
  Multiply(f.momentum, true, x, lane, momentum);
  for (std::size_t i = 0; i < 4; ++i) q[i] = Get(f.now.attitude[i], lane);
  if (time > 0.0) TurnFreely(f, momentum, hn::Set(d, 0.5 * time), lane, q);
  Rotation(q, R);
  for (std::size_t i = 0; i < 3; ++i) {
    const Wide root = Get(f.roots[i], lane), per = Get(f.per_turn[i], lane);
    Wide turn = hn::Zero(d), gain = hn::Zero(d);
    for (std::size_t j = 0; j < 3; ++j) {
      const Wide axis =
          hn::MulAdd(R[j][0], Get(f.principal[0][i], lane),
                     hn::MulAdd(R[j][1], Get(f.principal[1][i], lane), hn::Mul(R[j][2], Get(f.principal[2][i], lane))));
      const Wide scale = hn::Mul(per, axis);
      turn = hn::MulAdd(scale, momentum[j], turn), gain = hn::MulAdd(scale, torque[j], gain);
      Put(hn::IfThenElse(turns, scale, Get(f.turn_scale[i][j], lane)), f.turn_scale[i][j], lane);
      Put(hn::IfThenElse(turns, hn::Mul(axis, root), Get(f.momentum[i][j], lane)), f.momentum[i][j], lane);
    }
    Put(hn::IfThenElse(turns, turn, x[i]), f.now.turn[i], lane);
    Put(hn::IfThenElse(turns, gain, Get(f.loads.turn_gain[i], lane)), f.loads.turn_gain[i], lane);
  }
}

HWY_ATTR void TurnFrames(const FrameArrays& all, double time) {
  for (std::size_t g = 0; g < all.count; ++g)
    for (std::size_t lane = 0; HasBody(all.frames[g], lane); lane += kDoubles) TurnLanes(all.frames[g], time, lane);
}

/// Where rows are of an attitude that the body has left, its momentum no longer tells how it turns: by the inertia in
/// the middle of the substep.
HWY_INLINE HWY_ATTR void FreeTurn(const EightFrames& f, double h, const Wide (*R)[3], const Wide* turn,
                                  std::size_t lane, Wide* free) {
  const Doubles d;
  for (std::size_t i = 0; i < 3; ++i) free[i] = turn[i];
  const auto keeps = hn::Gt(Get(f.keeps_axes, lane), hn::Zero(d));
  if (hn::AllFalse(d, keeps)) return;
  Wide world[3], body[3], start[3], m[3], inverse[3];
  Multiply(f.momentum, true, turn, lane, world);
  Turn(R, true, world, body);
  Multiply(f.principal, true, body, lane, start);
  InverseInertia(f, lane, inverse);
  MiddleMomentum(inverse, hn::Set(d, 0.5 * h), start, m);
  for (std::size_t i = 0; i < 3; ++i) m[i] = hn::Mul(inverse[i], m[i]);
  Multiply(f.principal, false, m, lane, body);
  Turn(R, false, body, world);
  Multiply(f.momentum, false, world, lane, body);
  for (std::size_t i = 0; i < 3; ++i) free[i] = hn::IfThenElse(keeps, body[i], turn[i]);
}

/// @param told shifts and what R has changed by, a row a number. @param free likewise
HWY_INLINE HWY_ATTR void BeginLanes(EightFrames& f, double h, std::size_t lane, Block8* told, Block8* free) {
  Wide q[4], R[3][3], turn[3], free_turn[3];
  for (std::size_t i = 0; i < 4; ++i) q[i] = Get(f.now.attitude[i], lane);
  Rotation(q, R);
  for (std::size_t i = 0; i < 3; ++i) {
    Put(Get(f.now.shift[i], lane), told[i], lane);
    for (std::size_t j = 0; j < 3; ++j) Put(hn::Sub(R[i][j], Get(f.start[i][j], lane)), told[3 + 3 * i + j], lane);
    const Wide v = hn::MulAdd(Get(f.loads.left, lane), Get(f.now.v[i], lane), Get(f.loads.gain[i], lane));
    turn[i] = hn::MulAdd(Get(f.loads.turn_left, lane), Get(f.now.turn[i], lane), Get(f.loads.turn_gain[i], lane));
    Put(v, f.now.v[i], lane);
    Put(turn[i], f.now.turn[i], lane);
    Put(hn::Mul(Get(f.root_mass, lane), v), free[i], lane);
  }
  FreeTurn(f, h, R, turn, lane, free_turn);
  for (std::size_t i = 0; i < 3; ++i) {
    Put(free_turn[i], f.now.free_turn[i], lane);
    Put(free_turn[i], free[3 + i], lane);
  }
}

HWY_ATTR void BeginFrames(const FrameArrays& all) {
  for (std::size_t g = 0; g < all.count; ++g) {
    EightFrames& f = all.frames[g];
    Block8 told[12], free[8];
    for (std::size_t lane = 0; HasBody(f, lane); lane += kDoubles) BeginLanes(f, all.length, lane, told, free);
    for (std::size_t l = 0; HasBody(f, l); ++l) {
      FrameShift& shift = all.shifts[kFramesAtOnce * g + l];
      for (std::size_t i = 0; i < 3; ++i) shift.shift[i] = told[i].v[l];
      for (std::size_t i = 0; i < 9; ++i) shift.turned[i] = told[3 + i].v[l];
      for (std::size_t i = 0; i < 8; ++i) {
        all.free[f.first[l]].v[i] = free[i].v[l];
        all.motion[f.first[l]].v[i] = free[i].v[l] + all.answers[f.first[l]].v[i];
      }
    }
  }
}

/// @param change, push of the coordinates, a row a number
HWY_INLINE HWY_ATTR void EndLanes(EightFrames& f, double h, std::size_t lane, const Block8* change,
                                  const Block8* push) {
  const Doubles d;
  const Wide length = hn::Set(d, h), per_root = Get(f.per_root, lane);
  const auto is_free = hn::Gt(per_root, hn::Zero(d));
  Wide y[3], r[3], turned[4], before[4], after[4];
  for (std::size_t i = 0; i < 3; ++i) {
    const Wide by = Get(change[3 + i], lane);
    Put(hn::Add(Get(f.now.turn[i], lane), by), f.now.turn[i], lane);
    y[i] = hn::Mul(length, hn::Add(hn::Add(Get(f.now.free_turn[i], lane), by), Get(push[3 + i], lane)));
    const Wide v = hn::MulAdd(per_root, Get(change[i], lane), Get(f.now.v[i], lane));
    const Wide speed = hn::MulAdd(per_root, Get(push[i], lane), v);
    Put(v, f.now.v[i], lane);
    const Wide shift = Get(f.now.shift[i], lane);
    Put(hn::IfThenElse(is_free, hn::MulAdd(length, speed, shift), shift), f.now.shift[i], lane);
  }
  for (std::size_t i = 0; i < 4; ++i) after[i] = before[i] = Get(f.now.attitude[i], lane);
  const auto turns = hn::Gt(Get(f.turns_axes, lane), hn::Zero(d));
  if (!hn::AllTrue(d, hn::And(is_free, turns))) {
    Multiply(f.turn_scale, true, y, lane, r);
    Turned(r, turned);
    Product(turned, before, after);
    Normalise(after);
    for (std::size_t i = 0; i < 4; ++i) Put(turned[i], f.now.turned[i], lane);
  }
  if (!hn::AllFalse(d, turns)) {
    Wide turn[3], momentum[3], freely[4];
    for (std::size_t i = 0; i < 3; ++i) turn[i] = Get(f.now.turn[i], lane);
    Multiply(f.momentum, true, turn, lane, momentum);
    for (std::size_t i = 0; i < 4; ++i) freely[i] = before[i], Put(before[i], f.now.from[i], lane);
    TurnFreely(f, momentum, length, lane, freely);
    for (std::size_t i = 0; i < 4; ++i) after[i] = hn::IfThenElse(turns, freely[i], after[i]);
  }
  for (std::size_t i = 0; i < 4; ++i) Put(hn::IfThenElse(is_free, after[i], before[i]), f.now.attitude[i], lane);
}

HWY_ATTR void EndFrames(const FrameArrays& all, bool pushed) {
  for (std::size_t g = 0; g < all.count; ++g) {
    EightFrames& f = all.frames[g];
    Block8 change[8], push[8];
    for (std::size_t l = 0; HasBody(f, l); ++l)
      for (std::size_t i = 0; i < 8; ++i) {
        const float by = all.motion[f.first[l]].v[i] - all.free[f.first[l]].v[i];
        all.answers[f.first[l]].v[i] = by;
        change[i].v[l] = by;
        push[i].v[l] = pushed ? all.pushes[kFramesAtOnce * g + l].v[i] : 0.0f;
      }
    for (std::size_t lane = 0; HasBody(f, lane); lane += kDoubles) EndLanes(f, all.length, lane, change, push);
  }
}

HWY_INLINE HWY_ATTR void PlaceLanes(EightFrames& f, double h, bool again, std::size_t lane) {
  const Doubles d;
  const auto turns = hn::Gt(Get(f.turns_axes, lane), hn::Zero(d));
  if (hn::AllFalse(d, turns)) return;
  Wide turn[3], momentum[3], q[4], by[4], placed[4];
  for (std::size_t i = 0; i < 4; ++i) q[i] = Get(again ? f.now.from[i] : f.now.attitude[i], lane);
  if (again) {
    for (std::size_t i = 0; i < 3; ++i) turn[i] = Get(f.now.turn[i], lane);
    Multiply(f.momentum, true, turn, lane, momentum);
    TurnFreely(f, momentum, hn::Set(d, h), lane, q);
  }
  by[0] = hn::Set(d, 1.0);
  for (std::size_t i = 0; i < 3; ++i) {
    by[1 + i] = hn::Mul(hn::Set(d, 0.5), Get(f.now.way[i], lane));
    Put(hn::Zero(d), f.now.way[i], lane);
  }
  Product(by, q, placed);
  Normalise(placed);
  for (std::size_t i = 0; i < 4; ++i) {
    const Wide before = Get(f.now.attitude[i], lane);
    Put(hn::IfThenElse(turns, placed[i], before), f.now.attitude[i], lane);
  }
}

HWY_ATTR void PlaceFrames(const FrameArrays& all, bool again) {
  for (std::size_t g = 0; g < all.count; ++g)
    for (std::size_t lane = 0; HasBody(all.frames[g], lane); lane += kDoubles)
      PlaceLanes(all.frames[g], all.length, again, lane);
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(TurnFrames);
HWY_EXPORT(BeginFrames);
HWY_EXPORT(EndFrames);
HWY_EXPORT(PlaceFrames);

void turn_frames(const FrameArrays& all, double time) { HWY_DYNAMIC_DISPATCH(TurnFrames)(all, time); }

void begin_frames(const FrameArrays& all) { HWY_DYNAMIC_DISPATCH(BeginFrames)(all); }

void end_frames(const FrameArrays& all, bool pushed) { HWY_DYNAMIC_DISPATCH(EndFrames)(all, pushed); }

void place_frames(const FrameArrays& all, bool again) { HWY_DYNAMIC_DISPATCH(PlaceFrames)(all, again); }

}  // namespace limber::internal
#endif
