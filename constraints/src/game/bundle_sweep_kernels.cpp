#include "bundle_kernels.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "game/bundle_sweep_kernels.cpp"
// Arrays of vectors cannot be formed of vectors of a length unknown to the compiler: those machines run the fixed
// 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

#include "bundle_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {

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

/// @param u the normal's number. @return the change of its force
HWY_INLINE HWY_ATTR Vector SolveNormal(const PairBundle& bundle, BundleContact& c, Vector u, std::size_t lane) {
  const Vector before = Get(c.force[0], lane);
  const Vector plain = hn::MulAdd(Approach(c, u, lane), Get(c.inverse_normal, lane), before);
  const Vector normal = bundle.rebounds ? NormalForce(c, plain, lane) : hn::Max(hn::Zero(Lanes()), plain);
  Put(normal, c.force[0], lane);
  return hn::Sub(normal, before);
}

/// @param u the rows' numbers. @param change out: of the forces
HWY_INLINE HWY_ATTR void SolveOne(const PairBundle& bundle, BundleContact& c, const Vector* u, std::size_t lane,
                                  Vector* change) {
  change[0] = SolveNormal(bundle, c, u[0], lane);
  const Vector zero = hn::Zero(Lanes()), normal = Get(c.force[0], lane);
  Vector wanted[2];
  for (std::size_t t = 0; t < 2; ++t) {
    const Vector slip = hn::Add(u[1 + t], Get(c.slip[t], lane));
    wanted[t] = hn::NegMulAdd(Get(c.inverse_tangent, lane), hn::MulAdd(Get(c.coupling[t], lane), change[0], slip),
                              Get(c.force[1 + t], lane));
  }
  const Vector square = hn::MulAdd(wanted[0], wanted[0], hn::Mul(wanted[1], wanted[1]));
  const Vector most = hn::IfThenElseZero(hn::Gt(normal, zero), hn::Mul(Get(c.friction, lane), normal));
  const Vector share = ShareWithin(square, most);
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

/// The normals of pairs, against the order in which a forward sweep solves their contacts next, so that no body tilts
/// by the corner that comes first. The last is solved next anyway.
HWY_INLINE HWY_ATTR void SweepNormals(const BundleArrays& all, const PairBundle& bundle, std::size_t lane,
                                      Coordinates& y) {
  for (std::int32_t k = bundle.count - 1; k > 0; --k) {
    BundleContact& c = all.contacts[bundle.first + k];
    const Block8* rows = RowsOf(all, bundle, k);
    Vector u;
    ReadRows(bundle, c, rows, 1, y, lane, &u);
    const Vector change = SolveNormal(bundle, c, u, lane);
    MoveCoordinates(bundle, c, rows, 1, &change, lane, y);
  }
}

HWY_ATTR void SweepBundles(const BundleArrays& all, bool backward, Block8* motion) {
  const Lanes d;
  for (std::size_t i = 0; i < all.count; ++i) {
    PairBundle& bundle = all.bundles[backward ? all.count - 1 - i : i];
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Works works{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
      Coordinates y(all, bundle);
      ReadCoordinates(all, bundle, motion, lane, y);
      if (!backward) SweepNormals(all, bundle, lane, y);
      for (std::int32_t j = 0; j < bundle.count; ++j) {
        const std::int32_t k = backward ? bundle.count - 1 - j : j;
        BundleContact& c = all.contacts[bundle.first + k];
        const Block8* rows = RowsOf(all, bundle, k);
        Vector u[3], change[3];
        ReadRows(bundle, c, rows, 3, y, lane, u);
        SolveOne(bundle, c, u, lane, change);
        MoveCoordinates(bundle, c, rows, 3, change, lane, y);
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

HWY_INLINE HWY_ATTR void PushOne(BundleContact& c, Vector share, Vector most, Sides& sides, std::size_t lane) {
  const Vector before = Get(c.push, lane), mass = Get(c.inverse_push, lane), parted = ReadAxis(c, 0, sides, lane);
  const Vector wanted = hn::Mul(share, hn::MulAdd(mass, hn::Sub(Get(c.part, lane), parted), before));
  const Vector push = hn::Max(hn::Zero(Lanes()), hn::Min(wanted, hn::MulAdd(mass, hn::Sub(most, parted), before)));
  const Vector change = hn::Sub(push, before);
  Put(push, c.push, lane);
  MoveSides(c, 1, &change, sides, lane);
}

HWY_ATTR void PushBundles(const BundleArrays& all, bool backward, float share, float most, Block8* pushes) {
  const Vector part = hn::Set(Lanes(), share), limit = hn::Set(Lanes(), most);
  for (std::size_t i = 0; i < all.count; ++i) {
    const PairBundle& bundle = all.bundles[backward ? all.count - 1 - i : i];
    for (std::size_t lane = 0; lane < kBundleLanes; lane += kLanesAtOnce) {
      Sides sides;
      ReadSides(bundle, bundle.frame, pushes, lane, sides);
      const auto push = [&](std::int32_t k)
                            HWY_ATTR { PushOne(all.contacts[bundle.first + k], part, limit, sides, lane); };
      for (std::int32_t k = bundle.count - 1; k > 0; --k) push(k);
      for (std::int32_t k = 0; k < bundle.count; ++k) push(k);
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
        ReadRows(bundle, c, RowsOf(all, bundle, k), 3, y, lane, u);
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
        MoveCoordinates(bundle, c, RowsOf(all, bundle, k), 3, by, lane, y);
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

HWY_EXPORT(SweepBundles);
HWY_EXPORT(PushBundles);
HWY_EXPORT(FindResiduals);
HWY_EXPORT(ApplyBundleForces);
HWY_EXPORT(ScaleBundleForces);
HWY_EXPORT(NoteBundleRebounds);

void sweep_bundles(const BundleArrays& bundles, bool backward, Block8* motion) {
  HWY_DYNAMIC_DISPATCH(SweepBundles)(bundles, backward, motion);
}

void push_bundles(const BundleArrays& bundles, bool backward, float share, float most, Block8* pushes) {
  HWY_DYNAMIC_DISPATCH(PushBundles)(bundles, backward, share, most, pushes);
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
