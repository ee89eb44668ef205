#include "field/field_kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "field/field_kernels.cpp"
// Points are structs of vectors, which vectors of a length unknown to the compiler cannot form: those machines run the
// fixed 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
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

HWY_INLINE HWY_ATTR Points DisplacementAt(const LatticeView& l, const Points& r) {
  const Floats d;
  const Cell c = CellOf(l.grid, r);
  const std::int32_t nx = l.grid.stride[0], ny = l.grid.stride[1];
  const auto node = [&](std::int32_t offset) HWY_ATTR {
    const I at = hn::GatherIndex(Ints(), l.place + offset, c.node);
    return Points{hn::GatherIndex(d, l.coordinates, at), hn::GatherIndex(d, l.coordinates + 1, at),
                  hn::GatherIndex(d, l.coordinates + 2, at)};
  };
  const auto mix = [](const Points& a, const Points& b, F t) HWY_ATTR {
    return Points{Mix(a.x, b.x, t), Mix(a.y, b.y, t), Mix(a.z, b.z, t)};
  };
  const Points v00 = mix(node(0), node(1), c.z), v01 = mix(node(ny), node(ny + 1), c.z);
  const Points v0 = mix(v00, v01, c.y);
  const Points v10 = mix(node(nx), node(nx + 1), c.z), v11 = mix(node(nx + ny), node(nx + ny + 1), c.z);
  return mix(v0, mix(v10, v11, c.y), c.x);
}

HWY_INLINE HWY_ATTR Points CarriedBack(const LatticeView& l, const Points& q) {
  Points r = q;
  if (l.place == nullptr) return r;
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

HWY_INLINE HWY_ATTR F FallLength(const FieldQuery& q) {
  return All(std::sqrt(q.fall[0] * q.fall[0] + q.fall[1] * q.fall[1] + q.fall[2] * q.fall[2]));
}

HWY_ATTR std::size_t NearClusters(const FieldQuery& query, const ClusterView& clusters, std::uint32_t* found,
                                  const SampleBounds& bounds) {
  const Floats d;
  const F others = hn::Add(All(query.flex + query.swing), FallLength(query));
  std::size_t count = 0;
  const F unknown = All(std::numeric_limits<float>::quiet_NaN());
  HWY_ALIGN float distance[kLanes], motion[kLanes];
  for (std::size_t g = 0; g < clusters.groups; ++g)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points centre = LoadCluster(clusters.centres + g * kClusterFloats, lane), q = Placed(query, centre),
                   moved = Carried(query, centre);
      const F radius = hn::LoadU(d, clusters.radii + g * kFieldLanes + lane);
      const F beyond = hn::Sub(DistanceOf(query.field, q).value, radius);
      const F comes = hn::MulAdd(All(query.turning), radius, hn::Add(hn::Sqrt(Dot(moved, moved)), others));
      unsigned near = Bits(hn::And(hn::Ge(radius, hn::Zero(d)), hn::Le(beyond, hn::Add(comes, All(query.reach)))));
      for (unsigned left = near; left != 0; left &= left - 1) {
        const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
        found[count++] = static_cast<std::uint32_t>(g * kFieldLanes + lane + at);
      }
      if (bounds.distance == nullptr) continue;
      hn::Store(hn::Max(hn::Sub(beyond, All(query.flex)), hn::Zero(d)), d, distance);
      hn::Store(comes, d, motion);
      for (std::size_t c = 0; c < kLanes; ++c)
        for (std::size_t s = 0; s < kFieldLanes; s += kLanes) {
          const std::size_t first = (g * kFieldLanes + lane + c) * kFieldLanes + s;
          hn::StoreU(All(distance[c]), d, bounds.distance + first);
          hn::StoreU(All(motion[c]), d, bounds.motion + first);
          StoreCluster({unknown, unknown, unknown}, bounds.slope + kClusterFloats / kFieldLanes * (first - s), s);
        }
    }
  return count;
}

