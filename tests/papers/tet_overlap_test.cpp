// The normals of volumes that overlap, and depths along them.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <vector>

#include "contact_bodies.h"
#include "contact_reference.h"
#include "counted_new.h"
#include "limber/mesh/tet_mesh.h"
#include "limber/tet_overlap/tet_overlap_normals.h"
#include "random_states.h"
#include "solid_bodies.h"

namespace limber {
namespace {

using testing::Body;
using testing::body_of;
using testing::contacts_of;
using testing::expect_well_formed;
using testing::index_of;
using testing::is_kind;
using testing::key_of;
using testing::PlainSurface;
using testing::point_a;
using testing::Random;
using testing::solid;
using testing::solid_box;
using testing::tet_ball;
using testing::winding_number;

// Of lengths about 1 m computed in double from corners that are exact in single precision.
constexpr double kRoundOffLength = 1e-12;
// Normals are quotients of areas down to 1e-3 m² and of clipped corners.
constexpr double kRoundOffNormal = 1e-10;

const NarrowPhaseOptions kTets{.overlap = OverlapMethod::kNearestPoint, .normals = tet_overlap_normals};
const NarrowPhaseOptions kNearest{.overlap = OverlapMethod::kNearestPoint};

std::vector<ContactPoint> overlaps_of(Body& a, Body& b, const NarrowPhaseOptions& options = kTets) {
  std::vector<ContactPoint> contacts = contacts_of(a, b, 0.0, options);
  expect_well_formed(contacts, a, b, 0.0);
  std::erase_if(contacts, [](const ContactPoint& c) { return c.gap > -kRoundOffLength; });
  return contacts;
}

/// Contacts of a vertex inside, which are those that have the patch's normal.
bool of_vertex(const ContactPoint& c) {
  return is_kind(key_of(c, 0), Feature::Kind::kVertex) || is_kind(key_of(c, 1), Feature::Kind::kVertex);
}

TEST(TetOverlap, ASlabOfOverlapHasTheFacesNormalAndItsThicknessForDepth) {
  Random random(51);
  Body upper = body_of(solid_box({0.5, 0.5, 0.5}, {2, 2, 2})), lower = body_of(solid_box({1.0, 1.0, 0.5}, {8, 8, 2}));
  for (const double depth : {1e-4, 0.01, 0.125, 0.3}) {
    const RigidTransform X = random.pose(1.0);
    lower.place(X), upper.place(X * RigidTransform{.p = {0.13, 0.07, 1.0 - depth}});
    const auto contacts = overlaps_of(upper, lower);
    // Nine vertices of the upper body's face, and what the lower one has under it.
    ASSERT_GE(contacts.size(), 9u + 9u);
    for (const ContactPoint& c : contacts) {
      if (!of_vertex(c)) continue;
      EXPECT_NEAR(c.gap, -depth, kRoundOffLength);
      EXPECT_LE((c.normal - X.q * Vec3::UnitZ()).norm(), kRoundOffNormal);
    }
  }
}

TEST(TetOverlap, ACornerInAFaceHasTheFacesNormalAndEachVertexItsDepthBelowTheFace) {
  Random random(52);
  const Vec3 half(0.25, 0.25, 0.25);
  Body cube = body_of(solid_box(half, {4, 4, 4})), floor = body_of(solid_box({1.0, 1.0, 0.5}, {4, 4, 2}));
  int corners = 0;
  for (int trial = 0; trial < 40; ++trial) {
    const Quaternion q = random.pose(1.0).q;
    double lowest = 0.0;
    for (int i = 0; i < 8; ++i) {
      const Vec3 sign((i & 1) ? 1.0 : -1.0, (i & 2) ? 1.0 : -1.0, (i & 4) ? 1.0 : -1.0);
      lowest = std::min(lowest, (q * Vec3(half.cwiseProduct(sign))).z());
    }
    const double depth = random.uniform(0.01, 0.1);
    const RigidTransform X = random.pose(1.0);
    floor.place(X), cube.place(X * RigidTransform{q, {0.1, 0.2, 0.5 - lowest - depth}});
    double deepest = 0.0;
    for (const ContactPoint& c : overlaps_of(cube, floor)) {
      if (!of_vertex(c)) continue;
      ASSERT_LE((c.normal - X.q * Vec3::UnitZ()).norm(), kRoundOffNormal);
      deepest = std::min(deepest, c.gap);
      if (!is_kind(key_of(c, 0), Feature::Kind::kVertex)) continue;
      const Vec3 p = X.inverse() * point_a(c, cube);
      ASSERT_NEAR(c.gap, p.z() - 0.5, kRoundOffLength);
    }
    ASSERT_NEAR(deepest, -depth, kRoundOffLength);
    ++corners;
  }
  EXPECT_EQ(corners, 40);
}

TEST(TetOverlap, ADeepOverlapKeepsItsNormalWhereTheNearestPointTurnsAway) {
  Body post = body_of(solid_box({0.25, 0.25, 1.0}, {2, 2, 8})), block = body_of(solid_box({1.0, 1.0, 0.5}, {8, 8, 4}));
  block.place({});
  bool turned = false;
  for (double depth = 0.03; depth < 0.98; depth += 0.05) {
    post.place({.p = {0.03, 0.06, 1.5 - depth}});
    for (const ContactPoint& c : overlaps_of(post, block)) {
      if (!of_vertex(c)) continue;
      ASSERT_LE((c.normal - Vec3::UnitZ()).norm(), kRoundOffNormal) << "depth " << depth;
      if (is_kind(key_of(c, 0), Feature::Kind::kVertex)) {
        ASSERT_NEAR(c.gap, point_a(c, post).z() - 0.5, kRoundOffLength);
      }
    }
    for (const ContactPoint& c : overlaps_of(post, block, kNearest)) turned = turned || c.normal.z() < 0.0;
  }
  EXPECT_TRUE(turned);  // else the above shows nothing
}

/// ∫ n dA over the part of a triangle inside a surface, which it is split along; `unsure` is the area of the smallest
/// pieces, which the surface may cut.
Vec3 area_inside(const std::array<Vec3, 3>& x, const PlainSurface& other, int splits, double& unsure) {
  const Vec3 area = 0.5 * (x[1] - x[0]).cross(x[2] - x[0]), middle = (x[0] + x[1] + x[2]) / 3.0;
  const double reach = std::max({(x[0] - middle).norm(), (x[1] - middle).norm(), (x[2] - middle).norm()});
  double gap = std::numeric_limits<double>::infinity();
  for (std::size_t s = 0; s < other.triangles.size(); ++s)
    gap = std::min(gap, (closest_on_triangle(middle, other.corners(s)).point - middle).norm());
  if (gap > reach || splits == 0) {
    if (gap <= reach) unsure += area.norm();
    return winding_number(other, middle) > 0.5 ? area : Vec3(Vec3::Zero());
  }
  const std::array<Vec3, 3> m{0.5 * (x[0] + x[1]), 0.5 * (x[1] + x[2]), 0.5 * (x[2] + x[0])};
  return area_inside({x[0], m[0], m[2]}, other, splits - 1, unsure) +
         area_inside({x[1], m[1], m[0]}, other, splits - 1, unsure) +
         area_inside({x[2], m[2], m[1]}, other, splits - 1, unsure) + area_inside(m, other, splits - 1, unsure);
}

Vec3 area_inside(const PlainSurface& mine, const PlainSurface& other, double& unsure) {
  constexpr int kSplits = 6;
  Vec3 sum = Vec3::Zero();
  for (std::size_t t = 0; t < mine.triangles.size(); ++t) sum += area_inside(mine.corners(t), other, kSplits, unsure);
  return sum;
}

TEST(TetOverlap, TheNormalOfBentBodiesIsThatOfTheirBoundariesInsideEachOther) {
  Random random(53);
  Body a = body_of(solid_box({0.4, 0.3, 0.35}, {3, 3, 3}), 4), b = body_of(tet_ball(0.4, 2), 3);
  int compared = 0;
  for (int trial = 0; trial < 4; ++trial) {
    a.place(random.pose(1.0), random.amplitudes(4, 0.05));
    b.place({random.pose(1.0).q, a.pose.p + random.uniform(0.4, 0.55) * random.vector(1.0).normalized()},
            random.amplitudes(3, 0.05));
    const auto contacts = overlaps_of(a, b);
    if (std::none_of(contacts.begin(), contacts.end(), of_vertex)) continue;
    double unsure_a = 0.0, unsure_b = 0.0;
    const Vec3 of_a = -area_inside(a.plain(), b.plain(), unsure_a), of_b = area_inside(b.plain(), a.plain(), unsure_b);
    for (const ContactPoint& c : contacts) {
      if (!of_vertex(c)) continue;
      EXPECT_LE((c.normal - of_a.normalized()).norm(), 2.0 * unsure_a / of_a.norm());
      EXPECT_LE((c.normal - of_b.normalized()).norm(), 2.0 * unsure_b / of_b.norm());
      ++compared;
    }
    EXPECT_LT(unsure_a, 0.1 * of_a.norm());  // else the above shows nothing
  }
  EXPECT_GT(compared, 10);
}

TEST(TetOverlap, TurningBothBodiesTurnsTheContacts) {
  Random random(54);
  Body a = body_of(solid_box({0.4, 0.3, 0.35}, {3, 3, 3}), 4), b = body_of(tet_ball(0.4, 4), 3);
  std::size_t compared = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const RigidTransform X_WA = random.pose(1.0), X = random.pose(2.0);
    const RigidTransform X_WB{random.pose(1.0).q, X_WA.p + 0.55 * random.vector(1.0).normalized()};
    const auto za = random.amplitudes(4, 0.05), zb = random.amplitudes(3, 0.05);
    a.place(X_WA, za), b.place(X_WB, zb);
    const auto here = overlaps_of(a, b);
    a.place(X * X_WA, za), b.place(X * X_WB, zb);
    const auto turned = overlaps_of(a, b);
    ASSERT_EQ(here.size(), turned.size());
    for (std::size_t i = 0; i < here.size(); ++i) {
      ASSERT_EQ(here[i].id, turned[i].id);
      ASSERT_NEAR(here[i].gap, turned[i].gap, 1e3 * kRoundOffLength);
      ASSERT_LE((X.q * here[i].normal - turned[i].normal).norm(), 1e3 * kRoundOffNormal);
    }
    // And exchanging them reverses the normals.
    b.place(X_WB, zb), a.place(X_WA, za);
    const auto exchanged = overlaps_of(b, a);
    ASSERT_EQ(here.size(), exchanged.size());
    for (const ContactPoint& c : here) {
      const std::uint64_t id = c.id << 32 | c.id >> 32;
      const auto d =
          std::find_if(exchanged.begin(), exchanged.end(), [&](const ContactPoint& x) { return x.id == id; });
      ASSERT_NE(d, exchanged.end());
      ASSERT_LE((c.normal + d->normal).norm(), 1e3 * kRoundOffNormal);
    }
    compared += here.size();
  }
  EXPECT_GT(compared, 200u);
}

TEST(TetOverlap, ShallowOverlapOfBallsAgreesWithTheNearestPoint) {
  // Two balls of radius R that overlap by δ meet in a lens over which their normals turn by up to acos(1 − δ/2R) from
  // the line of centres; the facets of the polyhedra turn theirs by up to the angle that one spans besides.
  Random random(55);
  constexpr double kRadius = 0.5;
  Body a = body_of(tet_ball(kRadius, 16)), b = body_of(tet_ball(kRadius, 16));
  const double facet = 2.0 / 16.0 * std::numbers::sqrt2;
  int compared = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const double depth = random.uniform(0.01, 0.02) * kRadius;
    const Vec3 up = random.vector(1.0).normalized();
    b.place({random.pose(1.0).q, Vec3::Zero()});
    a.place({random.pose(1.0).q, (2.0 * kRadius - depth) * up});
    const double lens = std::acos(1.0 - depth / (2.0 * kRadius));
    const auto along = overlaps_of(a, b), nearest = overlaps_of(a, b, kNearest);
    for (const ContactPoint& c : along) {
      if (!of_vertex(c)) continue;
      EXPECT_LE((c.normal - up).norm(), facet);
      const bool of_a = is_kind(key_of(c, 0), Feature::Kind::kVertex);
      const auto n = std::find_if(nearest.begin(), nearest.end(), [&](const ContactPoint& x) {
        return of_a ? key_of(x, 0) == key_of(c, 0) : key_of(x, 1) == key_of(c, 1);
      });
      if (n == nearest.end()) continue;
      EXPECT_LE(c.gap, n->gap + kRoundOffLength);  // nothing is nearer than that
      EXPECT_LE(n->gap, c.gap * std::cos(lens + 2.0 * facet) + kRoundOffLength);
      ++compared;
    }
  }
  EXPECT_GT(compared, 20);
}

