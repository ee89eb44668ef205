#include "limber/collision/narrow_phase.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <set>

#include "block_model.h"
#include "coarse_bunny.h"
#include "contact_bodies.h"
#include "contact_reference.h"
#include "counted_new.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/core/error.h"
#include "random_states.h"
#include "sample_models.h"
#include "shapes.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::Body;
using testing::contacts_of;
using testing::expect_well_formed;
using testing::hull_distance;
using testing::index_of;
using testing::is_kind;
using testing::key_of;
using testing::PlainSurface;
using testing::point_a;
using testing::point_b;
using testing::Random;
using testing::winding_number;

// What is asked of gaps, in parts of a size of 1 m, and of normals where the gap is above 1e-6 of it.
constexpr double kGap = 1e-9;
double normal_error(double gap) { return 1e-9 / std::abs(gap); }

// Configurations per kind of pair; the CTest entries `collision.ten_thousand_pairs` and
// `collision.bunny_pairs` ask for more.
int trials(int usual) {
  const char* asked = std::getenv("LIMBER_TRIALS");
  return asked == nullptr ? usual : std::atoi(asked);
}

// -- Bodies -----------------------------------------------------------------------------------------------------------

std::shared_ptr<const ModalModel> lumpy_sphere(int splits, Index modes) {
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 0.5, splits);
  for (Vec3& p : mesh.vertices) p *= 1.0 + 0.15 * std::sin(7.0 * p.x()) * std::cos(5.0 * p.y() + 3.0 * p.z());
  return testing::wavy_model(mesh, modes);
}

/// A sheet of cells × cells squares, one layer of triangles, across z.
std::shared_ptr<const ModalModel> sheet(Index cells, Index modes) {
  SurfaceMesh mesh;
  for (Index j = 0; j <= cells; ++j)
    for (Index i = 0; i <= cells; ++i)
      mesh.vertices.emplace_back(static_cast<double>(i) / cells - 0.5, static_cast<double>(j) / cells - 0.5, 0.0);
  for (Index j = 0; j < cells; ++j)
    for (Index i = 0; i < cells; ++i) {
      const Index v = j * (cells + 1) + i, w = v + cells + 1;
      mesh.triangles.push_back({v, v + 1, w + 1});
      mesh.triangles.push_back({v, w + 1, w});
    }
  return testing::wavy_model(mesh, modes);
}

// -- Reference --------------------------------------------------------------------------------------------------------

struct Reference {
  Vec3 a, b;
  double distance;
  bool seen;  // no part of the vertex' own body is in between
};

struct Near {
  Vec3 point;
  double distance;
};

/// Local minima of the distance from p over a surface: feet that no triangle at the foot improves.
std::vector<Near> local_minima(const PlainSurface& s, const Vec3& p, double reach) {
  std::vector<Near> all, minima;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const auto x = s.corners(t);
    const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
    if ((p - x[0]).norm() > reach + radius + 1e-9) continue;
    const auto d = hull_distance({&p, 1}, x);
    all.push_back({d.b, d.distance});
  }
  for (const Near& n : all) {
    if (n.distance > reach) continue;
    bool least = true;
    for (std::size_t t = 0; t < s.triangles.size() && least; ++t) {
      const auto x = s.corners(t);
      const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
      if ((n.point - x[0]).norm() > radius + 1e-9 || hull_distance({&n.point, 1}, x).distance > 1e-10) continue;
      least = hull_distance({&p, 1}, x).distance > n.distance - 1e-12;
    }
    const bool known =
        std::any_of(minima.begin(), minima.end(), [&](const Near& m) { return (m.point - n.point).norm() < 1e-9; });
    if (least && !known) minima.push_back(n);
  }
  return minima;
}

// A little on the way from p to q.
bool leaves_outside(const PlainSurface& s, const Vec3& p, const Vec3& q) {
  return winding_number(s, p + 1e-6 * (q - p) / (q - p).norm()) < 0.5;
}

/// Vertices of `mine` against `other`; points are given back as (mine, other).
std::vector<Reference> vertex_reference(const PlainSurface& mine, const PlainSurface& other, double margin) {
  std::vector<Reference> all;
  for (const Vec3& v : mine.vertices)
    for (const Near& n : local_minima(other, v, margin))
      if (leaves_outside(other, n.point, v)) all.push_back({v, n.point, n.distance, leaves_outside(mine, v, n.point)});
  return all;
}

std::vector<std::array<Vec3, 2>> edges_of(const PlainSurface& s) {
  std::set<std::pair<Index, Index>> edges;
  for (const Triangle& t : s.triangles)
    for (std::size_t i = 0; i < 3; ++i) edges.insert(std::minmax(t[i], t[(i + 1) % 3]));
  std::vector<std::array<Vec3, 2>> all;
  for (const auto& [v, w] : edges)
    all.push_back({s.vertices[static_cast<std::size_t>(v)], s.vertices[static_cast<std::size_t>(w)]});
  return all;
}

/// Pairs of edges whose nearest points are inside both and that no neighbouring triangle improves from either side.
std::vector<Reference> edge_reference(const PlainSurface& a, const PlainSurface& b, double margin) {
  const auto is_minimum = [&](const PlainSurface& s, const Vec3& p, const Vec3& q, double d) {
    const auto minima = local_minima(s, p, d + 1e-12);
    return std::any_of(minima.begin(), minima.end(), [&](const Near& n) { return (n.point - q).norm() < 1e-9; });
  };
  const auto inside = [](const std::array<Vec3, 2>& e, const Vec3& p) {
    return (p - e[0]).norm() > 1e-9 && (p - e[1]).norm() > 1e-9;
  };
  std::vector<Reference> all;
  for (const auto& e : edges_of(a))
    for (const auto& f : edges_of(b)) {
      if ((0.5 * (e[0] + e[1]) - 0.5 * (f[0] + f[1])).norm() >
          margin + 0.5 * (e[1] - e[0]).norm() + 0.5 * (f[1] - f[0]).norm())
        continue;
      const auto d = hull_distance(e, f);
      if (d.distance > margin || !inside(e, d.a) || !inside(f, d.b)) continue;
      if (is_minimum(a, d.b, d.a, d.distance) && is_minimum(b, d.a, d.b, d.distance) && leaves_outside(a, d.a, d.b) &&
          leaves_outside(b, d.b, d.a))
        all.push_back({d.a, d.b, d.distance, true});
    }
  return all;
}

