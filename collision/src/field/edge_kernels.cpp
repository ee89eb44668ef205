#include "field/field_kernels.h"

#include <algorithm>
#include <cmath>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "field/edge_kernels.cpp"
// Points are structs of vectors, which vectors of a length unknown to the compiler cannot form: those machines run the
// fixed 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

#include "field/field_distance-inl.h"

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {

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
  HWY_ATTR unsigned Look(const ShellView& shell, const SampleBounds& bounds) const {
    const Floats d;
    const F length = ways_.Length(), zero = hn::Zero(d), half_way = All(0.5f);
    const Distance centre = DistanceOf(query_.field, ways_.Centre());
    const auto inside = hn::Lt(centre.value, zero);
    const Points of_a = Moved(shell, a_, from_), of_b = Moved(shell, b_, to_), apart = Difference(of_b, of_a);
    const Points then = Added(ways_.Across(), apart);
    const F longest = hn::Max(length, hn::Sqrt(Dot(then, then)));
    const Points way{Mix(of_a.x, of_b.x, half_way), Mix(of_a.y, of_b.y, half_way), Mix(of_a.z, of_b.z, half_way)};
    const F clear =
        hn::IfThenElse(inside, hn::Neg(centre.value), ClearOnTheWay(query_, centre.value, ways_.Centre(), way));
    const F most = hn::MulAdd(half_way, longest, hn::Sub(All(2.0f * query_.reach), clear));
    // Distances change by no more than the way. A slope that is not known may turn.
    const auto half = [&](I end, float from) HWY_ATTR {
      const F distance = hn::GatherIndex(d, bounds.distance, end), out = hn::IfThenElse(inside, All(-from), All(from));
      const auto near = hn::Le(hn::GatherIndex(d, bounds.clear, end), most);
      const auto through = hn::Xor(inside, hn::Lt(distance, zero));
      const Points slope = GatherSamples(bounds.slope, end);
      const auto turns = TurnsUp(hn::Mul(out, Dot(slope, ways_.Across())),
                                 hn::Mul(out, Dot(centre.slope, ways_.Across())), Level(length));
      return hn::And(near, hn::Or(through, hn::Or(hn::IsNaN(slope.x), turns)));
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

// Distances change by no more than the way: an edge whose ends stay clear of the surface by more than its length
// together does not reach it, from neither side. Nor does one whose ends stay above the other's plane. A bit each.
// @param longest no edge of these is longer, now
HWY_INLINE HWY_ATTR unsigned MayReach(const FieldQuery& query, const ShellView& shell, const SampleBounds& bounds,
                                      I from, I to, float longest) {
  const Floats d;
  const F clear = hn::Add(hn::GatherIndex(d, bounds.clear, from), hn::GatherIndex(d, bounds.clear, to));
  const F over = hn::Sub(clear, All(2.0f * query.reach));
  if (hn::AllFalse(d, hn::Le(over, All(longest + 2.0f * query.swing)))) return 0;
  const Points a = GatherSamples(shell.coordinates, from), b = GatherSamples(shell.coordinates, to);
  const Points across = Difference(b, a);
  Heights at_a = HeightsOf(query.above, a), at_b = HeightsOf(query.above, b);
  F squared = Dot(across, across);
  if (shell.swings != nullptr) {
    const Points swing_a = GatherSamples(shell.swings, from), swing_b = GatherSamples(shell.swings, to);
    const Points then = Added(across, Difference(swing_b, swing_a));
    squared = hn::Max(squared, Dot(then, then));
    at_a = HeightsOf(query.above, a, swing_a), at_b = HeightsOf(query.above, b, swing_b);
  }
  const auto low = hn::Le(hn::Min(Lower(at_a), Lower(at_b)), hn::Add(All(query.reach), Strays(query)));
  return Bits(hn::And(low, hn::Or(hn::Le(over, hn::Zero(d)), hn::Le(hn::Mul(over, over), squared))));
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
    for (wanted &= EdgeBlock(query, shell, looked_at).Look(shell, bounds); wanted != 0; wanted &= wanted - 1) {
      const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(wanted));
      marched.Add(looked_at.edge[at], looked_at.ends[0][at], looked_at.ends[1][at]);
      if (marched.Full()) march();
    }
  };
  for (std::size_t c = 0; c < count; ++c)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const std::int32_t* ends = shell.edge_ends + 2 * kFieldLanes * clusters[c] + lane;
      unsigned within = MayReach(query, shell, bounds, hn::LoadU(Ints(), ends), hn::LoadU(Ints(), ends + kFieldLanes),
                                 2.0f * shell.edges.radii[clusters[c]]);
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

// From point to point along a straight way, then in eighths. The face that is left is the nearest one just outside:
// inside another may be.
HWY_ATTR bool FirstExit(const FieldQuery& query, const float* from, const float* to, float step, FieldHit* exit) {
  const Floats d;
  Ways ways(query, {All(from[0]), All(from[1]), All(from[2])}, {All(to[0]), All(to[1]), All(to[2])});
  ways.CarryBackEnds(query);
  float values[kLanes + 1] = {};  // of the point before a vector of them, then of these
  const auto look = [&](float start, float part) HWY_ATTR {
    const F along = hn::MulAdd(hn::Iota(d, 0.0f), All(part), All(start));
    hn::StoreU(DistanceOf(query.field, ways.Rest(along)).value, d, values + 1);
  };
  // The first of them between which and the next one the sign changes; kLanes: none.
  const auto change = [&](std::size_t first) {
    while (first < kLanes && (values[first] < 0.0f) == (values[first + 1] < 0.0f)) ++first;
    return first;
  };
  const float length = hn::GetLane(ways.Length());
  const int points = std::clamp(static_cast<int>(length / step) + 2, 2, 96);
  const float part = 1.0f / static_cast<float>(points - 1), eighth = part / static_cast<float>(kLanes);
  for (int first = 0; first < points; first += static_cast<int>(kLanes)) {
    look(part * static_cast<float>(first), part);
    const std::size_t i = change(first == 0 ? 1 : 0);
    if (i < kLanes) {
      const float start = part * (static_cast<float>(first + static_cast<int>(i)) - 1.0f), before = values[i];
      look(start + eighth, eighth);
      values[0] = before;
      const std::size_t j = std::min(change(0), kLanes - 1);
      const float before_it = start + eighth * static_cast<float>(j);
      const F outside = All(before_it + eighth);
      const Points r = ways.Rest(outside);
      Lanes lanes;
      lanes.Store(ways.At(outside), r, DistanceOf(query.field, r));
      *exit = lanes.Hit(0, 0, before_it + eighth * values[j] / (values[j] - values[j + 1]));
      return exit->along <= 1.0f;
    }
    values[0] = values[kLanes];
  }
  return false;
}

}  // namespace limber::internal::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace limber::internal {

HWY_EXPORT(NearEdges);
HWY_EXPORT(FirstExit);

std::size_t near_edges(const FieldQuery& query, const ShellView& shell, const SampleBounds& ends,
                       const std::uint32_t* clusters, std::size_t count, float step, FieldHit* hits) {
  return HWY_DYNAMIC_DISPATCH(NearEdges)(query, shell, ends, clusters, count, step, hits);
}

bool first_exit(const FieldQuery& query, const float from[3], const float to[3], float step, FieldHit& exit) {
  return HWY_DYNAMIC_DISPATCH(FirstExit)(query, from, to, step, &exit);
}

}  // namespace limber::internal
#endif  // HWY_ONCE