HWY_ATTR std::size_t NearSamples(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                                 std::size_t count, FieldHit* hits, const SampleBounds& bounds) {
  const bool carried = query.lattice.place != nullptr && query.lattice.steps > 0;
  const Floats d;
  std::size_t found = 0;
  Lanes lanes;
  for (std::size_t c = 0; c < count; ++c) {
    const std::size_t cluster = clusters[c];
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points x = LoadCluster(shell.coordinates + cluster * kClusterFloats, lane), q = Placed(query, x);
      Points moved = Carried(query, x);
      if (shell.swings != nullptr)
        moved = Rotated(query.R, LoadCluster(shell.swings + cluster * kClusterFloats, lane), moved);
      const F motion = hn::Add(hn::Sqrt(Dot(moved, moved)), FallLength(query));
      const auto keep_bounds = [&](F least, const Points& slope) HWY_ATTR {
        if (bounds.distance == nullptr) return;
        hn::StoreU(least, d, bounds.distance + cluster * kFieldLanes + lane);
        hn::StoreU(motion, d, bounds.motion + cluster * kFieldLanes + lane);
        StoreCluster(slope, bounds.slope + cluster * kClusterFloats, lane);
      };
      // What is far off as seen from the rest shape is not worth the way back into it.
      if (carried) {
        const Distance at = DistanceOf(query.field, q);
        const F least = hn::Sub(at.value, All(query.flex));
        if (hn::AllFalse(d, hn::Le(least, hn::Add(motion, All(query.reach))))) {
          keep_bounds(least, at.slope);
          continue;
        }
      }
      const Points r = CarriedBack(query.lattice, q);
      const Distance distance = DistanceOf(query.field, r);
      keep_bounds(distance.value, distance.slope);
      unsigned within = Bits(hn::Le(distance.value, hn::Add(All(query.reach), Closing(query, distance.slope, moved))));
      if (within == 0) continue;
      lanes.Store(q, r, distance);
      for (; within != 0; within &= within - 1) {
        const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(within));
        hits[found++] = lanes.Hit(at, static_cast<std::int32_t>(cluster * kFieldLanes + lane + at), 0.0f);
      }
    }
  }
  return found;
}

// Eight straight ways, and where they lie in the rest shape: through three points of each.
class Ways {
 public:
  HWY_ATTR Ways(const FieldQuery& query, const Points& a, const Points& b)
      : from_(a), across_(Difference(b, a)), centre_(CarriedBack(query.lattice, At(All(0.5f)))) {}

  HWY_INLINE HWY_ATTR F Length() const { return hn::Sqrt(Dot(across_, across_)); }
  HWY_INLINE HWY_ATTR Points At(F along) const {
    return {hn::MulAdd(along, across_.x, from_.x), hn::MulAdd(along, across_.y, from_.y),
            hn::MulAdd(along, across_.z, from_.z)};
  }
  HWY_INLINE HWY_ATTR const Points& Across() const { return across_; }
  HWY_INLINE HWY_ATTR const Points& Centre() const { return centre_; }
  HWY_ATTR void CarryBackEnds(const FieldQuery& query) {
    before_ = Difference(centre_, CarriedBack(query.lattice, from_));
    behind_ = Difference(CarriedBack(query.lattice, At(All(1.0f))), centre_);
  }
  // In the rest shape, and the way there that half of the whole is. @pre CarryBackEnds()
  HWY_INLINE HWY_ATTR Points Rest(F along) const {
    const Floats d;
    const F twice = hn::Sub(hn::Add(along, along), All(1.0f));
    const F early = hn::Min(twice, hn::Zero(d)), late = hn::Max(twice, hn::Zero(d));
    const auto axis = [&](F c, F b, F a) HWY_ATTR { return hn::MulAdd(early, b, hn::MulAdd(late, a, c)); };
    return {axis(centre_.x, before_.x, behind_.x), axis(centre_.y, before_.y, behind_.y),
            axis(centre_.z, before_.z, behind_.z)};
  }
  HWY_INLINE HWY_ATTR const Points& Half(bool second) const { return second ? behind_ : before_; }

