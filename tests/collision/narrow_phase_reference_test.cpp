// The narrow phase against all pairs of features, in long double where it matters.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <string>
#include <vector>

#include "block_model.h"
#include "coarse_bunny.h"
#include "contact_bodies.h"
#include "contact_reference.h"
#include "limber/collision/closest_features.h"
#include "narrow_phase_bodies.h"
#include "random_states.h"
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
using testing::kGap;
using testing::lumpy_sphere;
using testing::nearest_distance;
using testing::PlainSurface;
using testing::point_a;
using testing::point_b;
using testing::Random;
using testing::sheet;
using testing::winding_number;

// And of normals where the gap is above 1e-6 of it.
double normal_error(double gap) { return 1e-9 / std::abs(gap); }

// Configurations per kind of pair; the CTest entries `collision.ten_thousand_pairs` and
// `collision.bunny_pairs` ask for more.
int trials(int usual) {
  const char* asked = std::getenv("LIMBER_TRIALS");
  return asked == nullptr ? usual : std::atoi(asked);
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

/// Pairs that `place_pair(random, a, b)` puts somewhere near each other have all contacts of the reference.
template <class PlacePair>
Tally expect_all_contacts_of_pairs(Body& a, Body& b, double margin, unsigned seed, int count,
                                   const PlacePair& place_pair) {
  Random random(seed);
  Tally tally;
  for (int trial = 0; trial < count && !::testing::Test::HasFatalFailure(); ++trial) {
    SCOPED_TRACE("trial " + std::to_string(trial));
    place_pair(random, a, b);
    expect_all_contacts(a, b, margin, tally);
  }
  return tally;
}

/// Each kind of contact has been seen in more than so many pairs, or so many times.
void expect_more_than(const Tally& least, const Tally& seen) {
  EXPECT_GT(seen.apart, least.apart);
  EXPECT_GT(seen.overlapping, least.overlapping);
  EXPECT_GT(seen.edge, least.edge);
  EXPECT_GT(seen.inside, least.inside);
}

const Vec3 kHalfBox(0.5, 0.3, 0.4);

TEST(NarrowPhase, TwoLumpySpheresHaveTheContactsOfAllFeaturePairs) {
  Body a(lumpy_sphere(1, 5)), b(lumpy_sphere(2, 3));
  const auto place_pair = [](Random& random, Body& first, Body& second) {
    const RigidTransform X_WA = random.pose(1.0);
    const Vec3 away = random.vector(1.0).normalized();
    first.place(X_WA, random.amplitudes(5, 0.05));
    second.place({random.pose(1.0).q, X_WA.p + random.uniform(0.7, 1.2) * away}, random.amplitudes(3, 0.05));
  };
  expect_more_than({.apart = 50, .overlapping = 50, .edge = 40, .inside = 100},
                   expect_all_contacts_of_pairs(a, b, 0.08, 21, trials(300), place_pair));
}

TEST(NarrowPhase, LumpySphereAndBoxHaveTheContactsOfAllFeaturePairs) {
  Body a(lumpy_sphere(2, 5)), b(Shape{Box{kHalfBox}});
  const auto place_pair = [](Random& random, Body& lumpy, Body& box) {
    lumpy.place(random.pose(1.0), random.amplitudes(5, 0.05));
    const Vec3 away = random.vector(1.0).normalized();
    box.place_box({random.pose(1.0).q, lumpy.pose.p + random.uniform(0.6, 1.2) * away}, kHalfBox);
  };
  expect_more_than({.apart = 50, .overlapping = 50, .edge = 50, .inside = 100},
                   expect_all_contacts_of_pairs(a, b, 0.08, 22, trials(300), place_pair));
}

/// The bunny on 240 triangles, or null where the file is not there.
std::shared_ptr<const ModalModel> bunny_model(Index modes) {
  static const std::optional<SurfaceMesh> bunny = testing::coarse_bunny(240);
  return bunny ? testing::wavy_model(*bunny, modes) : nullptr;
}

TEST(Bunny, TwoBunniesHaveTheContactsOfAllFeaturePairs) {
  const auto model = bunny_model(5);
  if (model == nullptr) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  Body a(model), b(model);
  ASSERT_TRUE(a.surface().closed());
  const auto place_pair = [](Random& random, Body& first, Body& second) {
    first.place(random.pose(1.0), random.amplitudes(5, 0.02));
    const Vec3 away = random.vector(1.0).normalized();
    second.place({random.pose(1.0).q, first.pose.p + random.uniform(0.5, 1.0) * away}, random.amplitudes(5, 0.02));
  };
  expect_more_than({.apart = 5, .overlapping = 5, .edge = 0, .inside = 20},
                   expect_all_contacts_of_pairs(a, b, 0.04, 61, trials(30), place_pair));
}

TEST(Bunny, BunnyAndBoxHaveTheContactsOfAllFeaturePairs) {
  const auto model = bunny_model(5);
  if (model == nullptr) GTEST_SKIP() << "Debian package glmark2-data is not installed";
  Body a(model), b(Shape{Box{kHalfBox}});
  const auto place_pair = [](Random& random, Body& bunny, Body& box) {
    bunny.place(random.pose(1.0), random.amplitudes(5, 0.02));
    const Vec3 away = random.vector(1.0).normalized();
    box.place_box({random.pose(1.0).q, bunny.pose.p + random.uniform(0.5, 1.1) * away}, kHalfBox);
  };
  expect_more_than({.apart = 5, .overlapping = 5, .edge = 0, .inside = 20},
                   expect_all_contacts_of_pairs(a, b, 0.04, 62, trials(30), place_pair));
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

}  // namespace
}  // namespace limber
