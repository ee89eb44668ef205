#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "asked.h"
#include "counted_new.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/tree_traversal.h"
#include "limber/core/error.h"
#include "random_states.h"
#include "shapes.h"
#include "soup.h"
#include "wavy_surface.h"

namespace limber {
namespace {

using testing::Random;
using testing::wavy_surface;
using Surface = std::shared_ptr<const CollisionSurface>;

TrianglePoints moved(const RigidTransform& X, TrianglePoints x) {
  for (Vec3& p : x) p = X * p;
  return x;
}

/// The traversal's pairs that are within the margin are those that all pairs of triangles give.
void expect_pairs_as_brute_force(DeformedSurface& a, DeformedSurface& b, const RigidTransform& X_AB, double margin) {
  std::vector<TrianglePair> pairs;
  find_triangle_pairs(a, b, X_AB, margin, pairs);
  const std::set<TrianglePair> found(pairs.begin(), pairs.end());
  EXPECT_EQ(found.size(), pairs.size()) << "a pair is reported twice";
  for (Index t = 0; t < a.surface().triangles(); ++t)
    for (Index u = 0; u < b.surface().triangles(); ++u) {
      if (found.contains({t, u})) continue;
      ASSERT_GT(closest_points(a.triangle(t), moved(X_AB, b.triangle(u))).distance, margin) << t << ", " << u;
    }
}

TEST(TreeTraversal, PairsHoldEveryPairWithinTheMargin) {
  Random random(2);
  const Surface round = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 1), 8, 2),
                long_one = wavy_surface(shapes::box({-2, -0.1, -0.2}, {2, 0.1, 0.2}), 3),
                off_center = wavy_surface(shapes::sphere(Vec3(1.0, 2.0, 3.0), 0.7, 2), 5, 4);
  DeformedSurface a, b;
  for (int trial = 0; trial < 18; ++trial) {
    const Surface& first = trial % 2 ? round : off_center;
    const Surface& second = trial % 3 ? long_one : round;
    a.bind(first, random.amplitudes(first->modes(), trial % 5 ? 0.2 : 30.0));
    b.bind(second, random.amplitudes(second->modes(), 0.2));
    expect_pairs_as_brute_force(a, b, random.pose(2.0), trial % 4 ? 0.0 : 0.3);
    if (HasFatalFailure()) return;
  }
}

TEST(TreeTraversal, TheSameBodyInTheSamePlaceMeetsItselfEverywhere) {
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 2), 4);
  DeformedSurface a, b;
  a.bind(s, std::vector<double>(4, 0.1));
  b.bind(s, std::vector<double>(4, 0.1));
  std::vector<TrianglePair> pairs;
  find_triangle_pairs(a, b, {}, 0.0, pairs);
  const std::set<TrianglePair> found(pairs.begin(), pairs.end());
  for (Index t = 0; t < s->triangles(); ++t) EXPECT_TRUE(found.contains({t, t}));
}

TEST(TreeTraversal, PairsDoNotDependOnWhoIsFirst) {
  Random random(12);
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 3), 16);
  for (int trial = 0; trial < testing::all_or_tenth(20); ++trial) {
    const auto y = random.amplitudes(16, 0.1), z = random.amplitudes(16, 0.1);
    const RigidTransform X_AB = random.pose(1.2);
    std::set<TrianglePair> touching[2];
    for (int way = 0; way < 2; ++way) {
      DeformedSurface a, b;
      a.bind(s, y);
      b.bind(s, z);
      std::vector<TrianglePair> pairs;
      if (way == 0)
        find_triangle_pairs(a, b, X_AB, 0.0, pairs);
      else
        find_triangle_pairs(b, a, X_AB.inverse(), 0.0, pairs);
      for (const auto& [first, second] : pairs) {
        const auto [t, u] = way == 0 ? std::pair{first, second} : std::pair{second, first};
        if (closest_points(a.triangle(t), moved(X_AB, b.triangle(u))).intersecting) touching[way].insert({t, u});
      }
    }
    EXPECT_EQ(touching[1], touching[0]);
  }
}