 private:
  Points from_, across_, centre_, before_{}, behind_{};
};

// What a distance rises along an edge of such a length while it counts as level: half a degree.
HWY_INLINE HWY_ATTR F Level(F length) { return hn::Mul(All(0.01f), length); }

// Whether a distance that rises so much at a start and an end falls and then does not, or does not and then rises.
HWY_INLINE HWY_ATTR hn::Mask<Floats> TurnsUp(F start, F end, F level) {
  const F down = hn::Neg(level);
  return hn::Or(hn::And(hn::Lt(start, down), hn::Ge(end, down)), hn::And(hn::Le(start, level), hn::Gt(end, level)));
}

// Edges that wait until there is a vector of them.
struct EdgeQueue {
  HWY_ALIGN std::int32_t edge[kLanes], ends[2][kLanes];
  std::size_t count = 0;

  bool Full() const { return count == kLanes; }
  // @pre not Full()
  void Add(std::int32_t e, std::int32_t from, std::int32_t to) {
    edge[count] = e, ends[0][count] = from, ends[1][count] = to;
    ++count;
  }
  // Fills what is left with an edge of it. @pre some wait @return the lanes of those that do, a bit each
  unsigned Take() {
    for (std::size_t i = count; i < kLanes; ++i)
      for (auto& e : ends) e[i] = e[0];
    return (1u << std::exchange(count, 0)) - 1u;
  }
};

// Of edges, a vector of them at a time.
class EdgeBlock {
 public:
  HWY_ATTR EdgeBlock(const FieldQuery& query, const ShellView& shell, const EdgeQueue& queue)
      : query_(query),
        edge_(queue.edge),
        from_(hn::Load(Ints(), queue.ends[0])),
        to_(hn::Load(Ints(), queue.ends[1])),
        a_(GatherSamples(shell.coordinates, from_)),
        b_(GatherSamples(shell.coordinates, to_)),
        ways_(query, Placed(query, a_), Placed(query, b_)) {}

  // Edges of which a half may have a point that is looked for, a bit each.
  HWY_ATTR unsigned Look(const SampleBounds& bounds) const {
    const Floats d;
    const F length = ways_.Length(), zero = hn::Zero(d);
    const F motion = hn::Max(hn::GatherIndex(d, bounds.motion, from_), hn::GatherIndex(d, bounds.motion, to_));
    const F most = hn::MulAdd(All(2.0f), hn::Add(All(query_.reach), motion), hn::Mul(All(0.5f), length));
    const Distance centre = DistanceOf(query_.field, ways_.Centre());
    const auto inside = hn::Lt(centre.value, zero);
    // Distances change by no more than the way. So may a slope that is not known.
    const auto half = [&](I end, float way) HWY_ATTR {
      const F distance = hn::GatherIndex(d, bounds.distance, end), out = hn::IfThenElse(inside, All(-way), All(way));
      const auto near = hn::Le(hn::Add(hn::Abs(distance), hn::Abs(centre.value)), most);
      const auto through = hn::Xor(inside, hn::Lt(distance, zero));
      const Points slope = GatherSamples(bounds.slope, end);
      const auto turns = TurnsUp(hn::Mul(out, Dot(slope, ways_.Across())),
                                 hn::Mul(out, Dot(centre.slope, ways_.Across())), Level(length));
      return hn::And(near, hn::Or(through, hn::Or(hn::Ne(slope.x, slope.x), turns)));
    };
    return Bits(hn::And(hn::Gt(length, zero), hn::Or(half(from_, 1.0f), half(to_, -1.0f))));
  }

  HWY_ATTR std::size_t Find(const ShellView& shell, unsigned wanted, float step, FieldHit* hits) {
    ways_.CarryBackEnds(query_);
    const Points moved_a = Moved(shell, a_, from_), moved_b = Moved(shell, b_, to_);
    const float longest = hn::GetLane(hn::MaxOfLanes(Floats(), ways_.Length()));
    const int sections = std::clamp(static_cast<int>(0.5f * longest / step) + 1, 1, kMostSections);
    return March(moved_a, moved_b, wanted, sections, hits);
  }