bool same_points(const ContactPoint& c, const Body& a, const Body& b, const Vec3& p, const Vec3& q) {
  return (point_a(c, a) - p).norm() < kGap && (point_b(c, b) - q).norm() < kGap;
}

/// The contact at the two points is there, with the gap and the normal.
void expect_found(const std::vector<ContactPoint>& contacts, const Body& a, const Body& b, const Vec3& p, const Vec3& q,
                  const std::string& what) {
  const auto c =
      std::find_if(contacts.begin(), contacts.end(), [&](const ContactPoint& x) { return same_points(x, a, b, p, q); });
  const double d = (p - q).norm();
  ASSERT_NE(c, contacts.end()) << what << " at distance " << d << " is missing";
  ASSERT_NEAR(c->gap, d, kGap);
  if (d > 1e-6) {
    ASSERT_LE((c->normal - (p - q) / d).norm(), normal_error(d));
  }
}

double nearest_distance(const PlainSurface& s, const Vec3& p) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    const auto x = s.corners(t);
    const double radius = std::max((x[1] - x[0]).norm(), (x[2] - x[0]).norm());
    if ((p - x[0]).norm() - radius > least) continue;
    least = std::min(least, hull_distance({&p, 1}, x).distance);
  }
  return least;
}

struct Tally {
  int apart = 0, overlapping = 0, vertex = 0, edge = 0, inside = 0;
};

/// Vertices inside the other surface: each has one contact of its depth, others none.
void expect_depths(const std::vector<ContactPoint>& contacts, const Body& a, const Body& b, int of, Tally& tally) {
  const PlainSurface &mine = (of == 0 ? a : b).plain(), &other = (of == 0 ? b : a).plain();
  for (std::size_t v = 0; v < mine.vertices.size(); ++v) {
    const bool inside = winding_number(other, mine.vertices[v]) > 0.5;
    int count = 0;
    for (const ContactPoint& c : contacts) {
      const std::uint32_t key = key_of(c, of);
      if (c.gap >= 0.0 || !is_kind(key, Feature::Kind::kVertex) || index_of(key) != static_cast<Index>(v)) continue;
      // The vertex may itself be where one of the other body's that is inside leaves, at that one's depth.
      const std::uint32_t other_key = key_of(c, 1 - of);
      const double depth = inside ? nearest_distance(other, mine.vertices[v]) : 0.0;
      if (is_kind(other_key, Feature::Kind::kVertex) && !(std::abs(c.gap + depth) <= kGap)) {
        const Vec3& w = other.vertices[static_cast<std::size_t>(index_of(other_key))];
        ASSERT_GT(winding_number(mine, w), 0.5);
        ASSERT_NEAR(c.gap, -nearest_distance(mine, w), kGap);
        continue;
      }
      ++count;
      ASSERT_NEAR(c.gap, -depth, kGap);
    }
    ASSERT_EQ(count, inside ? 1 : 0) << "vertex " << v << " of body " << of;
    tally.inside += count;
  }
}

void expect_all_contacts(Body& a, Body& b, double margin, Tally& tally) {
  const auto contacts = contacts_of(a, b, margin, {.overlap = OverlapMethod::kNearestPoint});
  expect_well_formed(contacts, a, b, margin);
  const auto of_a = vertex_reference(a.plain(), b.plain(), margin),
             of_b = vertex_reference(b.plain(), a.plain(), margin);
  const auto of_edges = edge_reference(a.plain(), b.plain(), margin);
  for (const Reference& r : of_a)
    if (r.seen) expect_found(contacts, a, b, r.a, r.b, "a vertex of a");
  for (const Reference& r : of_b)
    if (r.seen) expect_found(contacts, a, b, r.b, r.a, "a vertex of b");
  for (const Reference& r : of_edges) expect_found(contacts, a, b, r.a, r.b, "an edge pair");

  bool overlap = false;
  for (const ContactPoint& c : contacts) {
    const bool edges = is_kind(key_of(c, 0), Feature::Kind::kEdge) && is_kind(key_of(c, 1), Feature::Kind::kEdge);
    overlap = overlap || c.gap < -kGap;
    ++(edges ? tally.edge : tally.vertex);
    if (edges || c.gap < kGap) continue;
    const auto is_it = [&](const Reference& r) { return same_points(c, a, b, r.a, r.b); };
    const auto is_turned = [&](const Reference& r) { return same_points(c, a, b, r.b, r.a); };
    ASSERT_TRUE(std::any_of(of_a.begin(), of_a.end(), is_it) || std::any_of(of_b.begin(), of_b.end(), is_turned))
        << "no local minimum, gap " << c.gap;
  }
  ++(overlap ? tally.overlapping : tally.apart);
  expect_depths(contacts, a, b, 0, tally);
  expect_depths(contacts, a, b, 1, tally);
}

// -- Against the reference --------------------------------------------------------------------------------------------

