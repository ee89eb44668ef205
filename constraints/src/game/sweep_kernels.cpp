#include "sweep_kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "game/sweep_kernels.cpp"
// Accumulators are arrays of vectors, which vectors of a length unknown to the compiler cannot form: those machines run
// the fixed 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 8>;
using Vector = hn::Vec<Floats>;
constexpr std::size_t kLanes = hn::MaxLanes(Floats());
constexpr std::size_t kVectors = 8 / kLanes;  // of one block

/// Three products of a side's rows with blocks of coordinates, lane by lane.
struct Products {
  Vector sum[3][kVectors];
};

HWY_INLINE HWY_ATTR void Clear(Products& p) {
  const Floats d;
  for (auto& of_row : p.sum)
    for (Vector& v : of_row) v = hn::Zero(d);
}

HWY_INLINE HWY_ATTR void AddProducts(const Block8* rows, const Block8* x, std::size_t blocks, Products& p) {
  const Floats d;
  for (std::size_t k = 0; k < blocks; ++k)
    for (std::size_t v = 0; v < kVectors; ++v) {
      const Vector at = hn::Load(d, x[k].v + v * kLanes);
      for (std::size_t row = 0; row < 3; ++row)
        p.sum[row][v] = hn::MulAdd(hn::Load(d, rows[3 * k + row].v + v * kLanes), at, p.sum[row][v]);
    }
}

// Eight lanes are added in one order whatever the vector's length: ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)).
#if HWY_TARGET == HWY_SCALAR
HWY_INLINE HWY_ATTR float SumOfBlock(const Vector* parts) {
  const Floats d;
  float p[8];
  for (std::size_t v = 0; v < kVectors; ++v) hn::StoreU(parts[v], d, p + v * kLanes);
  return ((p[0] + p[4]) + (p[2] + p[6])) + ((p[1] + p[5]) + (p[3] + p[7]));
}

/// @param sums four numbers
HWY_INLINE HWY_ATTR void SumRows(const Products& p, float* sums) {
  for (int row = 0; row < 3; ++row) sums[row] = SumOfBlock(p.sum[row]);
}
#else
using Halves = hn::CappedTag<float, 4>;
using Half = hn::Vec<Halves>;

/// Lanes i and i + 4.
template <class Part>
HWY_INLINE HWY_ATTR Half Fold(const Part* parts) {
  if constexpr (kVectors == 1)
    return hn::Add(hn::LowerHalf(Halves(), parts[0]), hn::UpperHalf(Halves(), parts[0]));
  else
    return hn::Add(parts[0], parts[1]);
}

/// @param sums four numbers
HWY_INLINE HWY_ATTR void SumRows(const Products& p, float* sums) {
  const Halves d;
  const Half a = Fold(p.sum[0]), b = Fold(p.sum[1]), c = Fold(p.sum[2]), none = hn::Zero(d);
  const Half ab = hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const Half c0 = hn::Add(hn::InterleaveLower(d, c, none), hn::InterleaveUpper(d, c, none));
  hn::StoreU(hn::Add(hn::ConcatLowerLower(d, c0, ab), hn::ConcatUpperUpper(d, c0, ab)), d, sums);
}

HWY_INLINE HWY_ATTR float SumOfBlock(const Vector* parts) {
  const Halves d;
  float s[4];
  hn::StoreU(Fold(parts), d, s);
  return (s[0] + s[2]) + (s[1] + s[3]);
}
#endif

HWY_INLINE HWY_ATTR void AddScaledRows(const Block8* rows, const float* by, std::size_t blocks, Block8* x) {
  const Floats d;
  for (std::size_t k = 0; k < blocks; ++k)
    for (std::size_t v = 0; v < kVectors; ++v) {
      Vector at = hn::Load(d, x[k].v + v * kLanes);
      for (std::size_t row = 0; row < 3; ++row)
        at = hn::MulAdd(hn::Set(d, by[row]), hn::Load(d, rows[3 * k + row].v + v * kLanes), at);
      hn::Store(at, d, x[k].v + v * kLanes);
    }
}

/// The rows' numbers for the coordinates as they are. @param u four numbers
HWY_INLINE HWY_ATTR void ReadContact(const ContactRow& contact, const Block8* rows, const Block8* motion, float* u) {
  Products p;
  Clear(p);
  for (const ContactSideRows& side : contact.side)
    AddProducts(rows + side.rows, motion + side.body, static_cast<std::size_t>(side.blocks), p);
  SumRows(p, u);
}

