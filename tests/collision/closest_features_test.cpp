#include "limber/collision/closest_features.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "asked.h"
#include "contact_reference.h"
#include "random_states.h"

namespace limber {
namespace {

using testing::hull_distance;
using testing::Random;

// Of coordinates up to 1: what double precision leaves of a length, and of points that nearly parallel features share.
constexpr double kLength = 1e-14;

/// Triangles that make trouble: general, on a coarse grid (parallel, coplanar, shared vertices), slivers, needles,
/// points.
TrianglePoints troublesome_triangle(Random& random) {
  const auto grid = [&] { return Vec3(random.index(3) - 1, random.index(3) - 1, random.index(3) - 1); };
  const Vec3 p = random.vector(1.0), q = random.vector(1.0);
  switch (random.index(6)) {
    case 0:
      return {grid(), grid(), grid()};
    case 1:
      return {p, q, p + random.uniform(0.0, 1.0) * (q - p)};
    case 2:
      return {p, q, 0.5 * (p + q) + 1e-9 * random.vector(1.0)};
    case 3:
      return {p, p, random.index(2) == 0 ? p : q};
    case 4:
      return {p, p + 1e-6 * random.vector(1.0), q};
    default:
      return {p, q, random.vector(1.0)};
  }
}

template <std::size_t N>
void expect_consistent(const SurfaceFoot& foot, const std::array<Vec3, N>& x) {
  Vec3 p = Vec3::Zero();
  int positive = 0;
  double sum = 0.0;
  for (std::size_t i = 0; i < N; ++i) {
    ASSERT_GE(foot.weight[i], 0.0);
    p += foot.weight[i] * x[i], sum += foot.weight[i], positive += foot.weight[i] > 0.0 ? 1 : 0;
  }
  EXPECT_NEAR(sum, 1.0, 1e-14);
  EXPECT_LE((p - foot.point).norm(), 1e-13);
  EXPECT_LE(positive, 1 + static_cast<int>(foot.feature.kind));
}

TEST(ClosestFeatures, PointToTriangleIsTheLeastOverAllActiveSets) {
  Random random(1);
  for (int trial = 0; trial < testing::all_or_tenth(10000); ++trial) {
    const TrianglePoints t = troublesome_triangle(random);
    const Vec3 p = random.index(4) == 0 ? t[0] : random.vector(1.5);
    const SurfaceFoot foot = closest_on_triangle(p, t);
    ASSERT_NEAR((foot.point - p).norm(), hull_distance({&p, 1}, t).distance, kLength);
    expect_consistent(foot, t);
    const SegmentPoints s{t[0], t[1]};
    const SurfaceFoot on_segment = closest_on_segment(p, s);
    ASSERT_NEAR((on_segment.point - p).norm(), hull_distance({&p, 1}, s).distance, kLength);
    expect_consistent(on_segment, s);
  }
}

TEST(ClosestFeatures, SegmentPairsAreTheLeastOverAllActiveSets) {
  Random random(2);
  for (int trial = 0; trial < testing::all_or_tenth(10000); ++trial) {
    const TrianglePoints t = troublesome_triangle(random), u = troublesome_triangle(random);
    const SegmentPoints a{t[0], t[1]};
    SegmentPoints b{u[0], u[1]};
    // Nearly parallel ones, down to where the angle is round-off.
    if (trial % 3 == 0) {
      const Vec3 aside = random.vector(0.1), turn = std::pow(10.0, random.uniform(-17.0, 0.0)) * random.vector(1.0);
      b = {a[0] + aside, a[1] + aside + turn};
    }
    const ClosestPoints c = closest_points(a, b);
    ASSERT_NEAR(c.distance, hull_distance(a, b).distance, 10 * kLength);
    ASSERT_NEAR(c.distance, (c.a.point - c.b.point).norm(), kLength);
    expect_consistent(c.a, a), expect_consistent(c.b, b);
  }
}

TEST(ClosestFeatures, TrianglePairsAreTheLeastOverAllActiveSets) {
  Random random(3);
  int crossing = 0;
  for (int trial = 0; trial < testing::all_or_tenth(10000); ++trial) {
    const TrianglePoints a = troublesome_triangle(random), b = troublesome_triangle(random);
    const ClosestOrCrossing c = closest_points(a, b);
    const double reference = hull_distance(a, b).distance;
    ASSERT_NEAR(c.distance, reference, 10 * kLength) << "trial " << trial;
    expect_consistent(c.a, a), expect_consistent(c.b, b);
    if (!c.intersecting) continue;
    ++crossing;
    for (const Vec3& end : c.crossing) {
      EXPECT_LE((closest_on_triangle(end, a).point - end).norm(), 10 * kLength);
      EXPECT_LE((closest_on_triangle(end, b).point - end).norm(), 10 * kLength);
    }
  }
  EXPECT_GT(crossing, testing::all_or_tenth(500));
}

TEST(ClosestFeatures, SegmentAndTriangleAreTheLeastOverAllActiveSets) {
  Random random(4);
  for (int trial = 0; trial < testing::all_or_tenth(10000); ++trial) {
    const TrianglePoints t = troublesome_triangle(random), b = troublesome_triangle(random);
    const SegmentPoints a{t[0], t[1]};
    ASSERT_NEAR(closest_points(a, b).distance, hull_distance(a, b).distance, 10 * kLength) << "trial " << trial;
  }
}

TEST(ClosestFeatures, TwoCrossingTrianglesShareTheSegmentWhereTheirPlanesMeet) {
  const TrianglePoints floor{Vec3(-2, -2, 0), Vec3(2, -2, 0), Vec3(0, 3, 0)};
  const TrianglePoints blade{Vec3(-0.5, 0, -1), Vec3(0.5, 0, -1), Vec3(0, 0, 1)};
  const ClosestOrCrossing c = closest_points(floor, blade);
  ASSERT_TRUE(c.intersecting);
  EXPECT_NEAR((c.crossing[1] - c.crossing[0]).norm(), 0.5, kLength);
  for (const Vec3& end : c.crossing) EXPECT_NEAR(std::abs(end.x()), 0.25, kLength);
}

// -- Convex solids ----------------------------------------------------------------------------------------------------

std::vector<Vec3> cloud(Random& random, Index count, const Vec3& at, double size) {
  std::vector<Vec3> points;
  for (Index i = 0; i < count; ++i) points.push_back(at + random.vector(size));
  return points;
}

/// By duality: the plane across the two points proves that nothing is nearer.
double proven_distance(std::span<const Vec3> a, std::span<const Vec3> b, const Vec3& n) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const Vec3& p : a) low = std::min(low, n.dot(p));
  for (const Vec3& p : b) high = std::max(high, n.dot(p));
  return low - high;
}