TEST(TetOverlap, APartBetweenTwoOthersHasANormalForEach) {
  // One body of two blocks, 0.4 apart, and a plate between them that goes 0.1 into both.
  TetMesh jaws = solid_box({0.5, 0.5, 0.5}, {4, 4, 4});
  const auto half = static_cast<Index>(jaws.nodes.size());
  const TetMesh block = jaws;
  for (Vec3& p : jaws.nodes) p.z() -= 0.75;
  for (const Vec3& p : block.nodes) jaws.nodes.push_back(p + Vec3(0, 0, 0.75));
  for (const Tet& t : block.tets) jaws.tets.push_back({t[0] + half, t[1] + half, t[2] + half, t[3] + half});
  Body b = body_of(jaws), plate = body_of(solid_box({0.25, 0.25, 0.375}, {3, 3, 1}));
  b.place({}), plate.place({.p = {0.03, 0.02, 0.0}});
  int up = 0, down = 0;
  for (const ContactPoint& c : overlaps_of(plate, b)) {
    if (!of_vertex(c)) continue;
    EXPECT_NEAR(c.gap, -0.125, kRoundOffLength);
    const double side = c.position.z() > 0.0 ? -1.0 : 1.0;
    EXPECT_LE((c.normal - side * Vec3::UnitZ()).norm(), kRoundOffNormal);
    ++(side > 0.0 ? up : down);
  }
  EXPECT_GE(up, 16);
  EXPECT_GE(down, 16);
}

