#include "field/field_kernels.h"

#include <algorithm>
#include <cmath>

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
HWY_INLINE HWY_ATTR Points GatherEnds(const float* coordinates, const std::int32_t* ends) {
  const Floats d;
  const I at = hn::LoadU(Ints(), ends);
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

HWY_ATTR std::size_t NearClusters(const FieldQuery& query, const ClusterView& clusters, std::uint32_t* found) {
  const Floats d;
  const F reach = All(query.reach + query.flex + query.swing);
  std::size_t count = 0;
  for (std::size_t g = 0; g < clusters.groups; ++g)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points centre = LoadCluster(clusters.centres + g * kClusterFloats, lane), q = Placed(query, centre),
                   moved = Carried(query, centre);
      const F radius = hn::LoadU(d, clusters.radii + g * kFieldLanes + lane);
      const F beyond = hn::Sub(DistanceOf(query.field, q).value, radius);
      const F comes = hn::MulAdd(All(query.turning), radius, hn::Add(hn::Sqrt(Dot(moved, moved)), reach));
      unsigned near = Bits(hn::And(hn::Ge(radius, hn::Zero(d)), hn::Le(beyond, comes)));
      for (; near != 0; near &= near - 1) {
        const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
        found[count++] = static_cast<std::uint32_t>(g * kFieldLanes + lane + at);
      }
    }
  return count;
}

HWY_ATTR std::size_t NearSamples(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                                 std::size_t count, FieldHit* hits) {
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
      const F reach = hn::Add(hn::Sqrt(Dot(moved, moved)), All(query.reach));
      // What is far off as seen from the rest shape is not worth the way back into it.
      if (carried && hn::AllFalse(d, hn::Le(DistanceOf(query.field, q).value, hn::Add(reach, All(query.flex)))))
        continue;
      const Points r = CarriedBack(query.lattice, q);
      const Distance distance = DistanceOf(query.field, r);
      unsigned within = Bits(hn::Le(distance.value, reach));
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

// A straight way, and where it lies in the rest shape: through three points.
struct Way {
  float from[3], to[3];
  float rest[3][3];  // of its start, middle and end
  float length;
  float reach;  // m: distances up to here count
};

// Distances along a way at points that are evenly spaced, eight at a time.
class Profile {
 public:
  // @param hits room for kHitsOfEdge @return how many
  HWY_ATTR std::size_t Find(const FieldQuery& query, const Way& way, std::int32_t feature, float step, FieldHit* hits) {
    const Floats d;
    const auto blocks = static_cast<std::size_t>(
        std::clamp(static_cast<int>(way.length / (step * static_cast<float>(kFieldLanes - 1))) + 1, 1, kMostBlocks));
    const std::size_t points = blocks * kFieldLanes;
    const float part = 1.0f / static_cast<float>(points - 1);
    for (std::size_t first = 0; first < points; first += kLanes) {
      const F along = hn::Mul(hn::Iota(d, static_cast<float>(first)), All(part));
      hn::Store(DistanceOf(query.field, Rest(way, along)).value, d, distance_ + first);
    }
    std::size_t found = 0;
    const auto add = [&](std::size_t i, float beyond) HWY_ATTR {
      hits[found++] = HitAt(query, way, feature, (static_cast<float>(i) + beyond) * part);
    };
    for (std::size_t i = 0; i + 1 < points && found < kHitsOfEdge; ++i) {
      const float here = distance_[i], next = distance_[i + 1];
      if ((here < 0.0f) != (next < 0.0f)) {
        add(i, here / (here - next));
      } else if ((here <= way.reach) != (next <= way.reach)) {
        add(i, (way.reach - here) / (next - here));
      } else if (i > 0 && here >= 0.0f && here <= way.reach && here < distance_[i - 1] && here <= next) {
        add(i, 0.0f);
      }
    }
    return found;
  }

 private:
  static constexpr int kMostBlocks = 12;

  static HWY_INLINE HWY_ATTR Points Rest(const Way& way, F along) {
    const F late = hn::Max(hn::Sub(hn::Add(along, along), All(1.0f)), All(0.0f)),
            early = hn::Min(hn::Add(along, along), All(1.0f));
    const auto axis = [&](int a) HWY_ATTR {
      return hn::MulAdd(late, All(way.rest[2][a] - way.rest[1][a]),
                        Mix(All(way.rest[0][a]), All(way.rest[1][a]), early));
    };
    return {axis(0), axis(1), axis(2)};
  }
  static HWY_ATTR FieldHit HitAt(const FieldQuery& query, const Way& way, std::int32_t feature, float along) {
    const Points r = Rest(way, All(along));
    Lanes lanes;
    lanes.Store(r, r, DistanceOf(query.field, r));
    FieldHit hit = lanes.Hit(0, feature, along);
    for (int a = 0; a < 3; ++a) hit.at[a] = way.from[a] + along * (way.to[a] - way.from[a]);
    return hit;
  }

  HWY_ALIGN float distance_[kMostBlocks * kFieldLanes];
};

// Eight edges at a time: their ends and middles in the field's frame, and carried back.
class EdgeBlock {
 public:
  // @return those that may come within reach, a bit each
  HWY_ATTR unsigned Look(const FieldQuery& query, const ShellView& shell, const std::int32_t* ends) {
    const Floats d;
    const Points x = GatherEnds(shell.coordinates, ends), y = GatherEnds(shell.coordinates, ends + kFieldLanes);
    const Points a = Placed(query, x), b = Placed(query, y);
    const Points across = Difference(b, a);
    const F length = hn::Sqrt(Dot(across, across)), half = hn::Mul(All(0.5f), length);
    const Points middle{hn::MulAdd(All(0.5f), across.x, a.x), hn::MulAdd(All(0.5f), across.y, a.y),
                        hn::MulAdd(All(0.5f), across.z, a.z)};
    // Distances change by no more than the way: what is farther from the surface than half an edge does not reach it,
    // from neither side.
    const auto long_enough = hn::Gt(length, hn::Zero(d));
    const F coarse = hn::Abs(DistanceOf(query.field, middle).value);
    const F reach =
        hn::Add(All(query.reach), hn::Max(Motion(query, shell, x, ends), Motion(query, shell, y, ends + kFieldLanes)));
    const auto near = hn::And(long_enough, hn::Le(coarse, hn::Add(half, hn::Add(reach, All(query.flex)))));
    if (hn::AllFalse(d, near)) return 0;
    // The same of its two halves, in the rest shape.
    const Points start = CarriedBack(query.lattice, a), centre = CarriedBack(query.lattice, middle),
                 end = CarriedBack(query.lattice, b);
    const F at_start = hn::Abs(DistanceOf(query.field, start).value),
            at_end = hn::Abs(DistanceOf(query.field, end).value),
            at_centre = hn::Abs(DistanceOf(query.field, centre).value);
    const F most = hn::MulAdd(All(2.0f), reach, half);
    const auto within =
        hn::And(near, hn::Or(hn::Le(hn::Add(at_start, at_centre), most), hn::Le(hn::Add(at_centre, at_end), most)));
    const unsigned bits = Bits(within);
    if (bits == 0) return 0;
    Store(a, from_), Store(b, to_);
    Store(start, rest_[0]), Store(centre, rest_[1]), Store(end, rest_[2]);
    hn::Store(length, d, length_), hn::Store(reach, d, reach_);
    return bits;
  }
  Way At(unsigned lane) const {
    Way way;
    for (int a = 0; a < 3; ++a) {
      way.from[a] = from_[a][lane], way.to[a] = to_[a][lane];
      for (int i = 0; i < 3; ++i) way.rest[i][a] = rest_[i][a][lane];
    }
    way.length = length_[lane], way.reach = reach_[lane];
    return way;
  }

 private:
  // How far ends are expected to move.
  static HWY_INLINE HWY_ATTR F Motion(const FieldQuery& query, const ShellView& shell, const Points& x,
                                      const std::int32_t* ends) {
    Points moved = Carried(query, x);
    if (shell.swings != nullptr) moved = Rotated(query.R, GatherEnds(shell.swings, ends), moved);
    return hn::Sqrt(Dot(moved, moved));
  }
  static HWY_INLINE HWY_ATTR void Store(const Points& p, float (&to)[3][kLanes]) {
    const Floats d;
    hn::Store(p.x, d, to[0]), hn::Store(p.y, d, to[1]), hn::Store(p.z, d, to[2]);
  }
  HWY_ALIGN float from_[3][kLanes], to_[3][kLanes], rest_[3][3][kLanes], length_[kLanes], reach_[kLanes];
};

HWY_ATTR std::size_t NearEdges(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                               std::size_t count, float step, FieldHit* hits) {
  Profile profile;
  EdgeBlock block;
  std::size_t found = 0;
  for (std::size_t c = 0; c < count; ++c) {
    const std::size_t cluster = clusters[c];
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      unsigned within = block.Look(query, shell, shell.edge_ends + 2 * kFieldLanes * cluster + lane);
      for (; within != 0; within &= within - 1) {
        const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(within));
        const auto edge = static_cast<std::int32_t>(cluster * kFieldLanes + lane + at);
        found += profile.Find(query, block.At(at), edge, step, hits + found);
      }
    }
  }
  return found;
}