TEST(NarrowPhase, TwoLumpySpheresHaveTheContactsOfAllFeaturePairs) {
  Random random(21);
  Tally tally;
  Body a(lumpy_sphere(1, 5)), b(lumpy_sphere(2, 3));
  for (int trial = 0; trial < trials(300); ++trial) {
    const RigidTransform X_WA = random.pose(1.0);
    const Vec3 away = random.vector(1.0).normalized();
    a.place(X_WA, random.amplitudes(5, 0.05));
    b.place({random.pose(1.0).q, X_WA.p + random.uniform(0.7, 1.2) * away}, random.amplitudes(3, 0.05));
    expect_all_contacts(a, b, 0.08, tally);
    if (HasFatalFailure()) FAIL() << "trial " << trial;
  }
  EXPECT_GT(tally.apart, 50);
  EXPECT_GT(tally.overlapping, 50);
  EXPECT_GT(tally.edge, 40);
  EXPECT_GT(tally.inside, 100);
}

TEST(NarrowPhase, LumpySphereAndBoxHaveTheContactsOfAllFeaturePairs) {
  Random random(22);
  Tally tally;
  const Vec3 half(0.5, 0.3, 0.4);
  Body a(lumpy_sphere(2, 5)), b(Shape{Box{half}});
  for (int trial = 0; trial < trials(300); ++trial) {
    a.place(random.pose(1.0), random.amplitudes(5, 0.05));
    const Vec3 away = random.vector(1.0).normalized();
    b.place_box({random.pose(1.0).q, a.pose.p + random.uniform(0.6, 1.2) * away}, half);
    expect_all_contacts(a, b, 0.08, tally);
    if (HasFatalFailure()) FAIL() << "trial " << trial;
  }
  EXPECT_GT(tally.apart, 50);
  EXPECT_GT(tally.overlapping, 50);
  EXPECT_GT(tally.edge, 50);
  EXPECT_GT(tally.inside, 100);
}

/// The bunny on 240 triangles, or null where the file is not there.
std::shared_ptr<const ModalModel> bunny_model(Index modes) {
  static const std::optional<SurfaceMesh> bunny = testing::coarse_bunny(240);
  return bunny ? testing::wavy_model(*bunny, modes) : nullptr;
}

TEST(Bunny, TwoBunniesHaveTheContactsOfAllFeaturePairs) {
  const auto model = bunny_model(5);
  if (model == nullptr) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  Random random(61);
  Tally tally;
  Body a(model), b(model);
  ASSERT_TRUE(a.surface().closed());
  for (int trial = 0; trial < trials(30); ++trial) {
    a.place(random.pose(1.0), random.amplitudes(5, 0.02));
    const Vec3 away = random.vector(1.0).normalized();
    b.place({random.pose(1.0).q, a.pose.p + random.uniform(0.5, 1.0) * away}, random.amplitudes(5, 0.02));
    expect_all_contacts(a, b, 0.04, tally);
    if (HasFatalFailure()) FAIL() << "trial " << trial;
  }
  EXPECT_GT(tally.apart, 5);
  EXPECT_GT(tally.overlapping, 5);
  EXPECT_GT(tally.edge, 0);
  EXPECT_GT(tally.inside, 20);
}

TEST(Bunny, BunnyAndBoxHaveTheContactsOfAllFeaturePairs) {
  const auto model = bunny_model(5);
  if (model == nullptr) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  Random random(62);
  Tally tally;
  const Vec3 half(0.5, 0.3, 0.4);
  Body a(model), b(Shape{Box{half}});
  for (int trial = 0; trial < trials(30); ++trial) {
    a.place(random.pose(1.0), random.amplitudes(5, 0.02));
    const Vec3 away = random.vector(1.0).normalized();
    b.place_box({random.pose(1.0).q, a.pose.p + random.uniform(0.5, 1.1) * away}, half);
    expect_all_contacts(a, b, 0.04, tally);
    if (HasFatalFailure()) FAIL() << "trial " << trial;
  }
  EXPECT_GT(tally.apart, 5);
  EXPECT_GT(tally.overlapping, 5);
  EXPECT_GT(tally.edge, 0);
  EXPECT_GT(tally.inside, 20);
}

TEST(NarrowPhase, BarOnAPlaneHasEveryVertexWithinTheMargin) {
  Random random(23);
  Body bar(testing::block_model(6));
  for (int trial = 0; trial < trials(500); ++trial) {
    const Vec3 n = random.vector(1.0).normalized();
    Body plane(Shape{HalfSpace{n, random.uniform(-1.0, 1.0)}});
    plane.place(random.pose(2.0));
    bar.place(random.pose(1.5), random.amplitudes(6, 0.1));
    const double margin = 0.2;
    const auto contacts = contacts_of(bar, plane, margin);
    expect_well_formed(contacts, bar, plane, margin);
    const Vec3 up = plane.pose.q * n;
    const Vec3 on_plane = plane.pose * (std::get<HalfSpace>(plane.body(1).geometry->shape()).offset * n);
    std::size_t below = 0;
    for (std::size_t v = 0; v < bar.plain().vertices.size(); ++v) {
      const double height = up.dot(bar.plain().vertices[v] - on_plane);
      if (std::abs(height - margin) < kGap) continue;
      const auto c = std::find_if(contacts.begin(), contacts.end(), [&](const ContactPoint& x) {
        return index_of(key_of(x, 0)) == static_cast<Index>(v);
      });
      ASSERT_EQ(c != contacts.end(), height <= margin);
      if (c == contacts.end()) continue;
      ++below;
      ASSERT_NEAR(c->gap, height, kGap);
      ASSERT_LE((c->normal - up).norm(), kGap);
    }
    ASSERT_EQ(below, contacts.size());
    // The other way round, the same contacts turned.
    NarrowPhase narrow;
    std::vector<ContactPoint> turned;
    narrow.find_contacts(plane.body(0), bar.body(1), margin, Vec3::Zero(), turned);
    ASSERT_EQ(turned.size(), contacts.size());
    for (const ContactPoint& c : turned) ASSERT_LE((c.normal + up).norm(), kGap);
  }
}

