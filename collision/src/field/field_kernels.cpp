#include "field/field_kernels.h"

#include <algorithm>
#include <cmath>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "field/field_kernels.cpp"
// Points are structs of vectors, which vectors of a length unknown to the compiler cannot form: those machines run the
// fixed 128-bit code.
#define HWY_DISABLED_TARGETS (HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV)
#include <hwy/foreach_target.h>
// foreach_target first
#include <hwy/highway.h>

#include "field/field_distance-inl.h"

HWY_BEFORE_NAMESPACE();
namespace limber::internal::HWY_NAMESPACE {

HWY_ATTR std::size_t NearClusters(const FieldQuery& query, const ClusterView& clusters, std::uint32_t* found,
                                  const SampleBounds& bounds) {
  const Floats d;
  const F reach = All(query.reach), others = hn::Add(All(query.swing), Strays(query));
  std::size_t count = 0;
  const F unknown = All(std::numeric_limits<float>::quiet_NaN());
  HWY_ALIGN float clears[kLanes];
  for (std::size_t g = 0; g < clusters.groups; ++g)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points centre = LoadCluster(clusters.centres + g * kClusterFloats, lane), q = Placed(query, centre),
                   way = Carried(query, centre);
      const F radius = hn::LoadU(d, clusters.radii + g * kFieldLanes + lane);
      const auto used = hn::Ge(radius, hn::Zero(d));
      const F spread = hn::MulAdd(All(1.0f + query.turning), radius, others);
      F clear = hn::Sub(hn::Max(BeyondBox(query, q, way), Lower(HeightsOf(query.above, centre))), spread);
      if (!hn::AllFalse(d, hn::And(used, hn::Le(clear, reach)))) {
        const Points r = CarriedBack(query.lattice, q);
        clear = hn::Max(clear, hn::Sub(ClearOnTheWay(query, DistanceOf(query.field, r).value, r, way), spread));
      }
      for (unsigned left = Bits(hn::And(used, hn::Le(clear, reach))); left != 0; left &= left - 1) {
        const auto at = static_cast<unsigned>(hwy::Num0BitsBelowLS1Bit_Nonzero32(left));
        found[count++] = static_cast<std::uint32_t>(g * kFieldLanes + lane + at);
      }
      if (bounds.distance == nullptr) continue;
      hn::Store(clear, d, clears);
      for (std::size_t c = 0; c < kLanes; ++c)
        for (std::size_t s = 0; s < kFieldLanes; s += kLanes) {
          const std::size_t first = (g * kFieldLanes + lane + c) * kFieldLanes + s;
          hn::StoreU(All(clears[c]), d, bounds.distance + first);
          hn::StoreU(All(clears[c]), d, bounds.clear + first);
          StoreCluster({unknown, unknown, unknown}, bounds.slope + kClusterFloats / kFieldLanes * (first - s), s);
        }
    }
  return count;
}