void expect_same(const std::vector<ContactPoint>& contacts, const std::vector<ContactPoint>& others) {
  ASSERT_EQ(contacts.size(), others.size());
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    EXPECT_EQ(contacts[i].id, others[i].id);
    EXPECT_EQ(contacts[i].gap, others[i].gap);
    EXPECT_EQ(contacts[i].normal, others[i].normal);
  }
}

TEST(TetOverlap, WithoutAVolumeOrADirectionTheNearestPointServes) {
  const TetMesh box = solid_box({0.5, 0.5, 0.5}, {2, 2, 2});
  Body with = body_of(box), without(solid(box)), rigid(Shape{Box{Vec3::Constant(0.5)}});
  with.place({}), without.place({.p = {0.1, 0.2, 0.8}}), rigid.place({.p = {0.1, 0.2, 0.8}});
  for (Body* other : {&without, &rigid}) {
    const auto contacts = overlaps_of(with, *other);
    EXPECT_FALSE(contacts.empty());
    expect_same(contacts, overlaps_of(with, *other, kNearest));
  }
  // A body inside another: all of its boundary is inside, and its area vectors cancel.
  Body inner = body_of(solid_box({0.125, 0.125, 0.125}, {1, 1, 1}));
  inner.place({.p = {0.2, 0.1, 0.05}});
  const auto contacts = overlaps_of(with, inner);
  EXPECT_EQ(contacts.size(), 8u);
  expect_same(contacts, overlaps_of(with, inner, kNearest));
}