TEST(NarrowPhase, SheetAndBallHaveEveryVertexAndTheNearestPointsOfFacesAndEdges) {
  Random random(24);
  Body cloth(sheet(6, 4));
  int vertices = 0, others = 0, inside = 0;
  for (int trial = 0; trial < trials(500); ++trial) {
    const double radius = random.uniform(0.05, 0.3), margin = 0.05;
    Body ball(Shape{Sphere{radius}});
    cloth.place(random.pose(1.0), random.amplitudes(4, 0.1));
    ball.place({random.pose(1.0).q,
                cloth.pose * Vec3(random.uniform(-0.6, 0.6), random.uniform(-0.6, 0.6), random.uniform(-0.4, 0.4))});
    const Vec3 center = ball.pose.p;
    const auto contacts = contacts_of(cloth, ball, margin);
    expect_well_formed(contacts, cloth, ball, margin);
    std::vector<Vec3> expected;
    for (const Vec3& v : cloth.plain().vertices)
      if ((v - center).norm() <= radius + margin) expected.push_back(v);
    vertices += static_cast<int>(expected.size());
    for (const Near& n : local_minima(cloth.plain(), center, radius + margin)) {
      const bool known =
          std::any_of(expected.begin(), expected.end(), [&](const Vec3& p) { return (p - n.point).norm() < kGap; });
      if (!known) expected.push_back(n.point), ++others;
    }
    ASSERT_EQ(contacts.size(), expected.size()) << "trial " << trial;
    for (const Vec3& p : expected) {
      const auto c = std::find_if(contacts.begin(), contacts.end(),
                                  [&](const ContactPoint& x) { return (point_a(x, cloth) - p).norm() < kGap; });
      ASSERT_NE(c, contacts.end());
      const double d = (p - center).norm();
      ASSERT_NEAR(c->gap, d - radius, kGap);
      ASSERT_LE((c->normal - (p - center) / d).norm(), 1e-9);
      inside += c->gap < 0.0 ? 1 : 0;
    }
  }
  EXPECT_GT(vertices, 500);
  EXPECT_GT(others, 100);
  EXPECT_GT(inside, 300);
}

TEST(NarrowPhase, CapsuleAgreesWithTheHullOfItsAxis) {
  Random random(25);
  Body lumpy(lumpy_sphere(2, 4));
  int apart = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Capsule shape{random.uniform(0.02, 0.2), random.uniform(0.0, 0.5)};
    Body capsule{Shape{shape}};
    lumpy.place(random.pose(1.0), random.amplitudes(4, 0.05));
    capsule.place({random.pose(1.0).q, lumpy.pose.p + random.uniform(0.5, 1.2) * random.vector(1.0).normalized()});
    const double margin = 0.1;
    const auto contacts = contacts_of(lumpy, capsule, margin);
    expect_well_formed(contacts, lumpy, capsule, margin);
    const std::array<Vec3, 2> axis{capsule.pose * Vec3(0, 0, -shape.half_length),
                                   capsule.pose * Vec3(0, 0, shape.half_length)};
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t t = 0; t < lumpy.plain().triangles.size(); ++t)
      least = std::min(least, hull_distance(lumpy.plain().corners(t), axis).distance);
    if (least < 1e-9 || winding_number(lumpy.plain(), axis[0]) > 0.5) continue;
    if (least - shape.radius > margin) {
      EXPECT_TRUE(contacts.empty());
      continue;
    }
    ++apart;
    ASSERT_FALSE(contacts.empty()) << "trial " << trial;
    double found = margin;
    for (const ContactPoint& c : contacts) found = std::min(found, c.gap);
    ASSERT_NEAR(found, least - shape.radius, kGap) << "trial " << trial;
  }
  EXPECT_GT(apart, 50);
}

// -- Overlap ----------------------------------------------------------------------------------------------------------

TEST(NarrowPhase, ABodyWithinAnotherIsFoundThoughNoTrianglesMeet) {
  Body outer(testing::wavy_model(shapes::sphere(Vec3::Zero(), 1.0, 2), 0));
  Body inner(testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.2, 1), 0));
  outer.place({}), inner.place({.p = {0.3, 0.1, 0.0}});
  const auto contacts = contacts_of(outer, inner, 0.01);
  EXPECT_EQ(contacts.size(), inner.plain().vertices.size());
  for (const ContactPoint& c : contacts) EXPECT_NEAR(c.gap, -nearest_distance(outer.plain(), point_b(c, inner)), kGap);
  // So is a rigid ball, and a body within a box.
  Body ball(Shape{Sphere{0.1}}), box(Shape{Box{Vec3::Ones()}});
  ball.place({}), box.place({});
  EXPECT_EQ(contacts_of(outer, ball, 0.01).size(), 1u);
  EXPECT_EQ(contacts_of(inner, box, 0.01).size(), inner.plain().vertices.size());
}

TEST(NarrowPhase, EdgesThatCrossWithoutAVertexInsideMakeAnEdgeContact) {
  // Two bars, each with an edge foremost, crossed at a right angle and 0.01 into each other.
  const auto roof = [] { return testing::wavy_model(shapes::box(Vec3(-1, -0.1, -0.1), Vec3(1, 0.1, 0.1)), 0); };
  Body lower(roof()), upper(roof());
  const Quaternion on_edge = quaternion_from_rotation_vector(Vec3(std::numbers::pi / 4.0, 0, 0));
  const Quaternion across = quaternion_from_rotation_vector(Vec3(0, 0, std::numbers::pi / 2.0));
  const double height = 2.0 * 0.1 * std::numbers::sqrt2;
  for (const double gap : {0.01, 0.0, -0.01, -0.03}) {
    lower.place({on_edge, Vec3::Zero()});
    upper.place({across * on_edge, Vec3(0, 0, height + gap)});
    const auto contacts = contacts_of(upper, lower, 0.02);
    ASSERT_EQ(contacts.size(), 1u) << "gap " << gap;
    EXPECT_NEAR(contacts[0].gap, gap, 1e-7);  // the corners at ±0.1 are stored in single precision
    EXPECT_LE((contacts[0].normal - Vec3::UnitZ()).norm(), 1e-12);
    EXPECT_TRUE(is_kind(key_of(contacts[0], 0), Feature::Kind::kEdge));
  }
}