HWY_INLINE HWY_ATTR void MoveContact(const ContactRow& contact, const float* by, const SweepArrays& arrays) {
  for (const ContactSideRows& side : contact.side)
    AddScaledRows(arrays.rows + side.rows, by, static_cast<std::size_t>(side.blocks), arrays.motion + side.body);
}

/// How much is left open along the normal: at most 0 where the law is met.
HWY_INLINE HWY_ATTR float Approach(const ContactRow& c, float normal_force, float u) {
  return c.target - (u + c.gap) - c.compliance * (normal_force - c.before);
}

HWY_INLINE HWY_ATTR float Largest(float friction, float normal_force) {
  return normal_force > 0.0f ? friction * normal_force : 0.0f;
}

/// The share of a vector that is no longer than `most`. Squares of small numbers vanish: then the share errs to less.
HWY_INLINE HWY_ATTR float ShareWithin(float square, float most) {
  return square < most * most ? 1.0f : most / std::sqrt(std::max(square, std::numeric_limits<float>::min()));
}

/// As that of a bundle.
HWY_INLINE HWY_ATTR float NormalForce(const ContactRow& c, float plain) {
  const float lifted = plain + c.inverse_normal * c.fall, energy = 8.0f * c.release * c.inverse_normal;
  return std::max(plain, energy > 0.0f ? 0.5f * (lifted + std::sqrt(lifted * lifted + energy)) : 0.0f);
}

HWY_INLINE HWY_ATTR void SolveContact(ContactRow& c, const SweepArrays& arrays) {
  float u[4], change[3];
  ReadContact(c, arrays.rows, arrays.motion, u);
  const float normal = NormalForce(c, c.force[0] + Approach(c, c.force[0], u[0]) * c.inverse_normal);
  change[0] = normal - c.force[0];
  float wanted[2], square = 0.0f;
  for (int t = 0; t < 2; ++t) {
    wanted[t] = c.force[1 + t] - c.inverse_tangent * (u[1 + t] + c.slip[t] + c.coupling[t] * change[0]);
    square += wanted[t] * wanted[t];
  }
  const float most = Largest(c.friction, normal);
  const float share = ShareWithin(square, most);
  for (int t = 0; t < 2; ++t) {
    const float tangent = share * wanted[t];
    change[1 + t] = tangent - c.force[1 + t];
    c.force[1 + t] = tangent;
  }
  c.force[0] = normal;
  MoveContact(c, change, arrays);
}

HWY_INLINE HWY_ATTR void SolveRolling(RollingRow& r, const ContactRow& c, const SweepArrays& arrays) {
  Products p;
  Clear(p);
  for (int s = 0; s < 2; ++s)
    if (c.side[s].blocks > 0) AddProducts(arrays.rows + r.rows[s], arrays.motion + c.side[s].body, 1, p);
  float u[4], wanted[3], change[3], square = 0.0f;
  SumRows(p, u);
  for (int i = 0; i < 3; ++i) {
    wanted[i] = r.moment[i] - r.inverse * u[i];
    square += wanted[i] * wanted[i];
  }
  const float most = r.radius * c.force[0];
  const float share = ShareWithin(square, most);
  for (int i = 0; i < 3; ++i) {
    const float moment = share * wanted[i];
    change[i] = moment - r.moment[i];
    r.moment[i] = moment;
  }
  for (int s = 0; s < 2; ++s)
    if (c.side[s].blocks > 0) AddScaledRows(arrays.rows + r.rows[s], change, 1, arrays.motion + c.side[s].body);
}

