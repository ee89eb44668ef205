// What the vector loops of contacts by distance fields share: points in lanes, distances, displacements. Compiled once
// for each instruction set by what includes it.

#if defined(LIMBER_COLLISION_FIELD_DISTANCE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef LIMBER_COLLISION_FIELD_DISTANCE_INL_H_
#undef LIMBER_COLLISION_FIELD_DISTANCE_INL_H_
#else
#define LIMBER_COLLISION_FIELD_DISTANCE_INL_H_
#endif

#include <cmath>

#include "field/field_kernels.h"
// foreach_target first
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, kFieldLanes>;
using Ints = hn::Rebind<std::int32_t, Floats>;
using F = hn::Vec<Floats>;
using I = hn::Vec<Ints>;
constexpr std::size_t kLanes = hn::MaxLanes(Floats());

struct Points {
  F x, y, z;
};

HWY_INLINE HWY_ATTR F All(float v) { return hn::Set(Floats(), v); }
HWY_INLINE HWY_ATTR F Dot(const Points& a, const Points& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}
HWY_INLINE HWY_ATTR Points Difference(const Points& a, const Points& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE HWY_ATTR Points Added(const Points& a, const Points& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE HWY_ATTR F Mix(F a, F b, F t) { return hn::MulAdd(t, hn::Sub(b, a), a); }

// Of a cluster, from a lane on.
HWY_INLINE HWY_ATTR Points LoadCluster(const float* cluster, std::size_t lane) {
  const Floats d;
  return {hn::LoadU(d, cluster + lane), hn::LoadU(d, cluster + kFieldLanes + lane),
          hn::LoadU(d, cluster + 2 * kFieldLanes + lane)};
}
HWY_INLINE HWY_ATTR void StoreCluster(const Points& points, float* cluster, std::size_t lane) {
  const Floats d;
  hn::StoreU(points.x, d, cluster + lane), hn::StoreU(points.y, d, cluster + kFieldLanes + lane);
  hn::StoreU(points.z, d, cluster + 2 * kFieldLanes + lane);
}
// Coordinates of samples by their numbers.
HWY_INLINE HWY_ATTR Points GatherSamples(const float* coordinates, I samples) {
  const Floats d;
  static_assert(kFieldLanes == 8 && kClusterFloats == 3 * kFieldLanes);
  const I at = hn::Add(samples, hn::ShiftLeft<4>(hn::ShiftRight<3>(samples)));
  return {hn::GatherIndex(d, coordinates, at), hn::GatherIndex(d, coordinates + kFieldLanes, at),
          hn::GatherIndex(d, coordinates + 2 * kFieldLanes, at)};
}

// R v + to
HWY_INLINE HWY_ATTR Points Rotated(const float (&R)[3][3], const Points& v, const Points& to) {
  const auto row = [&](int i, F sum) HWY_ATTR {
    return hn::MulAdd(All(R[i][0]), v.x, hn::MulAdd(All(R[i][1]), v.y, hn::MulAdd(All(R[i][2]), v.z, sum)));
  };
  return {row(0, to.x), row(1, to.y), row(2, to.z)};
}

HWY_INLINE HWY_ATTR Points Placed(const FieldQuery& q, const Points& v) {
  return Rotated(q.R, v, {All(q.p[0]), All(q.p[1]), All(q.p[2])});
}

// The expected motion of points of the samples' body, but for their swing.
HWY_INLINE HWY_ATTR Points Carried(const FieldQuery& q, const Points& v) {
  return Rotated(q.turn, v, {All(q.shift[0]), All(q.shift[1]), All(q.shift[2])});
}

// Of points that do not swing.
struct Heights {
  F now, then;
};
HWY_INLINE HWY_ATTR Heights HeightsOf(const HeightView& h, const Points& x) {
  const auto height = [&](const float(&n)[3], float base) HWY_ATTR {
    return hn::MulAdd(All(n[0]), x.x, hn::MulAdd(All(n[1]), x.y, hn::MulAdd(All(n[2]), x.z, All(base))));
  };
  return {height(h.now, h.base[0]), height(h.then, h.base[1])};
}
HWY_INLINE HWY_ATTR Heights HeightsOf(const HeightView& h, const Points& x, const Points& swing) {
  const Heights at = HeightsOf(h, x);
  return {at.now, hn::Add(at.then, Dot({All(h.now[0]), All(h.now[1]), All(h.now[2])}, swing))};
}
HWY_INLINE HWY_ATTR F Lower(const Heights& heights) { return hn::Min(heights.now, heights.then); }

struct Cell {
  I node;
  F x, y, z;  // within it, 0 to 1
};
HWY_INLINE HWY_ATTR Cell CellOf(const GridView& g, const Points& q) {
  const Floats d;
  const Ints i;
  const F zero = hn::Zero(d);
  const auto part = [&](int axis, F v) HWY_ATTR {
    const F t = hn::Mul(hn::Sub(v, All(g.origin[axis])), All(g.inverse[axis]));
    return hn::Min(hn::Max(t, zero), All(g.last[axis]));
  };
  const F x = part(0, q.x), y = part(1, q.y), z = part(2, q.z);
  const I ix = hn::ConvertTo(i, x), iy = hn::ConvertTo(i, y), iz = hn::ConvertTo(i, z);
  const I node = hn::Add(hn::Add(hn::Mul(ix, hn::Set(i, g.stride[0])), hn::Mul(iy, hn::Set(i, g.stride[1]))), iz);
  return {node, hn::Sub(x, hn::ConvertTo(d, ix)), hn::Sub(y, hn::ConvertTo(d, iy)), hn::Sub(z, hn::ConvertTo(d, iz))};
}

struct Distance {
  F value;
  Points slope;
};

// Of a point beyond the grid's box, x, whose nearest point of it is p: s of the surface, all of which is within,
// fulfils |x − s|² ≥ |x − p|² + |p − s|², as the box is convex. That bound is what is told, along the way to p's foot.
HWY_INLINE HWY_ATTR Distance BeyondGrid(const GridView& g, const Points& q, const Distance& at) {
  const Floats d;
  const auto excess = [&](int axis, F v) HWY_ATTR {
    const F low = All(g.origin[axis]), high = hn::MulAdd(All(g.last[axis]), All(1.0f / g.inverse[axis]), low);
    return hn::Sub(v, hn::Min(hn::Max(v, low), high));
  };
  const Points out{excess(0, q.x), excess(1, q.y), excess(2, q.z)};
  const F squared = Dot(out, out);
  const auto beyond = hn::Gt(squared, hn::Zero(d));
  if (hn::AllFalse(d, beyond)) return at;
  const F value = hn::Sqrt(hn::MulAdd(at.value, at.value, squared)),
          inverse = hn::Div(All(1.0f), hn::Max(value, All(1e-30f)));
  const auto slope = [&](F far, F along) HWY_ATTR {
    return hn::IfThenElse(beyond, hn::Mul(hn::MulAdd(at.value, along, far), inverse), along);
  };
  return {hn::IfThenElse(beyond, value, at.value),
          {slope(out.x, at.slope.x), slope(out.y, at.slope.y), slope(out.z, at.slope.z)}};
}

HWY_INLINE HWY_ATTR Distance GridDistance(const DistanceView& f, const Points& q) {
  const Floats d;
  const Ints i;
  const Cell c = CellOf(f.grid, q);
  struct Pair {
    F low, high;
  };
  const auto pair = [&](std::int32_t offset) HWY_ATTR {
    const I both = hn::GatherIndex(i, f.nodes + offset, c.node);
    return Pair{hn::ConvertTo(d, hn::ShiftRight<16>(hn::ShiftLeft<16>(both))),
                hn::ConvertTo(d, hn::ShiftRight<16>(both))};
  };
  const std::int32_t nx = f.grid.stride[0], ny = f.grid.stride[1];
  const Pair p00 = pair(0), p01 = pair(ny), p10 = pair(nx), p11 = pair(nx + ny);
  const F v00 = Mix(p00.low, p00.high, c.z), v01 = Mix(p01.low, p01.high, c.z);
  const F v10 = Mix(p10.low, p10.high, c.z), v11 = Mix(p11.low, p11.high, c.z);
  const F v0 = Mix(v00, v01, c.y), v1 = Mix(v10, v11, c.y);
  const F z0 = Mix(hn::Sub(p00.high, p00.low), hn::Sub(p01.high, p01.low), c.y);
  const F z1 = Mix(hn::Sub(p10.high, p10.low), hn::Sub(p11.high, p11.low), c.y);
  const auto scaled = [&](F v, int axis) HWY_ATTR { return hn::Mul(v, All(f.unit * f.grid.inverse[axis])); };
  const Distance at{hn::Mul(Mix(v0, v1, c.x), All(f.unit)),
                    {scaled(hn::Sub(v1, v0), 0), scaled(Mix(hn::Sub(v01, v00), hn::Sub(v11, v10), c.x), 1),
                     scaled(Mix(z0, z1, c.x), 2)}};
  return BeyondGrid(f.grid, q, at);
}

HWY_INLINE HWY_ATTR Distance SegmentDistance(const DistanceView& f, const Points& q) {
  const F on_axis = hn::Min(hn::Max(q.z, All(-f.size[2])), All(f.size[2]));
  const Points from{q.x, q.y, hn::Sub(q.z, on_axis)};
  const F length = hn::Sqrt(Dot(from, from));
  const F inverse = hn::Div(All(1.0f), hn::Max(length, All(1e-30f)));
  return {hn::Sub(length, All(f.radius)),
          {hn::Mul(from.x, inverse), hn::Mul(from.y, inverse), hn::Mul(from.z, inverse)}};
}

HWY_INLINE HWY_ATTR Distance BoxDistance(const DistanceView& f, const Points& q) {
  const Floats d;
  const F zero = hn::Zero(d);
  const Points beyond{hn::Sub(hn::Abs(q.x), All(f.size[0])), hn::Sub(hn::Abs(q.y), All(f.size[1])),
                      hn::Sub(hn::Abs(q.z), All(f.size[2]))};
  const F most = hn::Max(beyond.x, hn::Max(beyond.y, beyond.z));
  const auto inside = hn::Le(most, zero);
  const Points out{hn::Max(beyond.x, zero), hn::Max(beyond.y, zero), hn::Max(beyond.z, zero)};
  const F length = hn::Sqrt(Dot(out, out));
  const F inverse = hn::Div(All(1.0f), hn::Max(length, All(1e-30f)));
  // Inside: the nearest side, x before y before z.
  const auto by_x = hn::Ge(beyond.x, most), by_y = hn::AndNot(by_x, hn::Ge(beyond.y, most));
  const auto by_z = hn::AndNot(hn::Or(by_x, by_y), hn::Ge(beyond.z, most));
  const auto part = [&](F outside, hn::Mask<Floats> by, F along) HWY_ATTR {
    const F within = hn::IfThenElseZero(by, All(1.0f));
    return hn::CopySign(hn::IfThenElse(inside, within, hn::Mul(outside, inverse)), along);
  };
  return {hn::IfThenElse(inside, most, length),
          {part(out.x, by_x, q.x), part(out.y, by_y, q.y), part(out.z, by_z, q.z)}};
}

HWY_INLINE HWY_ATTR Distance DistanceOf(const DistanceView& f, const Points& q) {
  switch (f.kind) {
    case DistanceView::Kind::kPlane: {
      const Points n{All(f.size[0]), All(f.size[1]), All(f.size[2])};
      return {hn::Sub(Dot(n, q), All(f.radius)), n};
    }
    case DistanceView::Kind::kSegment:
      return SegmentDistance(f, q);
    case DistanceView::Kind::kBox:
      return BoxDistance(f, q);
    case DistanceView::Kind::kGrid:
      break;
  }
  return GridDistance(f, q);
}

// A point at a time, as a node's xyz lie together: gathers would take each number by itself.
HWY_INLINE HWY_ATTR Points DisplacementAt(const LatticeView& l, const Points& r) {
  const Floats d;
  const hn::CappedTag<float, 4> xyz;
  const Cell c = CellOf(l.grid, r);
  HWY_ALIGN std::int32_t node[kLanes];
  HWY_ALIGN float part[3][kLanes], all[4 * kLanes];
  hn::Store(c.node, Ints(), node);
  hn::Store(c.x, d, part[0]), hn::Store(c.y, d, part[1]), hn::Store(c.z, d, part[2]);
  const std::int32_t nx = 3 * l.grid.stride[0], ny = 3 * l.grid.stride[1];
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    for (std::size_t axis = 0; axis < 3; axis += hn::MaxLanes(xyz)) {
      const float* first = l.nodes + 3 * node[lane] + axis;
      const auto mix = [&](hn::Vec<decltype(xyz)> a, hn::Vec<decltype(xyz)> b, std::size_t along)
                           HWY_ATTR { return hn::MulAdd(hn::Set(xyz, part[along][lane]), hn::Sub(b, a), a); };
      const auto along_z = [&](std::int32_t offset) HWY_ATTR {
        return mix(hn::LoadU(xyz, first + offset), hn::LoadU(xyz, first + offset + 3), 2);
      };
      const auto low = mix(along_z(0), along_z(ny), 1), high = mix(along_z(nx), along_z(nx + ny), 1);
      hn::StoreU(mix(low, high, 0), xyz, all + 4 * lane + axis);
    }
  }
  Points u;
  F none;
  hn::LoadInterleaved4(d, all, u.x, u.y, u.z, none);
  return u;
}

HWY_INLINE HWY_ATTR Points CarriedBack(const LatticeView& l, const Points& q) {
  Points r = q;
  if (l.nodes == nullptr) return r;
  for (int step = 0; step < l.steps; ++step) r = Difference(q, DisplacementAt(l, r));
  return r;
}

HWY_INLINE HWY_ATTR unsigned Bits(hn::Mask<Floats> m) {
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(Floats(), m, bytes);
  return bytes[0];
}

// The lanes of one vector of points, for what is taken out of them one by one.
struct Lanes {
  HWY_ALIGN float distance[kLanes], at[3][kLanes], rest[3][kLanes], slope[3][kLanes];

  HWY_ATTR void Store(const Points& q, const Points& r, const Distance& d) {
    const Floats f;
    hn::Store(d.value, f, distance);
    hn::Store(q.x, f, at[0]), hn::Store(q.y, f, at[1]), hn::Store(q.z, f, at[2]);
    hn::Store(r.x, f, rest[0]), hn::Store(r.y, f, rest[1]), hn::Store(r.z, f, rest[2]);
    hn::Store(d.slope.x, f, slope[0]), hn::Store(d.slope.y, f, slope[1]), hn::Store(d.slope.z, f, slope[2]);
  }
  FieldHit Hit(std::size_t lane, std::int32_t feature, float along) const {
    return {feature,
            along,
            distance[lane],
            {at[0][lane], at[1][lane], at[2][lane]},
            {rest[0][lane], rest[1][lane], rest[2][lane]},
            {slope[0][lane], slope[1][lane], slope[2][lane]}};
  }
};

// How much of a distance a motion and a fall close along its slope; 0 where they open it.
HWY_INLINE HWY_ATTR F Closing(const FieldQuery& q, const Points& slope, const Points& moved) {
  const Floats d;
  const F steepness = hn::Max(hn::Sqrt(Dot(slope, slope)), All(1e-30f));
  const F falls = hn::Abs(Dot(slope, {All(q.fall[0]), All(q.fall[1]), All(q.fall[2])}));
  return hn::Max(hn::Div(hn::Sub(falls, Dot(slope, moved)), steepness), hn::Zero(d));
}

// How far points may come to lie from their straight ways.
HWY_INLINE HWY_ATTR F Strays(const FieldQuery& q) {
  return All(q.curve + std::sqrt(q.fall[0] * q.fall[0] + q.fall[1] * q.fall[1] + q.fall[2] * q.fall[2]));
}

// How far a point that goes straight stays beyond one of the sides of the surface's box; negative: of none.
HWY_INLINE HWY_ATTR F BeyondBox(const FieldQuery& q, const Points& start, const Points& way) {
  const auto beyond = [&](int axis, F from, F along) HWY_ATTR {
    const F to = hn::Add(from, along);
    return hn::Max(hn::Sub(hn::Min(from, to), All(q.high[axis])), hn::Sub(All(q.low[axis]), hn::Max(from, to)));
  };
  return hn::Max(hn::Max(beyond(0, start.x, way.x), beyond(1, start.y, way.y)), beyond(2, start.z, way.z));
}

// How far a point that is at a distance of the surface, and goes straight so far, stays clear of it.
HWY_INLINE HWY_ATTR F ClearOnTheWay(const FieldQuery& q, F distance, const Points& rest, const Points& way) {
  const F then = DistanceOf(q.field, Added(rest, way)).value;
  const F both = hn::Sub(hn::Add(distance, then), hn::Sqrt(Dot(way, way)));
  return hn::Sub(hn::Min(distance, hn::Mul(All(0.5f), both)), Strays(q));
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