TEST(NarrowPhase, BarsLaidAcrossEachOtherTouchWhereverTheirRimsHaveCrossed) {
  // One bar along y, tilted, over one along x: of the four crossings of its lower rim with the upper rim of the other
  // those that overlap are contacts, each as deep as its own lines are, and none pushes the bars sideways.
  const double half = 0.1;
  const auto bar = [&](const Vec3& extent) { return testing::wavy_model(shapes::box(-extent, extent), 0); };
  Body lower(bar({1.0, half, half})), upper(bar({half, 1.0, half}));
  lower.place({});
  Random random(28);
  int found = 0, deep = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Vec3 tilt(random.uniform(-0.1, 0.1), random.uniform(-0.3, 0.3), random.uniform(-0.5, 0.5));
    upper.place({quaternion_from_rotation_vector(tilt), {0.0, 0.0, 2.0 * half + random.uniform(-0.01, 0.03)}});
    const auto contacts = contacts_of(upper, lower, 0.0);
    for (const ContactPoint& c : contacts) ASSERT_GT(c.normal.z(), 0.9) << "trial " << trial;
    for (const double x : {-half, half})
      for (const double y : {-half, half}) {
        const Vec3 u = upper.pose.q * Vec3::UnitY(), p = upper.pose * Vec3(x, 0.0, -half);
        const double height = p.z() + (y - p.y()) / u.y() * u.z() - half;  // of the upper line over the lower one
        if (height > -1e-3) continue;
        const Vec3 n = Vec3::UnitX().cross(u).normalized();
        const double gap = height * n.z();
        ++found, deep += gap < -0.02 ? 1 : 0;
        EXPECT_TRUE(std::any_of(contacts.begin(), contacts.end(),
                                [&](const ContactPoint& c) { return std::abs(c.gap - gap) < 1e-7; }))
            << "trial " << trial << ", gap " << gap;
      }
  }
  EXPECT_GT(found, 300);
  EXPECT_GT(deep, 50);
}

TEST(NarrowPhase, NormalsOfNeighbouringVerticesDoNotTurnAround) {
  // A soft block sinks ever deeper into a rigid box: what is inside is pushed up as long as the top is nearest.
  Body block(testing::block_model(0)), box(Shape{Box{Vec3(2.0, 2.0, 2.0)}});
  box.place({.p = {0, 0, -2.0}});
  for (double depth = -0.05; depth < 0.9; depth += 0.01) {
    block.place({.p = {0, 0, 0.5 - depth}});
    for (const ContactPoint& c : contacts_of(block, box, 0.1)) ASSERT_LE((c.normal - Vec3::UnitZ()).norm(), 1e-12);
  }
}

TEST(NarrowPhase, RestDepthOfAnUndeformedBoxIsItsSignedDistance) {
  const Vec3 half(0.3, 0.2, 0.1);
  const auto model = testing::sample_model({.half_extent = half});
  Body soft(model), probe(testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.02, 0), 0));
  soft.use_volume();
  // The sample's corners are about its centre of mass, not the middle, and in single precision.
  Vec3 low = Vec3::Constant(1e9), high = -low;
  for (const Vec3f& r : model->collision().rest)
    low = low.cwiseMin(r.cast<double>()), high = high.cwiseMax(r.cast<double>());
  const Vec3 middle = 0.5 * (low + high);
  Random random(26);
  int inside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const RigidTransform X_WB = random.pose(1.0);
    soft.place(X_WB, {0.0, 0.0, 0.0, 0.0});
    probe.place({random.pose(1.0).q, X_WB * (middle + random.vector(1.0).cwiseProduct(half))});
    for (const ContactPoint& c : contacts_of(soft, probe, 1e-6)) {
      if (!is_kind(key_of(c, 1), Feature::Kind::kVertex) || c.gap > -1e-3) continue;
      const Vec3 p_B = X_WB.inverse() * point_b(c, probe);
      const SignedDistance d = signed_distance(p_B - middle, Box{0.5 * (high - low)});
      if (d.distance > -1e-3) continue;  // a corner of the soft box in the probe
      ++inside;
      ASSERT_NEAR(c.gap, d.distance, 1e-7);
      ASSERT_NEAR(c.normal.norm(), 1.0, 1e-13);
    }
  }
  EXPECT_GT(inside, 300);
}

TEST(NarrowPhase, RestDepthFollowsTheDeformation) {
  // What is pushed out of a bent body leaves where the rest shape says, along the carried normal.
  Body soft(testing::sample_model()), probe(testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.02, 0), 0));
  soft.use_volume();
  Random random(27);
  int inside = 0;
  for (int trial = 0; trial < 500; ++trial) {
    soft.place(random.pose(1.0), random.amplitudes(4, 0.02));
    probe.place({random.pose(1.0).q, soft.pose * random.vector(0.15)});
    const auto contacts = contacts_of(soft, probe, 1e-6);
    expect_well_formed(contacts, soft, probe, 1e-6);
    for (const ContactPoint& c : contacts) inside += c.gap < -1e-3 ? 1 : 0;
  }
  EXPECT_GT(inside, 300);
}

// -- Rigid pairs ------------------------------------------------------------------------------------------------------

Body rigid(const Shape& shape, const RigidTransform& pose) {
  Body body(shape);
  body.place(pose);
  return body;
}