TEST(ConvexDistance, IsProvenByTheSeparatingPlane) {
  Random random(5);
  int apart = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    const auto a = cloud(random, 1 + random.index(20), Vec3::Zero(), 0.5);
    const auto b = cloud(random, 1 + random.index(20), random.vector(1.5), 0.5);
    const ConvexDistance d = distance(ConvexSolid{a}, ConvexSolid{b});
    if (d.cores_intersect) continue;
    ++apart;
    ASSERT_NEAR(d.normal.norm(), 1.0, 1e-14);
    ASSERT_NEAR(d.distance, d.normal.dot(d.a - d.b), 1e-14);
    // The gap between what is found and what is proven bounds the error of the distance; its square root, over the
    // size, that of the normal.
    ASSERT_NEAR(proven_distance(a, b, d.normal), d.distance, 1e-12 / std::max(d.distance, 1e-3)) << "trial " << trial;
  }
  EXPECT_GT(apart, 5000);
}

TEST(ConvexDistance, PointsAreInTheSolidsAndNormalsThoseOfAllActiveSets) {
  Random random(6);
  for (int trial = 0; trial < testing::all_or_tenth(1000); ++trial) {
    const auto a = cloud(random, 4, Vec3::Zero(), 0.5);
    const auto b = cloud(random, 1 + random.index(5), random.vector(1.2), 0.5);
    const ConvexDistance d = distance(ConvexSolid{a}, ConvexSolid{b});
    const auto reference = hull_distance(a, b);
    // Of four points, all in three: a hull of more than three that holds the other's point has its distance in none.
    if (d.cores_intersect) continue;
    ASSERT_NEAR(d.distance, reference.distance, 10 * kLength);
    const Vec3 n = (reference.a - reference.b) / reference.distance;
    if (reference.distance > 1e-6) {
      ASSERT_LE((d.normal - n).norm(), 1e-12 / reference.distance);
    }
    ASSERT_LE(hull_distance({&d.a, 1}, a).distance, 1e-13);
    ASSERT_LE(hull_distance({&d.b, 1}, b).distance, 1e-13);
  }
}