 private:
  static constexpr int kMostSections = 24;  // of half an edge
  static_assert(kHitsOfEdge == 2 * 2 * kMostSections);

  // From point to point along the edges: between two of them the distance changes its sign, or is least where its slope
  // does.
  HWY_ATTR std::size_t March(const Points& moved_a, const Points& moved_b, unsigned wanted, int sections,
                             FieldHit* hits) const {
    const Floats d;
    const F zero = hn::Zero(d);
    std::size_t found = 0;
    const auto add = [&](unsigned bits, F along, bool within_reach) HWY_ATTR {
      if (bits == 0) return;
      const Points r = ways_.Rest(along);
      const Distance at = DistanceOf(query_.field, r);
      if (within_reach) {
        const Points moved{Mix(moved_a.x, moved_b.x, along), Mix(moved_a.y, moved_b.y, along),
                           Mix(moved_a.z, moved_b.z, along)};
        bits &= Bits(hn::Le(at.value, hn::Add(All(query_.reach), Closing(query_, at.slope, moved))));
      }
      found = Store(bits, along, r, at, hits, found);
    };
    Distance last = DistanceOf(query_.field, ways_.Rest(zero));
    F start = zero;
    for (int i = 1; i <= 2 * sections; ++i) {
      const F end = All(static_cast<float>(i) / static_cast<float>(2 * sections));
      const Distance next = DistanceOf(query_.field, ways_.Rest(end));
      const Points& half = ways_.Half(i > sections);
      const F falls = Dot(last.slope, half), rises = Dot(next.slope, half);
      const auto outside = hn::Ge(last.value, zero), outside_then = hn::Ge(next.value, zero);
      add(wanted & Bits(hn::Xor(outside, outside_then)), Between(start, end, last.value, next.value), false);
      const auto turns = TurnsUp(falls, rises, Level(hn::Sqrt(Dot(half, half))));
      const unsigned low = wanted & Bits(hn::And(turns, hn::And(outside, outside_then)));
      if (low != 0) {
        // Where the tangents meet: at a kink there, and between the two sides of what is round.
        const F way = hn::Mul(All(2.0f), hn::Sub(end, start));
        const F part =
            hn::Div(hn::NegMulAdd(rises, way, hn::Sub(next.value, last.value)), hn::Mul(hn::Sub(falls, rises), way));
        const F lowest = Mix(start, end, hn::Min(hn::Max(part, zero), All(1.0f)));
        const F value = DistanceOf(query_.field, ways_.Rest(lowest)).value;
        const unsigned inside = low & Bits(hn::Lt(value, zero));
        add(low & ~inside, lowest, true);
        add(inside, Between(start, lowest, last.value, value), false);
        add(inside, Between(lowest, end, value, next.value), false);
      }
      last = next, start = end;
    }
    return found;
  }

  // Where a number that is `first` at start and `second` at end is zero, were it linear. @pre of two signs
  static HWY_INLINE HWY_ATTR F Between(F start, F end, F first, F second) {
    return Mix(start, end, hn::Div(first, hn::Sub(first, second)));
  }
  HWY_INLINE HWY_ATTR Points Moved(const ShellView& shell, const Points& x, I samples) const {
    const Points moved = Carried(query_, x);
    return shell.swings != nullptr ? Rotated(query_.R, GatherSamples(shell.swings, samples), moved) : moved;
  }
  HWY_ATTR std::size_t Store(unsigned bits, F along, const Points& r, const Distance& at, FieldHit* hits,
                             std::size_t found) const {
    if (bits == 0) return found;
    Lanes lanes;
    HWY_ALIGN float where[kLanes];
    lanes.Store(ways_.At(along), r, at);
    hn::Store(along, Floats(), where);
    for (; bits != 0; bits &= bits - 1) {
      const auto lane = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
      hits[found++] = lanes.Hit(lane, edge_[lane], where[lane]);
    }
    return found;
  }