TEST(TreeTraversal, FarBodiesCostTwoBoxesAndNoVertex) {
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 3), 8);
  DeformedSurface a, b;
  a.bind(s, std::vector<double>(8, 0.01));
  b.bind(s, std::vector<double>(8, 0.01));
  std::vector<TrianglePair> pairs;
  find_triangle_pairs(a, b, {.q = {}, .p = {5.0, 0.0, 0.0}}, 0.1, pairs);
  EXPECT_TRUE(pairs.empty());
  EXPECT_EQ(a.counters().boxes + b.counters().boxes, 2);
  EXPECT_EQ(a.counters().vertices + b.counters().vertices, 0);
}

TEST(TreeTraversal, RegionsHoldEveryTriangleThatReachesIn) {
  Random random(13);
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 2), 6);
  DeformedSurface a;
  for (int trial = 0; trial < 100; ++trial) {
    a.bind(s, random.amplitudes(6, 0.3));
    const Vec3 center = random.vector(1.5), normal = random.vector(1.0).normalized();
    const double offset = random.uniform(-1.0, 1.0);
    const Aabb box{center - Vec3(0.1, 0.3, 0.5), center + Vec3(0.1, 0.3, 0.5)};
    std::vector<Index> in_half_space, in_box;
    find_triangles_in_half_space(a, normal, offset, in_half_space);
    find_triangles_in_box(a, box, in_box);
    const auto has = [](const std::vector<Index>& all, Index t) {
      return std::find(all.begin(), all.end(), t) != all.end();
    };
    for (Index t = 0; t < s->triangles(); ++t) {
      const TrianglePoints x = a.triangle(t);
      if (std::min({normal.dot(x[0]), normal.dot(x[1]), normal.dot(x[2])}) <= offset) {
        EXPECT_TRUE(has(in_half_space, t));
      }
      if (box.contains(x[0]) || box.contains((x[0] + x[1] + x[2]) / 3.0)) {
        EXPECT_TRUE(has(in_box, t));
      }
    }
  }
}

TEST(TreeTraversal, NearestPointIsTheNearestOfAllTriangles) {
  Random random(14);
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 2), 6);
  DeformedSurface a;
  for (int trial = 0; trial < 200; ++trial) {
    a.bind(s, random.amplitudes(6, trial % 7 ? 0.3 : 20.0));
    const Vec3 p = random.vector(2.0);
    double least = std::numeric_limits<double>::infinity();
    for (Index t = 0; t < s->triangles(); ++t)
      least = std::min(least, (closest_on_triangle(p, a.triangle(t)).point - p).norm());
    const auto nearest = nearest_point(a, p);
    ASSERT_TRUE(nearest.has_value());
    EXPECT_EQ(nearest->distance, least);
    const TrianglePoints x = a.triangle(nearest->triangle);
    const Vec3 foot = nearest->weight[0] * x[0] + nearest->weight[1] * x[1] + nearest->weight[2] * x[2];
    const double kRoundOff = 1e-14 * (1.0 + x[0].norm() + x[1].norm() + x[2].norm());
    EXPECT_LE((foot - nearest->point_B).norm(), kRoundOff);
    EXPECT_FALSE(nearest_point(a, p, 0.999 * least).has_value());
  }
}

/// All pairs of triangles without a common vertex that are within the margin.
TEST(TreeTraversal, SelfPairsHoldWhatBruteForceFinds) {
  Random random(17);
  // A thin bar, finely divided along its length, that can be bent until its ends meet.
  SurfaceMesh bar;
  for (int i = 0; i <= 14; ++i)
    for (const auto& [y, z] : {std::pair{-0.05, -0.1}, {0.05, -0.1}, {0.05, 0.1}, {-0.05, 0.1}})
      bar.vertices.emplace_back(i / 7.0 - 1.0, y, z);
  for (Index i = 0; i < 14; ++i)
    for (Index c = 0; c < 4; ++c) {
      const Index d = (c + 1) % 4;
      bar.triangles.push_back({4 * i + c, 4 * i + d, 4 * i + 4 + d});
      bar.triangles.push_back({4 * i + c, 4 * i + 4 + d, 4 * i + 4 + c});
    }
  const Surface s = wavy_surface(bar, 6, 2);
  DeformedSurface a;
  int touching = 0;
  for (int trial = 0; trial < 12; ++trial) {
    a.bind(s, random.amplitudes(6, trial % 2 ? 2.0 : 0.05));
    const double margin = trial % 4 < 2 ? 0.0 : 0.02;
    std::vector<TrianglePair> pairs;
    find_self_pairs(a, margin, pairs);
    const std::set<TrianglePair> found(pairs.begin(), pairs.end());
    EXPECT_EQ(found.size(), pairs.size());
    for (Index t = 0; t < s->triangles(); ++t)
      for (Index u = t + 1; u < s->triangles(); ++u) {
        if (s->adjacent(t, u)) {
          EXPECT_FALSE(found.contains({t, u}));
        } else if (!found.contains({t, u})) {
          ASSERT_GT(closest_points(a.triangle(t), a.triangle(u)).distance, margin);
        } else {
          ++touching;
        }
      }
  }
  EXPECT_GT(touching, 100) << "the bar was to meet itself";
}