HWY_ATTR std::size_t NearSamples(const FieldQuery& query, const ShellView& shell, const std::uint32_t* clusters,
                                 std::size_t count, FieldHit* hits, const SampleBounds& bounds) {
  const Floats d;
  const F reach = All(query.reach);
  std::size_t found = 0;
  Lanes lanes;
  for (std::size_t c = 0; c < count; ++c) {
    const std::size_t cluster = clusters[c];
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points x = LoadCluster(shell.coordinates + cluster * kClusterFloats, lane), q = Placed(query, x);
      Points way = Carried(query, x);
      Heights above = HeightsOf(query.above, x);
      if (shell.swings != nullptr) {
        const Points swing = LoadCluster(shell.swings + cluster * kClusterFloats, lane);
        way = Rotated(query.R, swing, way);
        above = HeightsOf(query.above, x, swing);
      }
      const auto keep_bounds = [&](F least, F clear, const Points& slope) HWY_ATTR {
        if (bounds.distance == nullptr) return;
        hn::StoreU(least, d, bounds.distance + cluster * kFieldLanes + lane);
        hn::StoreU(hn::IfThenElse(hn::Lt(least, hn::Zero(d)), hn::Neg(least), clear), d,
                   bounds.clear + cluster * kFieldLanes + lane);
        StoreCluster(slope, bounds.slope + cluster * kClusterFloats, lane);
      };
      const F beyond = hn::Sub(hn::Max(BeyondBox(query, q, way), Lower(above)), Strays(query));
      if (hn::AllFalse(d, hn::Le(beyond, reach))) {
        const F unknown = All(std::numeric_limits<float>::quiet_NaN());
        keep_bounds(beyond, beyond, {unknown, unknown, unknown});
        continue;
      }
      const Points r = CarriedBack(query.lattice, q);
      const Distance distance = DistanceOf(query.field, r);
      const F clear = hn::Max(beyond, ClearOnTheWay(query, distance.value, r, way));
      keep_bounds(distance.value, clear, distance.slope);
      unsigned within = Bits(
          hn::And(hn::Le(distance.value, hn::Add(reach, Closing(query, distance.slope, way))), hn::Le(clear, reach)));
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

HWY_ATTR float LargestDistance(const float* clusters, const float* others, std::size_t count) {
  const Floats d;
  F most = hn::Zero(d);
  for (std::size_t c = 0; c < count; ++c)
    for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
      const Points v =
          Difference(LoadCluster(clusters + c * kClusterFloats, lane), LoadCluster(others + c * kClusterFloats, lane));
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

HWY_ATTR LowestSamples Lowest(const ShellView& shell, const HeightView& heights) {
  const Floats d;
  const Ints i;
  HWY_ALIGN float height[2][kFieldLanes];
  HWY_ALIGN std::int32_t cluster[2][kFieldLanes];
  for (std::size_t lane = 0; lane < kFieldLanes; lane += kLanes) {
    F least[2] = {All(std::numeric_limits<float>::infinity()), All(std::numeric_limits<float>::infinity())};
    I at[2] = {hn::Zero(i), hn::Zero(i)};
    for (std::size_t c = 0; c < shell.clusters; ++c) {
      const std::size_t first = c * kClusterFloats;
      const Points x = LoadCluster(shell.coordinates + first, lane);
      const Heights h = shell.swings != nullptr ? HeightsOf(heights, x, LoadCluster(shell.swings + first, lane))
                                                : HeightsOf(heights, x);
      const auto keep = [&](F value, F& lowest, I& where) HWY_ATTR {
        const auto lower = hn::Lt(value, lowest);
        lowest = hn::IfThenElse(lower, value, lowest);
        where = hn::IfThenElse(hn::RebindMask(i, lower), hn::Set(i, static_cast<std::int32_t>(c)), where);
      };
      keep(h.now, least[0], at[0]), keep(h.then, least[1], at[1]);
    }
    for (std::size_t end = 0; end < 2; ++end)
      hn::Store(least[end], d, height[end] + lane), hn::Store(at[end], i, cluster[end] + lane);
  }
  LowestSamples lowest{};
  for (std::size_t end = 0; end < 2; ++end) {
    std::size_t best = 0;
    for (std::size_t lane = 1; lane < kFieldLanes; ++lane)
      if (height[end][lane] < height[end][best] ||
          (height[end][lane] == height[end][best] && cluster[end][lane] < cluster[end][best]))
        best = lane;
    lowest.height[end] = height[end][best];
    lowest.sample[end] = cluster[end][best] * static_cast<std::int32_t>(kFieldLanes) + static_cast<std::int32_t>(best);
  }
  return lowest;
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
HWY_EXPORT(LargestDistance);
HWY_EXPORT(LargestMagnitudes);
HWY_EXPORT(Lowest);
HWY_EXPORT(BoxOfClusters);
HWY_EXPORT(NearClusters);
HWY_EXPORT(NearSamples);
HWY_EXPORT(FieldAt);

void multiply_rows(const float* rest, const float* U, std::size_t tiles, std::size_t modes, const float* const* z,
                   float* const* out, std::size_t bodies) {
  HWY_DYNAMIC_DISPATCH(MultiplyRows)(rest, U, tiles, modes, z, out, bodies);
}

float largest_distance(const float* clusters, const float* others, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(LargestDistance)(clusters, others, count);
}

void largest_magnitudes(const float* points, std::size_t count, float largest[3]) {
  HWY_DYNAMIC_DISPATCH(LargestMagnitudes)(points, count, largest);
}

LowestSamples lowest_samples(const ShellView& shell, const HeightView& heights) {
  return HWY_DYNAMIC_DISPATCH(Lowest)(shell, heights);
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

FieldHit field_at(const FieldQuery& query, const float x[3]) { return HWY_DYNAMIC_DISPATCH(FieldAt)(query, x); }

}  // namespace limber::internal
#endif  // HWY_ONCE