  const FieldQuery& query_;
  const std::int32_t* edge_;
  I from_, to_;
  Points a_, b_;  // of the edges' body
  Ways ways_;
};

// Distances change by no more than the way: what is farther from the surface at both ends than half of an edge does not
// reach it, from neither side. A bit each.
HWY_INLINE HWY_ATTR unsigned MayReach(const FieldQuery& query, const ShellView& shell, const SampleBounds& bounds,
                                      I from, I to) {
  const Floats d;
  const F apart =
      hn::Add(hn::Abs(hn::GatherIndex(d, bounds.distance, from)), hn::Abs(hn::GatherIndex(d, bounds.distance, to)));
  const F motion = hn::Max(hn::GatherIndex(d, bounds.motion, from), hn::GatherIndex(d, bounds.motion, to));
  const Points across = Difference(GatherSamples(shell.coordinates, to), GatherSamples(shell.coordinates, from));
  const F within = hn::Sub(apart, hn::MulAdd(All(2.0f), motion, All(2.0f * query.reach)));
  return Bits(hn::Or(hn::Le(within, hn::Zero(d)), hn::Le(hn::Mul(within, within), Dot(across, across))));
}

HWY_ATTR std::size_t NearEdges(const FieldQuery& query, const ShellView& shell, const SampleBounds& bounds,
                               const std::uint32_t* clusters, std::size_t count, float step, FieldHit* hits) {
  EdgeQueue looked_at, marched;
  std::size_t found = 0;
  const auto march = [&]() HWY_ATTR {
    if (marched.count == 0) return;
    const unsigned wanted = marched.Take();
    found += EdgeBlock(query, shell, marched).Find(shell, wanted, step, hits + found);
  };
  const auto look = [&]() HWY_ATTR {
    if (looked_at.count == 0) return;
    unsigned wanted = looked_at.Take();
    for (wanted &= EdgeBlock(query, shell, looked_at).Look(bounds); wanted != 0; wanted &= wanted - 1) {
      const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(wanted));
      marched.Add(looked_at.edge[at], looked_at.ends[0][at], looked_at.ends[1][at]);
      if (marched.Full()) march();
    }
  };
  for (std::size_t c = 0; c < count; ++c)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const std::int32_t* ends = shell.edge_ends + 2 * kFieldLanes * clusters[c] + lane;
      unsigned within = MayReach(query, shell, bounds, hn::LoadU(Ints(), ends), hn::LoadU(Ints(), ends + kFieldLanes));
      for (; within != 0; within &= within - 1) {
        const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(within));
        looked_at.Add(static_cast<std::int32_t>(clusters[c] * kFieldLanes + lane + at), ends[at],
                      ends[kFieldLanes + at]);
        if (looked_at.Full()) look();
      }
    }
  look();
  march();
  return found;
}

HWY_ATTR bool FirstExit(const FieldQuery& query, const float* from, const float* to, float step, FieldHit* exit) {
  const Floats d;
  Ways ways(query, {All(from[0]), All(from[1]), All(from[2])}, {All(to[0]), All(to[1]), All(to[2])});
  ways.CarryBackEnds(query);
  const float length = hn::GetLane(ways.Length());
  const int points = std::clamp(static_cast<int>(length / step) + 2, 2, 96);
  const F part = All(1.0f / static_cast<float>(points - 1));
  // Each vector of points begins where the last one ended.
  for (int first = 0; first + 1 < points; first += static_cast<int>(kLanes) - 1) {
    HWY_ALIGN float values[kLanes];
    const F along = hn::Mul(hn::Iota(d, static_cast<float>(first)), part);
    hn::Store(DistanceOf(query.field, ways.Rest(along)).value, d, values);
    for (int i = 0; i + 1 < static_cast<int>(kLanes); ++i) {
      if ((values[i] < 0.0f) == (values[i + 1] < 0.0f)) continue;
      const F at = hn::Mul(All(static_cast<float>(first + i) + values[i] / (values[i] - values[i + 1])), part);
      const Points r = ways.Rest(at);
      Lanes lanes;
      lanes.Store(ways.At(at), r, DistanceOf(query.field, r));
      *exit = lanes.Hit(0, 0, hn::GetLane(at));
      return exit->along <= 1.0f;
    }
  }
  return false;
}