TEST(TreeTraversal, PartsFarApartAtRestAreNoPairs) {
  SurfaceMesh two = shapes::sphere(Vec3(-5.0, 0.0, 0.0), 1.0, 2);
  const auto of_first = static_cast<Index>(two.triangles.size());
  shapes::append(shapes::sphere(Vec3(5.0, 0.0, 0.0), 1.0, 2), two);
  const Surface s = wavy_surface(two, 4);
  DeformedSurface a;
  a.bind(s, std::vector<double>(4, 0.1));
  std::vector<TrianglePair> pairs;
  find_self_pairs(a, 0.1, pairs);
  for (const auto& [t, u] : pairs) EXPECT_EQ(t < of_first, u < of_first);
}

TEST(TreeTraversal, DegenerateSurfacesAreWalked) {
  const auto one =
      std::make_shared<const CollisionSurface>(TriangleMesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}});
  const auto point = std::make_shared<const CollisionSurface>(TriangleMesh{{{0.2, 0.2, 0}}, {{0, 0, 0}}});
  const auto messy = std::make_shared<const CollisionSurface>([] {
    const SurfaceMesh mesh = shapes::soup();
    return TriangleMesh{mesh.vertices, mesh.triangles};
  }());
  DeformedSurface a, b;
  for (const auto& first : {one, point, messy})
    for (const auto& second : {one, point, messy}) {
      a.bind(first, {});
      b.bind(second, {});
      std::vector<TrianglePair> pairs;
      find_triangle_pairs(a, b, {}, 0.01, pairs);
      EXPECT_FALSE(first == second && pairs.empty()) << "a surface meets itself";
      find_self_pairs(a, 0.01, pairs);
      EXPECT_TRUE(nearest_point(a, Vec3(3.0, 0.0, 0.0)).has_value());
    }
}

TEST(TreeTraversal, WarmWalksAllocateNothing) {
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 3), 8);
  DeformedSurface a, b;
  const std::vector<double> z(8, 0.02);
  std::vector<TrianglePair> pairs;
  std::vector<Index> triangles;
  const auto all = [&] {
    pairs.clear(), triangles.clear();
    a.bind(s, z);
    b.bind(s, z);
    find_triangle_pairs(a, b, {.q = {}, .p = {1.8, 0.0, 0.0}}, 0.01, pairs);
    find_self_pairs(a, 0.0, pairs);
    find_triangles_in_box(a, {Vec3(0.8, -0.2, -0.2), Vec3(1.2, 0.2, 0.2)}, triangles);
    (void)nearest_point(a, Vec3(1.2, 0.0, 0.0));
  };
  all();
  const long before = testing::allocations();
  all();
  EXPECT_EQ(testing::allocations(), before);
}

TEST(TreeTraversal, RefusesANegativeMargin) {
  const Surface s = wavy_surface(shapes::sphere(Vec3::Zero(), 1.0, 1), 2);
  DeformedSurface a, b;
  a.bind(s, std::vector<double>(2, 0.0));
  b.bind(s, std::vector<double>(2, 0.0));
  std::vector<TrianglePair> pairs;
  EXPECT_THROW(find_triangle_pairs(a, b, {}, -1.0, pairs), InvalidArgument);
  EXPECT_THROW(find_self_pairs(a, std::nan(""), pairs), InvalidArgument);
}

}  // namespace
}  // namespace limber