TEST(RigidPairs, BoxesRestOnFourPointsAndTurnedOnesOnEight) {
  const Box unit{Vec3::Constant(0.5)};
  const Quaternion turned = quaternion_from_rotation_vector(Vec3(0, 0, std::numbers::pi / 4.0));
  for (const double gap : {1e-3, -1e-3}) {
    Body lower = rigid(unit, {}), upper = rigid(unit, {.p = {0, 0, 1.0 + gap}}),
         across = rigid(unit, {turned, {0, 0, 1.0 + gap}});
    Body plane = rigid(HalfSpace{Vec3::UnitZ(), 0.5}, {});
    const auto straight = contacts_of(upper, lower, 0.01), octagon = contacts_of(across, lower, 0.01);
    const auto on_plane = contacts_of(upper, plane, 0.01);
    EXPECT_EQ(straight.size(), 4u);
    EXPECT_EQ(on_plane.size(), 4u);
    EXPECT_EQ(octagon.size(), 8u);
    for (const auto* contacts : {&straight, &octagon, &on_plane})
      for (const ContactPoint& c : *contacts) {
        EXPECT_NEAR(c.gap, gap, 1e-14);
        EXPECT_LE((c.normal - Vec3::UnitZ()).norm(), 1e-14);
      }
    // The corners of the octagon are √2 − 1 by half apart from the middles of the sides.
    for (const ContactPoint& c : octagon)
      EXPECT_NEAR(c.position.cwiseAbs().minCoeff(), 0.5 * (std::numbers::sqrt2 - 1.0), 1e-12);
  }
}

std::vector<Vec3> corners_of(const Body& box, const Vec3& half) {
  std::vector<Vec3> p;
  for (const Vec3& v : shapes::box(-half, half).vertices) p.push_back(box.pose * v);
  return p;
}

TEST(RigidPairs, BoxesApartHaveTheirDistanceAndThoseThatOverlapTheLeastWayOut) {
  Random random(31);
  const Vec3 half_a(0.3, 0.4, 0.5), half_b(0.2, 0.5, 0.35);
  int apart = 0, overlapping = 0;
  for (int trial = 0; trial < 400; ++trial) {
    Body a = rigid(Box{half_a}, random.pose(0.7)), b = rigid(Box{half_b}, random.pose(0.7));
    const auto contacts = contacts_of(a, b, 0.3);
    expect_well_formed(contacts, a, b, 0.3);
    const auto p = corners_of(a, half_a), q = corners_of(b, half_b);
    const ConvexDistance d = distance(ConvexSolid{p}, ConvexSolid{q});
    double least = 0.3;
    Vec3 normal = Vec3::Zero();
    for (const ContactPoint& c : contacts)
      if (c.gap < least) least = c.gap, normal = c.normal;
    if (!d.cores_intersect) {
      ASSERT_NEAR(least, std::min(d.distance, 0.3), 1e-12);
      ++apart;
      continue;
    }
    ++overlapping;
    ASSERT_LT(least, 0.0);
    const auto overlap_along = [&](const Vec3& n) {
      double low = 1e9, high = -1e9;
      for (const Vec3& x : p) low = std::min(low, n.dot(x));
      for (const Vec3& x : q) high = std::max(high, n.dot(x));
      return high - low;
    };
    // The fifteen axes of two boxes (Gottschalk, Lin, Manocha 1996), then any: none asks for less than the contact
    // says, and along its own normal the boxes overlap by as much at least.
    const Mat3 R = to_matrix(a.pose.q), S = to_matrix(b.pose.q);
    double way_out = 1e9;
    const auto try_axis = [&](const Vec3& n) {
      if (n.norm() > 1e-6) way_out = std::min({way_out, overlap_along(n.normalized()), overlap_along(-n.normalized())});
    };
    for (int i = 0; i < 3; ++i) {
      try_axis(R.col(i)), try_axis(S.col(i));
      for (int k = 0; k < 3; ++k) try_axis(R.col(i).cross(S.col(k)));
    }
    for (int i = 0; i < 100; ++i) ASSERT_GE(overlap_along(random.vector(1.0).normalized()), way_out - 1e-12);
    ASSERT_GE(-least, way_out - 1e-12);
    ASSERT_LE(-least, overlap_along(normal) + 1e-12);
  }
  EXPECT_GT(apart, 50);
  EXPECT_GT(overlapping, 50);
}

TEST(RigidPairs, BallsAndCapsulesHaveTheirClosedForms) {
  Body ball = rigid(Sphere{0.3}, {.p = {0, 0, 1}}), other = rigid(Sphere{0.5}, {.p = {0, 0, 0.1}});
  auto c = contacts_of(ball, other, 0.2);
  ASSERT_EQ(c.size(), 1u);
  EXPECT_NEAR(c[0].gap, 0.1, 1e-14);
  EXPECT_LE((c[0].normal - Vec3::UnitZ()).norm(), 1e-14);

  const Quaternion lying = quaternion_from_rotation_vector(Vec3(0, std::numbers::pi / 2.0, 0));
  Body rod = rigid(Capsule{0.1, 0.4}, {lying, {0, 0, 0.59}}), box = rigid(Box{Vec3::Constant(0.5)}, {});
  c = contacts_of(rod, box, 0.01);
  ASSERT_EQ(c.size(), 2u);
  for (const ContactPoint& x : c) {
    EXPECT_NEAR(x.gap, -0.01, 1e-14);
    EXPECT_NEAR(std::abs(x.position.x()), 0.4, 1e-14);
  }
  Body beside = rigid(Capsule{0.1, 0.4}, {lying, {0.2, 0.25, 0.59}});
  c = contacts_of(rod, beside, 0.1);
  ASSERT_EQ(c.size(), 2u);
  for (const ContactPoint& x : c) EXPECT_NEAR(x.gap, 0.05, 1e-14);
  Body sunk = rigid(Sphere{0.1}, {.p = {0.1, 0.45, 0.0}});
  c = contacts_of(sunk, box, 0.1);
  ASSERT_EQ(c.size(), 1u);
  EXPECT_NEAR(c[0].gap, -0.15, 1e-14);
  EXPECT_LE((c[0].normal - Vec3::UnitY()).norm(), 1e-14);
}