HWY_ATTR FieldHit FieldAt(const FieldQuery& query, const float* x) {
  const Points q = Placed(query, {All(x[0]), All(x[1]), All(x[2])});
  const Points r = CarriedBack(query.lattice, q);
  Lanes lanes;
  lanes.Store(q, r, DistanceOf(query.field, r));
  return lanes.Hit(0, 0, 0.0f);
}

// -- Coordinates ------------------------------------------------------------------------------------------------------

template <std::size_t kBodies>
HWY_INLINE HWY_ATTR void MultiplyTile(const float* HWY_RESTRICT rest, const float* HWY_RESTRICT U, std::size_t modes,
                                      const float* const* z, float* const* out, std::size_t row) {
  const Floats d;
  constexpr std::size_t kParts = kRowTile / kLanes;
  F sum[kBodies][kParts];
  for (std::size_t p = 0; p < kParts; ++p)
    for (std::size_t b = 0; b < kBodies; ++b) sum[b][p] = hn::Load(d, rest + p * kLanes);
  for (std::size_t m = 0; m < modes; ++m, U += kRowTile) {
    F u[kParts];
    for (std::size_t p = 0; p < kParts; ++p) u[p] = hn::Load(d, U + p * kLanes);
    for (std::size_t b = 0; b < kBodies; ++b) {
      const F amplitude = All(z[b][m]);
      for (std::size_t p = 0; p < kParts; ++p) sum[b][p] = hn::MulAdd(u[p], amplitude, sum[b][p]);
    }
  }
  for (std::size_t b = 0; b < kBodies; ++b)
    for (std::size_t p = 0; p < kParts; ++p) hn::Store(sum[b][p], d, out[b] + row + p * kLanes);
}

HWY_ATTR void MultiplyRows(const float* rest, const float* U, std::size_t tiles, std::size_t modes,
                           const float* const* z, float* const* out, std::size_t bodies) {
  for (std::size_t t = 0; t < tiles; ++t, rest += kRowTile, U += modes * kRowTile) {
    if (bodies == kBodiesAtOnce) {
      MultiplyTile<kBodiesAtOnce>(rest, U, modes, z, out, t * kRowTile);
    } else {
      for (std::size_t b = 0; b < bodies; ++b) MultiplyTile<1>(rest, U, modes, z + b, out + b, t * kRowTile);
    }
  }
}

HWY_ATTR float LargestLength(const float* clusters, std::size_t count) {
  const Floats d;
  F most = hn::Zero(d);
  for (std::size_t c = 0; c < count; ++c)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points v = LoadCluster(clusters + c * kClusterFloats, lane);
      most = hn::Max(most, Dot(v, v));
    }
  return std::sqrt(hn::GetLane(hn::MaxOfLanes(d, most)));
}