HWY_INLINE HWY_ATTR float Dot3(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// How a point has come since the step's start, along an axis.
HWY_INLINE HWY_ATTR float Travel(const FrameShift& frame, const float* arm, const float* axis) {
  float sum = 0.0f;
  for (int i = 0; i < 3; ++i) sum += axis[i] * (frame.shift[i] + Dot3(frame.turned + 3 * i, arm));
  return sum;
}

/// What it is carried by in the substep at hand.
HWY_INLINE HWY_ATTR float Carried(const FrameShift& frame, const float* arm, const float* axis) {
  float r[3];
  for (int i = 0; i < 3; ++i) r[i] = Dot3(frame.attitude + 3 * i, arm);
  const float* w = frame.carried_turn;
  const float by[3] = {frame.carried[0] + w[1] * r[2] - w[2] * r[1], frame.carried[1] + w[2] * r[0] - w[0] * r[2],
                       frame.carried[2] + w[0] * r[1] - w[1] * r[0]};
  return Dot3(axis, by);
}

HWY_INLINE HWY_ATTR void MeasureContact(ContactRow& c, const Block8* rows, const Block8* shapes,
                                        const FrameShift* frames) {
  Products p;
  Clear(p);
  bool bends = false;
  float gap = c.rest, carried[3] = {};
  for (int s = 0; s < 2; ++s) {
    const ContactSideRows& side = c.side[s];
    if (side.frame < 0) continue;
    const FrameShift& frame = frames[side.frame];
    const float sign = s == 0 ? 1.0f : -1.0f;
    gap += sign * Travel(frame, side.arm, c.axes[0]);
    if (frame.is_carried)
      for (int i = 0; i < 3; ++i) carried[i] += sign * Carried(frame, side.arm, c.axes[i]);
    if (side.blocks <= 1) continue;
    bends = true;
    AddProducts(rows + side.rows + 3, shapes + side.body + 1, static_cast<std::size_t>(side.blocks - 1), p);
  }
  float bent[4] = {};
  if (bends) SumRows(p, bent);
  c.now = gap + bent[0];
  const float yields = c.compliance * c.force[0];
  c.target = std::min(c.now + yields, 0.0f) - yields;
  c.gap = gap + carried[0];
  for (int t = 0; t < 2; ++t) c.slip[t] = c.running[t] + carried[1 + t] - bent[1 + t];
}

HWY_ATTR bool MeasureContacts(ContactRow* contacts, std::size_t count, const Block8* rows, const Block8* shapes,
                              const FrameShift* frames, float share, float most) {
  bool any = false;
  for (std::size_t i = 0; i < count; ++i) {
    ContactRow& c = contacts[i];
    MeasureContact(c, rows, shapes, frames);
    const float overlap = -(c.now + c.compliance * c.force[0]) - c.slop;
    c.before = c.force[0];
    c.push = 0.0f;
    c.part = std::min(share * overlap, most);
    any = any || c.part > 0.0f;
  }
  return any;
}

/// @param start, end u of the free motion and of that found
HWY_INLINE HWY_ATTR void NoteRebound(ContactRow& c, float start, float end) {
  const float given = 0.5f * c.force[0] * (start + end - 2.0f * c.fall), left = std::max(0.0f, c.energy - given);
  const bool is_between = c.stage > 0.0f && c.stage < kParted;
  c.stage = c.force[0] > 0.0f || is_between ? std::min(c.stage + 1.0f, kParted) : 0.0f;
  c.energy = c.stage > 0.0f && c.stage < kParted ? (c.stage == kTogether ? c.rebound * left : left) : 0.0f;
  c.release = c.stage >= kTogether ? c.energy : 0.0f;
}

HWY_ATTR void NoteRebounds(ContactRow* contacts, std::size_t count, const Block8* rows, const Block8* free,
                           const Block8* motion) {
  for (std::size_t i = 0; i < count; ++i) {
    ContactRow& c = contacts[i];
    if (!(c.rebound > 0.0f)) continue;
    const float carried = c.gap - c.now;
    float start[4], end[4];
    ReadContact(c, rows, free, start);
    ReadContact(c, rows, motion, end);
    NoteRebound(c, start[0] + carried, end[0] + carried);
  }
}

HWY_ATTR void SweepContacts(ContactRow* contacts, std::size_t count, RollingRow* rolling, std::size_t rolling_count,
                            bool backward, const SweepArrays& arrays) {
  std::size_t rolls = backward ? rolling_count : 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = backward ? count - 1 - i : i;
    SolveContact(contacts[at], arrays);
    if (backward && rolls > 0 && rolling[rolls - 1].contact == static_cast<std::int32_t>(at))
      SolveRolling(rolling[--rolls], contacts[at], arrays);
    else if (!backward && rolls < rolling_count && rolling[rolls].contact == static_cast<std::int32_t>(at))
      SolveRolling(rolling[rolls++], contacts[at], arrays);
  }
}