TEST(TetOverlap, FlatAndInsideOutTetrahedraGiveFiniteContacts) {
  Random random(56);
  Body a = body_of(solid_box({0.4, 0.3, 0.35}, {2, 2, 2}), 4), b = body_of(tet_ball(0.4, 2), 4);
  std::size_t contacts = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const double size = std::pow(10.0, random.uniform(-2.0, 2.0));  // up to hundreds of times the bodies
    a.place(random.pose(0.3), random.amplitudes(4, size)), b.place(random.pose(0.3), random.amplitudes(4, size));
    for (const ContactPoint& c : contacts_of(a, b, 0.01, kTets)) {
      ASSERT_TRUE(std::isfinite(c.gap) && c.normal.allFinite() && c.position.allFinite());
      ASSERT_NEAR(c.normal.norm(), 1.0, 1e-12);
      ++contacts;
    }
  }
  EXPECT_GT(contacts, 200u);
  // Identical bodies in one place: every boundary lies in the other's.
  a.place({}, {0.0, 0.0, 0.0, 0.0});
  Body twin = body_of(solid_box({0.4, 0.3, 0.35}, {2, 2, 2}), 4);
  twin.place({}, {0.0, 0.0, 0.0, 0.0});
  for (const ContactPoint& c : contacts_of(a, twin, 0.01, kTets)) ASSERT_TRUE(std::isfinite(c.gap));
}

TEST(TetOverlap, WarmQueriesAllocateNothingAndRepeatTheSameBits) {
  Random random(57);
  Body a = body_of(solid_box({0.4, 0.3, 0.35}, {4, 4, 4}), 4), b = body_of(tet_ball(0.4, 4), 4);
  a.place({}, random.amplitudes(4, 0.05)), b.place({.p = {0.5, 0.1, 0.0}}, random.amplitudes(4, 0.05));
  NarrowPhase narrow(kTets);
  std::vector<ContactPoint> first, second;
  narrow.find_contacts(a.body(0), b.body(1), 0.0, Vec3::Zero(), first);
  narrow.find_contacts(a.body(0), b.body(1), 0.0, Vec3::Zero(), second);
  second.clear();
  const long before = testing::allocations();
  narrow.find_contacts(a.body(0), b.body(1), 0.0, Vec3::Zero(), second);
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_GT(first.size(), 5u);
  expect_same(first, second);
}

}  // namespace
}  // namespace limber