HWY_ATTR void LargestMagnitudes(const float* points, std::size_t count, float* largest) {
  const Floats d;
  // Three vectors of xyz xyz …: every lane of them belongs to one axis, as their number of lanes is a power of two.
  F most[3] = {hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  const std::size_t numbers = 3 * count, whole = numbers - numbers % (3 * kLanes);
  for (std::size_t i = 0; i < whole; i += 3 * kLanes)
    for (std::size_t v = 0; v < 3; ++v) most[v] = hn::Max(most[v], hn::Abs(hn::LoadU(d, points + i + v * kLanes)));
  HWY_ALIGN float all[3 * kLanes];
  for (std::size_t v = 0; v < 3; ++v) hn::Store(most[v], d, all + v * kLanes);
  for (std::size_t axis = 0; axis < 3; ++axis) largest[axis] = 0.0f;
  for (std::size_t i = 0; i < 3 * kLanes; ++i) largest[i % 3] = std::max(largest[i % 3], all[i]);
  for (std::size_t i = whole; i < numbers; ++i) largest[i % 3] = std::max(largest[i % 3], std::abs(points[i]));
}

HWY_ATTR void BoxOfClusters(const ClusterView& clusters, float* low, float* high) {
  const Floats d;
  const F far = All(3e38f);
  Points least{far, far, far}, most{hn::Neg(far), hn::Neg(far), hn::Neg(far)};
  for (std::size_t g = 0; g < clusters.groups; ++g)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points c = LoadCluster(clusters.centres + g * kClusterFloats, lane);
      const F r = hn::LoadU(d, clusters.radii + g * kFieldLanes + lane);
      const auto used = hn::Ge(r, hn::Zero(d));
      const auto grow = [&](F centre, F& lower, F& upper) HWY_ATTR {
        lower = hn::Min(lower, hn::IfThenElse(used, hn::Sub(centre, r), far));
        upper = hn::Max(upper, hn::IfThenElse(used, hn::Add(centre, r), hn::Neg(far)));
      };
      grow(c.x, least.x, most.x), grow(c.y, least.y, most.y), grow(c.z, least.z, most.z);
    }
  low[0] = hn::GetLane(hn::MinOfLanes(d, least.x)), low[1] = hn::GetLane(hn::MinOfLanes(d, least.y)),
  low[2] = hn::GetLane(hn::MinOfLanes(d, least.z));
  high[0] = hn::GetLane(hn::MaxOfLanes(d, most.x)), high[1] = hn::GetLane(hn::MaxOfLanes(d, most.y)),
  high[2] = hn::GetLane(hn::MaxOfLanes(d, most.z));
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(MultiplyRows);
HWY_EXPORT(LargestLength);
HWY_EXPORT(LargestMagnitudes);
HWY_EXPORT(BoxOfClusters);
HWY_EXPORT(NearClusters);
HWY_EXPORT(NearSamples);
HWY_EXPORT(NearEdges);
HWY_EXPORT(FirstExit);
HWY_EXPORT(FieldAt);

void multiply_rows(const float* rest, const float* U, std::size_t tiles, std::size_t modes, const float* const* z,
                   float* const* out, std::size_t bodies) {
  HWY_DYNAMIC_DISPATCH(MultiplyRows)(rest, U, tiles, modes, z, out, bodies);
}

float largest_length(const float* clusters, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(LargestLength)(clusters, count);
}

void largest_magnitudes(const float* points, std::size_t count, float largest[3]) {
  HWY_DYNAMIC_DISPATCH(LargestMagnitudes)(points, count, largest);
}

void box_of_clusters(const ClusterView& clusters, float low[3], float high[3]) {
  HWY_DYNAMIC_DISPATCH(BoxOfClusters)(clusters, low, high);
}

std::size_t near_clusters(const FieldQuery& query, const ClusterView& clusters, std::uint32_t* found,
                          const SampleBounds& bounds) {
  return HWY_DYNAMIC_DISPATCH(NearClusters)(query, clusters, found, bounds);
}

std::size_t near_samples(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                         std::size_t count, FieldHit* hits, const SampleBounds& bounds) {
  return HWY_DYNAMIC_DISPATCH(NearSamples)(query, shell, clusters, count, hits, bounds);
}

std::size_t near_edges(const FieldQuery& query, const ShellView& shell, const SampleBounds& ends,
                       const std::uint32_t* clusters, std::size_t count, float step, FieldHit* hits) {
  return HWY_DYNAMIC_DISPATCH(NearEdges)(query, shell, ends, clusters, count, step, hits);
}

bool first_exit(const FieldQuery& query, const float from[3], const float to[3], float step, FieldHit& exit) {
  return HWY_DYNAMIC_DISPATCH(FirstExit)(query, from, to, step, &exit);
}

FieldHit field_at(const FieldQuery& query, const float x[3]) { return HWY_DYNAMIC_DISPATCH(FieldAt)(query, x); }

}  // namespace limber::internal
#endif  // HWY_ONCE