TEST(ConvexDistance, HullsWithACommonPointIntersect) {
  Random random(7);
  for (int trial = 0; trial < 5000; ++trial) {
    auto a = cloud(random, 8, Vec3::Zero(), 0.5), b = cloud(random, 8, Vec3::Zero(), 0.5);
    Vec3 middle_a = Vec3::Zero(), middle_b = Vec3::Zero();
    for (const Vec3& p : a) middle_a += p / 8.0;
    for (const Vec3& p : b) middle_b += p / 8.0;
    for (Vec3& p : b) p += middle_a - middle_b;
    const ConvexDistance d = distance(ConvexSolid{a, 0.1}, ConvexSolid{b, 0.2});
    ASSERT_TRUE(d.cores_intersect);
    EXPECT_EQ(d.distance, -(0.1 + 0.2));
  }
}

/// On the way four corners of one face of the box are the simplex: in one plane but for round-off, which gave their
/// tetrahedron an inside with the origin in it.
TEST(ConvexDistance, AFlatTetrahedronHasNoInside) {
  const std::vector<Vec3> box{{0.098865446443361038, -0.81336979128697529, 0.17942671673501664},
                              {0.017056309148154147, -0.44066725115962552, -0.039142900442054762},
                              {-0.03761076331995411, -1.238069353230453, -0.49368424189406679},
                              {-0.11941990061516097, -0.86536681310310315, -0.71225385907113825},
                              {-0.14396216058319297, -0.83120022236332924, 0.23991119879305639},
                              {-0.22577129787839983, -0.45849768223597942, 0.021341581615984984},
                              {-0.28043837034650809, -1.2558997843068069, -0.43319975983602704},
                              {-0.36224750764171498, -0.88319724417945711, -0.65176937701309845}};
  const std::vector<Vec3> triangle{{-0.28172136089416233, -0.50673229852878154, 0.084146892867336232},
                                   {-0.11330441320340323, -0.34375870596193081, -0.020833205848556968},
                                   {-0.095371148615059631, -0.53738404410726559, 0.069747264621189409}};
  const ConvexDistance d = distance(ConvexSolid{box}, ConvexSolid{triangle});
  EXPECT_FALSE(d.cores_intersect);
  EXPECT_NEAR(proven_distance(box, triangle, d.normal), d.distance, kLength);
  EXPECT_GT(d.distance, 0.01);
}

TEST(ConvexDistance, BoxesCornerToCornerEdgeToEdgeAndFaceToFaceHaveTheirClosedForms) {
  const auto box = [](const Vec3& center) {
    std::vector<Vec3> p;
    for (int i = 0; i < 8; ++i) p.push_back(center + 0.5 * Vec3(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
    return p;
  };
  for (const Vec3& at : {Vec3(2, 0, 0), Vec3(2, 2, 0), Vec3(2, 3, 4), Vec3(0, 1.25, 0.3), Vec3(1 + 1e-9, 0.2, 0.1)}) {
    const auto a = box(Vec3::Zero()), b = box(at);
    const ConvexDistance d = distance(ConvexSolid{b}, ConvexSolid{a});
    const Vec3 gap = (at.cwiseAbs() - Vec3::Ones()).cwiseMax(0.0);
    EXPECT_NEAR(d.distance, gap.norm(), kLength);
    EXPECT_LE((d.normal - gap / gap.norm()).norm(), 1e-12 / gap.norm() * 1e-3 + kLength);
  }
}

}  // namespace
}  // namespace limber
