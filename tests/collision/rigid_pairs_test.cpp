// Contacts of rigid shapes with each other, in closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "asked.h"
#include "contact_bodies.h"
#include "narrow_phase_bodies.h"
#include "random_states.h"
#include "shapes.h"

namespace limber {
namespace {

using testing::Body;
using testing::contacts_of;
using testing::expect_well_formed;
using testing::is_kind;
using testing::key_of;
using testing::Random;
using testing::rigid;

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

TEST(RigidPairs, BricksThatLieOnEachOtherByRoundOffPressStraightThrough) {
  constexpr double kWithin = 2e-6;  // of what is tilted and lifted below
  const Vec3 half(0.15, 0.12, 0.09);
  Random random(37);
  for (int trial = 0; trial < testing::all_or_tenth(20000); ++trial) {
    const RigidTransform X = random.pose(1.0);
    const double lift = std::pow(10.0, random.uniform(-16.0, -6.0));
    const Vec3 tilt = std::pow(10.0, random.uniform(-16.0, -6.0)) * random.vector(1.0);
    const RigidTransform above{quaternion_from_rotation_vector(Vec3(0.0, 0.0, random.uniform(-3.0, 3.0)) + tilt),
                               {random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 2.0 * half.z() + lift}};
    Body lower = rigid(Box{half}, X), upper = rigid(Box{half}, X * above);
    for (const ContactPoint& c : contacts_of(upper, lower, 0.01)) {
      if (c.gap > kWithin) continue;  // beside it
      ASSERT_GT(c.gap, -kWithin) << trial;
      ASSERT_GT(c.normal.dot(X.q * Vec3::UnitZ()), 1.0 - 1e-3) << trial;
    }
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
  EXPECT_EQ(c[0].a.radius, 0.3);
  EXPECT_EQ(c[0].b.radius, 0.5);

  const Quaternion lying = quaternion_from_rotation_vector(Vec3(0, std::numbers::pi / 2.0, 0));
  Body rod = rigid(Capsule{0.1, 0.4}, {lying, {0, 0, 0.59}}), box = rigid(Box{Vec3::Constant(0.5)}, {});
  c = contacts_of(rod, box, 0.01);
  ASSERT_EQ(c.size(), 2u);
  for (const ContactPoint& x : c) {
    EXPECT_NEAR(x.gap, -0.01, 1e-14);
    EXPECT_EQ(x.a.radius, 0.1);
    EXPECT_EQ(x.b.radius, 0.0) << "a face is flat";
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

}  // namespace
}  // namespace limber
