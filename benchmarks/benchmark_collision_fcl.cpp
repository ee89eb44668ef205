// limber beside FCL: distances of boxes and hulls that are apart, with their errors. See README.md.
#include <benchmark/benchmark.h>
#include <fcl/geometry/shape/convex.h>
#include <fcl/narrowphase/distance.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "cpu_time.h"
#include "limber/collision/closest_features.h"
#include "random_states.h"

namespace limber {
namespace {

using testing::Random;

// -- Distances of convex solids ---------------------------------------------------------------------------------------

struct PlacedBox {
  Vec3 half_extents = Vec3::Ones();
  RigidTransform pose{};

  std::array<Vec3, 8> corners(const RigidTransform& X) const {
    std::array<Vec3, 8> all;
    for (std::size_t i = 0; i < 8; ++i)
      all[i] =
          X * half_extents.cwiseProduct(Vec3((i & 1u) != 0 ? 1 : -1, (i & 2u) != 0 ? 1 : -1, (i & 4u) != 0 ? 1 : -1));
    return all;
  }
};
using BoxPair = std::pair<PlacedBox, PlacedBox>;

enum Boxes { kNear, kFar, kAllButTouching, kSlivers, kSmall, kLarge, kSmallOnLarge, kFlush };
constexpr std::array kBoxesNames{"near",      "100 sizes apart", "gap 1e-12 to 1e-7", "1000 times flatter",
                                 "size 1e-3", "size 1e3",        "1e-3 on 1e3",       "flush, gap 1e-9"};

Vec3 random_extents(Random& random, double size) {
  return size * Vec3(random.uniform(0.1, 1.0), random.uniform(0.1, 1.0), random.uniform(0.1, 1.0));
}

/// Turned at random, and as far apart as told along a random direction.
BoxPair random_boxes(Boxes kind, Random& random) {
  const double size = kind == kSmall ? 1e-3 : kind == kLarge || kind == kSmallOnLarge ? 1e3 : 1.0;
  BoxPair pair{{random_extents(random, kind == kSmallOnLarge ? 1e-3 : size)}, {random_extents(random, size)}};
  auto& [a, b] = pair;
  if (kind == kFlush) {
    b.pose.q = quaternion_from_rotation_vector({0.0, 0.0, random.uniform(0.0, 3.0)});
    b.pose.p.z() = a.half_extents.z() + b.half_extents.z() + 1e-9;
    return pair;
  }
  if (kind == kSlivers) a.half_extents.z() *= 1e-3, b.half_extents.x() *= 1e-3;
  a.pose = random.pose(0.1 * size), b.pose.q = random.pose(1.0).q;
  const double gap = kind == kFar              ? 100.0
                     : kind == kAllButTouching ? std::pow(10.0, random.uniform(-12.0, -7.0))
                                               : random.uniform(0.0, 0.2 * size);
  const Vec3 way = random.vector(1.0).normalized();
  double end = -1e300, start = 1e300;
  for (const Vec3& p : a.corners(a.pose)) end = std::max(end, way.dot(p));
  for (const Vec3& p : b.corners(b.pose)) start = std::min(start, way.dot(p));
  b.pose.p = (end - start + gap) * way;
  return pair;
}

/// By the closest points of all pairs of triangles.
double distance_of_triangles(const BoxPair& pair) {
  constexpr std::array<std::array<std::size_t, 3>, 12> kTriangles{{{0, 2, 1},
                                                                   {1, 2, 3},
                                                                   {4, 5, 6},
                                                                   {5, 7, 6},
                                                                   {0, 1, 4},
                                                                   {1, 5, 4},
                                                                   {2, 6, 3},
                                                                   {3, 6, 7},
                                                                   {0, 4, 2},
                                                                   {2, 4, 6},
                                                                   {1, 3, 5},
                                                                   {3, 7, 5}}};
  const auto p = pair.first.corners(pair.first.pose), q = pair.second.corners(pair.second.pose);
  double least = 1e300;
  for (const auto& s : kTriangles)
    for (const auto& t : kTriangles)
      least = std::min(
          least, closest_points(TrianglePoints{p[s[0]], p[s[1]], p[s[2]]}, TrianglePoints{q[t[0]], q[t[1]], q[t[2]]})
                     .distance);
  return least;
}

fcl::Transform3<double> fcl_transform(const RigidTransform& X) {
  fcl::Transform3<double> T = fcl::Transform3<double>::Identity();
  T.linear() = to_matrix(X.q);
  T.translation() = X.p;
  return T;
}

/// As a hull of eight points, as limber takes it.
fcl::Convex<double> fcl_hull(const PlacedBox& box) {
  static const auto faces = std::make_shared<const std::vector<int>>(
      std::vector<int>{4, 0, 4, 6, 2, 4, 1, 3, 7, 5, 4, 0, 1, 5, 4, 4, 2, 6, 7, 3, 4, 0, 2, 3, 1, 4, 4, 5, 7, 6});
  const auto corners = box.corners({});
  return {std::make_shared<const std::vector<Vec3>>(corners.begin(), corners.end()), 6, faces};
}

/// range(0) how they lie; `error` is the worst, in parts of their sizes; FCL with its own tolerance and with 1e-12 of
/// the sizes.
void convex(benchmark::State& state) {
  constexpr std::size_t kPairs = 1000;
  const auto kind = static_cast<Boxes>(state.range(0));
  state.SetLabel(kBoxesNames[static_cast<std::size_t>(kind)]);
  Random random(7);
  std::vector<BoxPair> pairs;
  std::vector<std::array<std::array<Vec3, 8>, 2>> corners;
  std::vector<std::array<fcl::Convex<double>, 2>> hulls;
  std::vector<std::array<fcl::Transform3<double>, 2>> poses;
  for (std::size_t i = 0; i < kPairs; ++i) {
    const BoxPair& p = pairs.emplace_back(random_boxes(kind, random));
    corners.push_back({p.first.corners(p.first.pose), p.second.corners(p.second.pose)});
    hulls.push_back({fcl_hull(p.first), fcl_hull(p.second)});
    poses.push_back({fcl_transform(p.first.pose), fcl_transform(p.second.pose)});
  }
  const auto size = [&](std::size_t i) {
    return pairs[i].first.half_extents.norm() + pairs[i].second.half_extents.norm();
  };
  std::vector<double> found(kPairs);
  const auto by_limber = [&] {
    for (std::size_t i = 0; i < kPairs; ++i)
      found[i] = distance(ConvexSolid{corners[i][0]}, ConvexSolid{corners[i][1]}).distance;
  };
  const auto by_fcl = [&](double relative) {
    for (std::size_t i = 0; i < kPairs; ++i) {
      fcl::DistanceRequest<double> ask(true);
      if (relative > 0.0) ask.distance_tolerance = relative * size(i);
      fcl::DistanceResult<double> answer;
      found[i] = fcl::distance(&hulls[i][0], poses[i][0], &hulls[i][1], poses[i][1], ask, answer);
    }
  };
  const auto error = [&] {
    double worst = 0.0;
    for (std::size_t i = 0; i < kPairs; ++i)
      worst = std::max(worst, std::abs(found[i] - distance_of_triangles(pairs[i])) / size(i));
    return worst;
  };
  LeastTime limber, fcl_usual, fcl_tight;
  for (auto _ : state) {
    limber.measure(by_limber);
    fcl_usual.measure([&] { by_fcl(0.0); });
    fcl_tight.measure([&] { by_fcl(1e-12); });
  }
  by_limber(), state.counters["limber_error"] = error();
  by_fcl(0.0), state.counters["fcl_error"] = error();
  by_fcl(1e-12), state.counters["fcl_tight_error"] = error();
  state.counters["limber_us"] = 1e6 * limber.seconds() / kPairs;
  state.counters["fcl_us"] = 1e6 * fcl_usual.seconds() / kPairs;
  state.counters["fcl_tight_us"] = 1e6 * fcl_tight.seconds() / kPairs;
}
BENCHMARK(convex)->ArgName("kind")->DenseRange(kNear, kFlush);

}  // namespace
}  // namespace limber