HWY_ATTR void PushContacts(ContactRow* contacts, std::size_t count, bool backward, const Block8* rows, Block8* pushes) {
  const Floats d;
  for (std::size_t i = 0; i < count; ++i) {
    ContactRow& c = contacts[backward ? count - 1 - i : i];
    if (!(c.part > 0.0f)) continue;
    Vector sum[kVectors];
    for (std::size_t v = 0; v < kVectors; ++v) {
      sum[v] = hn::Zero(d);
      for (const ContactSideRows& side : c.side)
        if (side.blocks > 0)
          sum[v] = hn::MulAdd(hn::Load(d, rows[side.rows].v + v * kLanes),
                              hn::Load(d, pushes[side.frame].v + v * kLanes), sum[v]);
    }
    const float push = std::max(0.0f, c.push + (c.part - SumOfBlock(sum)) * c.inverse_push);
    const Vector change = hn::Set(d, push - c.push);
    c.push = push;
    for (const ContactSideRows& side : c.side)
      for (std::size_t v = 0; v < kVectors && side.blocks > 0; ++v) {
        float* at = pushes[side.frame].v + v * kLanes;
        hn::Store(hn::MulAdd(change, hn::Load(d, rows[side.rows].v + v * kLanes), hn::Load(d, at)), d, at);
      }
  }
}

HWY_ATTR float ResidualOfContacts(const ContactRow* contacts, std::size_t count, const SweepArrays& arrays) {
  float largest = 0.0f;
  for (std::size_t i = 0; i < count; ++i) {
    float u[4];
    ReadContact(contacts[i], arrays.rows, arrays.motion, u);
    const float approach = Approach(contacts[i], contacts[i].force[0], u[0]);
    largest = std::max(largest, contacts[i].force[0] > 0.0f ? std::abs(approach) : approach);
  }
  return largest;
}

HWY_ATTR void ApplyForces(const ContactRow* contacts, std::size_t count, const RollingRow* rolling,
                          std::size_t rolling_count, const SweepArrays& arrays) {
  for (std::size_t i = 0; i < count; ++i)
    if (contacts[i].force[0] > 0.0f) MoveContact(contacts[i], contacts[i].force, arrays);
  for (std::size_t i = 0; i < rolling_count; ++i) {
    const ContactRow& c = contacts[rolling[i].contact];
    for (int s = 0; s < 2; ++s)
      if (c.side[s].blocks > 0)
        AddScaledRows(arrays.rows + rolling[i].rows[s], rolling[i].moment, 1, arrays.motion + c.side[s].body);
  }
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(MeasureContacts);
HWY_EXPORT(NoteRebounds);
HWY_EXPORT(SweepContacts);
HWY_EXPORT(PushContacts);
HWY_EXPORT(ResidualOfContacts);
HWY_EXPORT(ApplyForces);

bool measure_contacts(ContactRow* contacts, std::size_t count, const Block8* rows, const Block8* shapes,
                      const FrameShift* frames, float share, float most) {
  return HWY_DYNAMIC_DISPATCH(MeasureContacts)(contacts, count, rows, shapes, frames, share, most);
}

void note_rebounds(ContactRow* contacts, std::size_t count, const Block8* rows, const Block8* free,
                   const Block8* motion) {
  HWY_DYNAMIC_DISPATCH(NoteRebounds)(contacts, count, rows, free, motion);
}

void sweep_contacts(ContactRow* contacts, std::size_t count, RollingRow* rolling, std::size_t rolling_count,
                    bool backward, const SweepArrays& arrays) {
  HWY_DYNAMIC_DISPATCH(SweepContacts)(contacts, count, rolling, rolling_count, backward, arrays);
}

void push_contacts(ContactRow* contacts, std::size_t count, bool backward, const Block8* rows, Block8* pushes) {
  HWY_DYNAMIC_DISPATCH(PushContacts)(contacts, count, backward, rows, pushes);
}

float residual_of_contacts(const ContactRow* contacts, std::size_t count, const SweepArrays& arrays) {
  return HWY_DYNAMIC_DISPATCH(ResidualOfContacts)(contacts, count, arrays);
}

void apply_forces(const ContactRow* contacts, std::size_t count, const RollingRow* rolling, std::size_t rolling_count,
                  const SweepArrays& arrays) {
  HWY_DYNAMIC_DISPATCH(ApplyForces)(contacts, count, rolling, rolling_count, arrays);
}

}  // namespace limber::internal
#endif