TEST(RigidPairs, HullOfABoxTouchesLikeTheBox) {
  Random random(32);
  const Vec3 half(0.3, 0.4, 0.5);
  std::vector<Vec3> points = shapes::box(-half, half).vertices;
  for (int i = 0; i < 20; ++i) points.push_back(random.vector(1.0).cwiseProduct(half));  // inside: not corners
  points.push_back({0.3, 0.1, 0.1});                                                     // on a face
  for (int trial = 0; trial < 100; ++trial) {
    const RigidTransform X = random.pose(0.6), Y = random.pose(0.6);
    Body box = rigid(Box{half}, X), hull = rigid(ConvexHull{points}, X), other = rigid(Box{half}, Y);
    const auto c = contacts_of(box, other, 0.1), d = contacts_of(hull, other, 0.1);
    ASSERT_EQ(c.size(), d.size());
    const auto least = [](const std::vector<ContactPoint>& all) {
      double r = 1.0;
      for (const ContactPoint& x : all) r = std::min(r, x.gap);
      return r;
    };
    ASSERT_NEAR(least(c), least(d), 1e-12);
  }
}

TEST(RigidPairs, BoxOnAMeshAndOnAHeightFieldRestsOnItsCorners) {
  const Body ground_mesh =
      rigid(TriangleMesh{{{-5, -5, 0}, {5, -5, 0}, {5, 5, 0}, {-5, 5, 0}}, {{0, 1, 2}, {0, 2, 3}}}, {});
  HeightField field{
      .columns = 11, .rows = 11, .spacing_x = 1.0, .spacing_y = 1.0, .heights = std::vector<float>(121, 0.0f)};
  const Body ground_field = rigid(field, {.p = {-5.3, -4.8, 0}});
  for (const Body* ground : {&ground_mesh, &ground_field})
    for (const double gap : {1e-3, -1e-3}) {
      Body box = rigid(Box{Vec3::Constant(0.5)}, {.p = {0.1, 0.2, 0.5 + gap}});
      int corners = 0;
      for (const ContactPoint& c : contacts_of(box, const_cast<Body&>(*ground), 0.01)) {
        EXPECT_LE((c.normal - Vec3::UnitZ()).norm(), 1e-12);
        EXPECT_NEAR(c.gap, gap, 1e-12);
        corners += is_kind(key_of(c, 0), Feature::Kind::kVertex) ? 1 : 0;
      }
      EXPECT_GE(corners, 4);
    }
}

// -- Trouble ----------------------------------------------------------------------------------------------------------

TEST(NarrowPhase, IdenticalBodiesInOnePlaceHaveFinitelyManyFiniteContacts) {
  Body a(lumpy_sphere(2, 3)), b(lumpy_sphere(2, 3));
  a.place({}, {0.1, 0.2, 0.0}), b.place({}, {0.1, 0.2, 0.0});
  const auto contacts = contacts_of(a, b, 0.01);
  expect_well_formed(contacts, a, b, 0.01);
  EXPECT_GE(contacts.size(), a.plain().vertices.size());
  EXPECT_LE(contacts.size(), 10 * a.plain().vertices.size());
}

TEST(NarrowPhase, FlatTrianglesDoubleVerticesAndInsideOutShapesGiveFiniteContacts) {
  Random random(41);
  SurfaceMesh mesh = shapes::sphere(Vec3::Zero(), 0.5, 1);
  shapes::append(shapes::sphere(Vec3(0.1, 0, 0), 0.5, 1), mesh);  // crosses the first
  const auto v = static_cast<Index>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {Vec3(0, 0, 0.6), Vec3(0, 0, 0.6), Vec3(0, 0, 0.7), Vec3(0, 0, 0.8)});
  mesh.triangles.insert(mesh.triangles.end(), {{v, v + 1, v + 2}, {v, v + 2, v + 3}, {0, v, v + 3}});
  Body a(testing::wavy_model(mesh, 5)), b(lumpy_sphere(1, 5)), box(Shape{Box{}}), ball(Shape{Sphere{}}),
      rod(Shape{Capsule{}});
  for (int trial = 0; trial < 300; ++trial) {
    const double size = std::pow(10.0, random.uniform(-3.0, 2.0));  // up to a hundred times the body: inside out
    a.place(random.pose(0.7), random.amplitudes(5, size)), b.place(random.pose(0.7), random.amplitudes(5, size));
    for (Body* other : {&b, &box, &ball, &rod}) {
      if (other != &b) other->place(random.pose(0.7));
      for (const ContactPoint& c : contacts_of(a, *other, 0.05)) {
        ASSERT_TRUE(std::isfinite(c.gap) && c.normal.allFinite() && c.position.allFinite());
        ASSERT_NEAR(c.normal.norm(), 1.0, 1e-12);
      }
    }
  }
}

TEST(NarrowPhase, FarFromTheOriginContactsAreTheSame) {
  Random random(42);
  Body a(lumpy_sphere(2, 4)), b(lumpy_sphere(2, 4));
  const Vec3 far(1048576.0, -2097152.0, 524288.0);  // sums with multiples of 2⁻³⁰ below are exact
  for (int trial = 0; trial < 50; ++trial) {
    const auto z = random.amplitudes(4, 0.05);
    const Quaternion q = random.pose(1.0).q, r = random.pose(1.0).q;
    Vec3 at = random.uniform(0.8, 1.0) * random.vector(1.0).normalized();
    for (int i = 0; i < 3; ++i) at[i] = std::ldexp(std::round(std::ldexp(at[i], 30)), -30);
    NarrowPhase narrow;
    std::vector<ContactPoint> here, there;
    a.place({q, Vec3::Zero()}, z), b.place({r, at}, z);
    narrow.find_contacts(a.body(0), b.body(1), 0.05, Vec3::Zero(), here);
    a.place({q, far}, z), b.place({r, far + at}, z);
    narrow.find_contacts(a.body(0), b.body(1), 0.05, far, there);
    ASSERT_EQ(here.size(), there.size());
    for (std::size_t i = 0; i < here.size(); ++i) {
      ASSERT_EQ(here[i].id, there[i].id);
      ASSERT_EQ(here[i].gap, there[i].gap);
      ASSERT_EQ(here[i].position, there[i].position);
    }
  }
}