HWY_ATTR bool FirstExit(const FieldQuery& query, const float* from, const float* to, float step, FieldHit* exit) {
  Way way;
  Lanes lanes;
  for (int i = 0; i < 3; ++i) {
    const auto at = [&](int a) HWY_ATTR { return All(from[a] + 0.5f * static_cast<float>(i) * (to[a] - from[a])); };
    const Points q{at(0), at(1), at(2)}, r = CarriedBack(query.lattice, q);
    lanes.Store(q, r, Distance{All(0.0f), q});
    for (int a = 0; a < 3; ++a) way.rest[i][a] = lanes.rest[a][0];
  }
  float squared = 0.0f;
  for (int a = 0; a < 3; ++a)
    way.from[a] = from[a], way.to[a] = to[a], squared += (to[a] - from[a]) * (to[a] - from[a]);
  way.length = std::sqrt(squared), way.reach = query.reach;
  Profile profile;
  FieldHit hits[kHitsOfEdge];
  if (profile.Find(query, way, 0, step, hits) == 0) return false;
  *exit = hits[0];  // inside nothing but a change of sign counts
  return true;
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

std::size_t near_clusters(const FieldQuery& query, const ClusterView& clusters, std::uint32_t* found) {
  return HWY_DYNAMIC_DISPATCH(NearClusters)(query, clusters, found);
}

std::size_t near_samples(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                         std::size_t count, FieldHit* hits) {
  return HWY_DYNAMIC_DISPATCH(NearSamples)(query, shell, clusters, count, hits);
}

std::size_t near_edges(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                       std::size_t count, float step, FieldHit* hits) {
  return HWY_DYNAMIC_DISPATCH(NearEdges)(query, shell, clusters, count, step, hits);
}

bool first_exit(const FieldQuery& query, const float from[3], const float to[3], float step, FieldHit& exit) {
  return HWY_DYNAMIC_DISPATCH(FirstExit)(query, from, to, step, &exit);
}

FieldHit field_at(const FieldQuery& query, const float x[3]) { return HWY_DYNAMIC_DISPATCH(FieldAt)(query, x); }

}  // namespace limber::internal
#endif  // HWY_ONCE
