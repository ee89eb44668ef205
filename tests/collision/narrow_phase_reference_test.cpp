// The narrow phase against all pairs of features, in long double where it matters.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "asked.h"
#include "block_model.h"
#include "coarse_bunny.h"
#include "contact_bodies.h"
#include "contact_reference.h"
#include "limber/collision/closest_features.h"
#include "narrow_phase_bodies.h"
#include "narrow_phase_reference.h"
#include "random_states.h"
#include "scoped_value.h"
#include "tuning.h"
#include "wavy_model.h"

namespace limber {
namespace {

using testing::all_or_tenth;
using testing::Body;
using testing::compare;
using testing::Comparison;
using testing::contacts_of;
using testing::expect_well_formed;
using testing::Expected;
using testing::hull_distance;
using testing::index_of;
using testing::key_of;
using testing::kGap;
using testing::local_minima;
using testing::lumpy_sphere;
using testing::Near;
using testing::PairReference;
using testing::point_a;
using testing::Random;
using testing::ScopedValue;
using testing::sheet;
using testing::trials;
using testing::winding_number;

/// How many pairs and contacts of each kind have been compared.
struct Tally {
  int apart = 0, overlapping = 0, inside = 0;
  int edges = 0, edge_minima = 0, crossed = 0;  ///< edge pairs: apart, minima of the distance among these, crossed
};

void expect_all_contacts(Body& a, Body& b, double margin, Tally& tally) {
  const auto contacts = contacts_of(a, b, margin, {.overlap = OverlapMethod::kNearestPoint});
  expect_well_formed(contacts, a, b, margin);
  const PairReference reference(a.plain(), b.plain(), margin);
  const Comparison compared = compare(contacts, reference, a, b);
  ASSERT_THAT(compared.missed, ::testing::IsEmpty());
  ASSERT_THAT(compared.extra, ::testing::IsEmpty());
  ASSERT_LE(compared.worst_gap, kGap);
  ASSERT_LE(compared.worst_normal, kGap);  // so far may points a gap apart be wrong
  const auto of = [&](Expected::Kind kind) { return compared.of_kind[static_cast<int>(kind)]; };
  ++(compared.overlap ? tally.overlapping : tally.apart);
  tally.inside += of(Expected::Kind::kVertexInside);
  tally.edges += of(Expected::Kind::kEdgesApart), tally.edge_minima += reference.edge_minima();
  tally.crossed += of(Expected::Kind::kEdgesCrossed);
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

/// Each kind of contact has been seen in so many pairs, or so many times, at least.
void expect_at_least(const Tally& least, const Tally& seen) {
  EXPECT_GE(seen.apart, all_or_tenth(least.apart));
  EXPECT_GE(seen.overlapping, all_or_tenth(least.overlapping));
  EXPECT_GE(seen.inside, all_or_tenth(least.inside));
  EXPECT_GE(seen.edges, all_or_tenth(least.edges));
  EXPECT_GE(seen.edge_minima, all_or_tenth(least.edge_minima));
  EXPECT_GE(seen.crossed, all_or_tenth(least.crossed));
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
  expect_at_least({.apart = 50, .overlapping = 50, .inside = 100, .edges = 30, .edge_minima = 20, .crossed = 20},
                  expect_all_contacts_of_pairs(a, b, 0.08, 21, trials(300), place_pair));
}

TEST(NarrowPhase, LumpySphereAndBoxHaveTheContactsOfAllFeaturePairs) {
  Body a(lumpy_sphere(2, 5)), b(Shape{Box{kHalfBox}});
  const auto place_pair = [](Random& random, Body& lumpy, Body& box) {
    lumpy.place(random.pose(1.0), random.amplitudes(5, 0.05));
    const Vec3 away = random.vector(1.0).normalized();
    box.place_box({random.pose(1.0).q, lumpy.pose.p + random.uniform(0.6, 1.2) * away}, kHalfBox);
  };
  expect_at_least({.apart = 50, .overlapping = 50, .inside = 100, .edges = 25, .edge_minima = 15, .crossed = 100},
                  expect_all_contacts_of_pairs(a, b, 0.08, 22, trials(300), place_pair));
}

/// Other numbers give other contacts, and the reference tells: so a fault of that size would not pass the tests above.
TEST(NarrowPhase, ContactsByOtherNumbersAreNotThoseOfTheReference) {
  Random random(29);
  Body a(lumpy_sphere(1, 5)), b(lumpy_sphere(2, 3));
  std::size_t missed = 0, extra = 0;
  for (int trial = 0; trial < 60; ++trial) {
    a.place(random.pose(1.0), random.amplitudes(5, 0.05));
    b.place({random.pose(1.0).q, a.pose.p + random.uniform(0.7, 1.0) * random.vector(1.0).normalized()},
            random.amplitudes(3, 0.05));
    const PairReference reference(a.plain(), b.plain(), 0.08);
    for (const double factor : {0.5, 2.0}) {
      internal::CollisionTuning tuning;
      tuning.narrow.rocking *= factor;
      const ScopedValue in_force(internal::collision_tuning_in_use, tuning);
      const auto contacts = contacts_of(a, b, 0.08, {.overlap = OverlapMethod::kNearestPoint});
      const Comparison compared = compare(contacts, reference, a, b);
      (factor < 1.0 ? missed : extra) += factor < 1.0 ? compared.missed.size() : compared.extra.size();
    }
  }
  EXPECT_GT(missed, 0u);
  EXPECT_GT(extra, 0u);
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
  expect_at_least({.apart = 5, .overlapping = 5, .inside = 20, .edges = 0, .edge_minima = 0, .crossed = 0},
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
  expect_at_least({.apart = 5, .overlapping = 5, .inside = 20, .edges = 0, .edge_minima = 0, .crossed = 0},
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
  EXPECT_GT(vertices, all_or_tenth(500));
  EXPECT_GT(others, all_or_tenth(100));
  EXPECT_GT(inside, all_or_tenth(300));
}

TEST(NarrowPhase, CapsuleAgreesWithTheHullOfItsAxis) {
  Random random(25);
  Body lumpy(lumpy_sphere(2, 4));
  int apart = 0;
  for (int trial = 0; trial < all_or_tenth(300); ++trial) {
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
  EXPECT_GT(apart, all_or_tenth(50));
}

}  // namespace
}  // namespace limber