/// Forces go on by the names of contacts: bricks that lie on each other must not change them as they rock by round-off.
TEST(NarrowPhase, BricksThatLieFlushKeepTheNamesOfTheirContacts) {
  Random random(44);
  NarrowPhase narrow;
  const Vec3 half(0.15, 0.12, 0.09);
  for (int pair = 0; pair < 20; ++pair) {
    const double turn = random.uniform(-3.0, 3.0), x = random.uniform(-0.1, 0.1), y = random.uniform(-0.1, 0.1);
    std::set<std::uint64_t> names;
    for (int rock = 0; rock < 50; ++rock) {
      const Quaternion tilt = quaternion_from_rotation_vector(1e-5 * random.vector(1.0));
      Body lower = rigid(Box{half}, {}),
           upper = rigid(Box{half}, {tilt * quaternion_from_rotation_vector({0.0, 0.0, turn}),
                                     {x, y, 2.0 * half.z() + random.uniform(-1e-6, 1e-6)}});
      std::vector<ContactPoint> contacts;
      narrow.find_contacts(lower.body(0), upper.body(1), 0.01, Vec3::Zero(), contacts);
      std::set<std::uint64_t> now;
      for (const ContactPoint& contact : contacts) now.insert(contact.id);
      if (rock == 0) names = now;
      if (now.size() < names.size())
        std::swap(now, names);  // the two nearest points may come in beside a face's corners
      EXPECT_GE(names.size(), 3u);
      EXPECT_TRUE(std::ranges::includes(now, names)) << pair << ' ' << rock;
    }
  }
}

TEST(NarrowPhase, WarmQueriesAllocateNothingAndRepeatTheSameBits) {
  Random random(43);
  Body a(lumpy_sphere(2, 4)), b(lumpy_sphere(2, 4)), box(Shape{Box{}}), ball(Shape{Sphere{}}),
      plane(Shape{HalfSpace{}});
  a.place({}, random.amplitudes(4, 0.05)), b.place({.p = {0.8, 0, 0}}, random.amplitudes(4, 0.05));
  box.place({.p = {0, 0.9, 0}}), ball.place({.p = {0, 0, 0.9}}), plane.place({});
  NarrowPhase narrow;
  std::vector<ContactPoint> first, second;
  const auto query = [&](std::vector<ContactPoint>& contacts) {
    contacts.clear();
    for (Body* other : {&b, &box, &ball, &plane})
      narrow.find_contacts(a.body(0), other->body(1), 0.05, Vec3::Zero(), contacts);
    narrow.find_contacts(ball.body(0), box.body(1), 0.5, Vec3::Zero(), contacts);
    narrow.find_contacts(box.body(0), plane.body(1), 0.5, Vec3::Zero(), contacts);
  };
  query(first), query(second);
  const long before = testing::allocations();
  query(second);
  EXPECT_EQ(testing::allocations(), before);
  ASSERT_EQ(first.size(), second.size());
  EXPECT_GT(first.size(), 20u);
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(first[i].id, second[i].id);
    EXPECT_EQ(first[i].gap, second[i].gap);
    EXPECT_EQ(first[i].normal, second[i].normal);
  }
}

TEST(NarrowPhase, ABodyTouchesItselfWhereItIsBentOntoItselfAndNotAtRest) {
  // Two sheets of one body, 0.2 apart, and one mode that moves the upper one down.
  SurfaceMesh mesh = shapes::box(Vec3(-0.5, -0.5, 0.0), Vec3(0.5, 0.5, 0.05));
  shapes::append(shapes::box(Vec3(-0.4, -0.4, 0.25), Vec3(0.4, 0.4, 0.3)), mesh);
  ModalModelData data = testing::wavy_data(mesh, 1);
  for (Index v = 0; v < data.render.vertices(); ++v) data.render.basis.set(v, 0, Vec3f(0, 0, v < 8 ? 0.0f : -1.0f));
  Body body(std::make_shared<const ModalModel>(std::move(data)));
  NarrowPhase narrow;
  std::vector<ContactPoint> contacts;
  body.place({}, {0.0});
  narrow.find_self_contacts(body.body(3), 0.05, Vec3::Zero(), contacts);
  EXPECT_TRUE(contacts.empty());
  body.place({}, {0.19});
  narrow.find_self_contacts(body.body(3), 0.05, Vec3::Zero(), contacts);
  ASSERT_GE(contacts.size(), 4u);
  for (const ContactPoint& c : contacts) {
    EXPECT_EQ(c.a.body, 3);
    EXPECT_EQ(c.b.body, 3);
    EXPECT_NEAR(c.gap, 0.01, 1e-7);
    EXPECT_LE(c.normal.cross(Vec3::UnitZ()).norm(), 1e-7);
    EXPECT_NEAR(c.gap, c.normal.dot(c.a.point_B - c.b.point_B), 1e-14);
  }
}

TEST(NarrowPhase, ABodyWithTwoGeometriesOrNoneIsRefused) {
  Body ball(Shape{Sphere{}});
  CollisionBody none;
  NarrowPhase narrow;
  std::vector<ContactPoint> contacts;
  EXPECT_THROW(narrow.find_contacts(ball.body(0), none, 0.1, Vec3::Zero(), contacts), InvalidArgument);
  EXPECT_THROW(RestVolume(testing::block_model(1)), InvalidArgument);
}

}  // namespace
}  // namespace limber
