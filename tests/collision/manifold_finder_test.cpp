// Game contact's finder: manifolds of few points that live from query to query, against all contacts of ContactFinder
// and against closed forms.
#include "limber/collision/manifold_finder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>
#include <vector>

#include "asked.h"
#include "counted_new.h"
#include "finder_scenes.h"
#include "limber/collision/contact_finder.h"
#include "limber/core/error.h"
#include "solid_bodies.h"
#include "thread_jobs.h"

namespace limber {
namespace {

using testing::contacts_of;
using testing::ContactScene;
using testing::Random;
using Pair = std::pair<Index, Index>;

Quaternion turned(double x, double y, double z) { return quaternion_from_rotation_vector({x, y, z}); }

std::map<Pair, std::vector<ContactPoint>> by_pair(const std::vector<ContactPoint>& contacts) {
  std::map<Pair, std::vector<ContactPoint>> pairs;
  for (const ContactPoint& c : contacts) pairs[{c.a.body, c.b.body}].push_back(c);
  return pairs;
}

const ContactPoint& deepest(const std::vector<ContactPoint>& contacts) {
  return *std::ranges::min_element(contacts, {}, &ContactPoint::gap);
}

/// Of the hull of contacts, seen along a normal: the largest triangle fan would do for few points.
double hull_area(const std::vector<ContactPoint>& contacts, const Vec3& normal) {
  const Vec3 x = normal.unitOrthogonal(), y = normal.cross(x);
  double area = 0.0;  // ½ ∮ of the support function's derivative, by 720 directions
  constexpr int kDirections = 720;
  std::vector<Eigen::Vector2d> hull;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kDirections;
    const Vec3 d = std::cos(angle) * x + std::sin(angle) * y;
    const ContactPoint& far =
        *std::ranges::max_element(contacts, {}, [&](const ContactPoint& c) { return d.dot(c.position); });
    hull.emplace_back(x.dot(far.position), y.dot(far.position));
  }
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Eigen::Vector2d &p = hull[i], &q = hull[(i + 1) % hull.size()];
    area += 0.5 * (p.x() * q.y() - p.y() * q.x());
  }
  return area;
}

/// Balls, capsules, boxes and hulls with random poses, two at a time near each other, far from the others.
ContactScene random_pairs(int pairs, unsigned seed, double apart) {
  Random random(seed);
  const auto shape = [&]() -> Shape {
    switch (random.index(4)) {
      case 0:
        return Sphere{random.uniform(0.2, 0.6)};
      case 1:
        return Capsule{random.uniform(0.2, 0.4), random.uniform(0.1, 0.6)};
      case 2:
        return Box{Vec3(random.uniform(0.2, 0.6), random.uniform(0.2, 0.6), random.uniform(0.2, 0.6))};
      default: {
        ConvexHull hull;
        for (int i = 0; i < 10; ++i) hull.points.push_back(random.vector(1.0).normalized() * 0.5);
        return hull;
      }
    }
  };
  ContactScene scene;
  for (int p = 0; p < pairs; ++p) {
    const Vec3 middle(10.0 * p, 0.0, 0.0);
    scene.add(shape(), {random.pose(1.0).q, middle});
    scene.add(shape(), {random.pose(1.0).q, middle + random.uniform(0.4, apart) * random.vector(1.0).normalized()});
  }
  return scene;
}

TEST(ManifoldFinder, WhatOverlapsHasTheDeepestContactOfTheExactFinderAndNoOtherPairHasOne) {
  const ContactScene scene = random_pairs(testing::trials(400), 3, 1.2);
  ManifoldFinder finder;
  ContactFinder exact;
  scene.add_all_to(finder), scene.add_all_to(exact);
  constexpr double kMargin = 0.02;
  const auto found = by_pair(contacts_of(finder, scene, kMargin)), all = by_pair(contacts_of(exact, scene, kMargin));
  EXPECT_GT(all.size(), testing::all_or_tenth(100u));
  ASSERT_EQ(found.size(), all.size());
  for (const auto& [pair, contacts] : all) {
    ASSERT_TRUE(found.contains(pair));
    const ContactPoint &expected = deepest(contacts), &seen = deepest(found.at(pair));
    EXPECT_NEAR(seen.gap, expected.gap, 1e-9);
    EXPECT_LE((seen.normal - expected.normal).norm(), 1e-9);
    EXPECT_LE(found.at(pair).size(), 4u);
    std::set<std::uint64_t> ids;
    for (const ContactPoint& c : found.at(pair)) {
      EXPECT_NEAR(c.normal.norm(), 1.0, 1e-12);
      const bool capsules = c.a.radius > 0.0 && c.b.radius > 0.0;  // side by side each end has its own normal
      EXPECT_LE((c.normal - expected.normal).norm(), capsules ? 0.5 : 0.25);  // faces that meet within 14°
      ids.insert(c.id);
      const RigidTransform &X_a = scene.poses[static_cast<std::size_t>(c.a.body)],
                           &X_b = scene.poses[static_cast<std::size_t>(c.b.body)];
      const Vec3 between = X_a * c.a.point_B - X_b * c.b.point_B;
      EXPECT_LE((between - c.gap * c.normal).norm(), 1e-6);
      EXPECT_LE((0.5 * (X_a * c.a.point_B + X_b * c.b.point_B) - c.position).norm(), 1e-9);
    }
    EXPECT_EQ(ids.size(), found.at(pair).size());
  }
}

TEST(ManifoldFinder, FacesKeepTheDeepestContactAndMostOfTheirSupport) {
  Random random(5);
  double least = 1.0;
  int thinned = 0;
  for (int trial = 0; trial < testing::all_or_tenth(500); ++trial) {
    ContactScene scene;
    scene.add(Box{{0.5, 0.4, 0.2}});
    const Quaternion q = turned(0.0, 0.0, random.uniform(-3.0, 3.0)) * turned(random.uniform(-0.02, 0.02), 0.0, 0.0);
    scene.add(Box{{0.5, 0.4, 0.2}}, {q, {random.uniform(-0.4, 0.4), random.uniform(-0.4, 0.4), 0.41}});
    ManifoldFinder finder;
    ContactFinder exact;
    scene.add_all_to(finder), scene.add_all_to(exact);
    const auto few = contacts_of(finder, scene, 0.05), all = contacts_of(exact, scene, 0.05);
    ASSERT_LE(few.size(), 4u);
    ASSERT_FALSE(few.empty());
    EXPECT_NEAR(deepest(few).gap, deepest(all).gap, 1e-12);
    if (all.size() <= 4) continue;
    ++thinned;
    const Vec3 normal = few[0].normal;
    least = std::min(least, hull_area(few, normal) / hull_area(all, normal));
  }
  EXPECT_GT(thinned, testing::all_or_tenth(100));
  EXPECT_GT(least, 0.63);  // the largest quadrilateral in an ellipse has 2/π = 0.637 of its area
}

TEST(ManifoldFinder, WhatHardlyMovedKeepsItsManifoldWithGapsAsTheyAreNow) {
  ContactScene scene = random_pairs(200, 7, 1.1);
  const std::vector<RigidTransform> start = scene.poses;
  ManifoldFinder finder;
  scene.add_all_to(finder);
  constexpr double kMargin = 0.02;
  const auto before = by_pair(contacts_of(finder, scene, kMargin));
  Random random(8);
  double worst = 0.0;
  for (int step = 0; step < 10; ++step) {
    for (std::size_t i = 0; i < scene.poses.size(); ++i) {
      const Quaternion q = quaternion_from_rotation_vector(random.vector(2e-3));
      scene.poses[i] = {q * start[i].q, start[i].p + random.vector(5e-4)};
    }
    const auto recycled = by_pair(contacts_of(finder, scene, kMargin));
    EXPECT_EQ(finder.counts().recycled, finder.counts().pairs);
    ManifoldFinder fresh;
    scene.add_all_to(fresh);
    for (const auto& [pair, contacts] : by_pair(contacts_of(fresh, scene, kMargin))) {
      const double gap = deepest(contacts).gap;
      if (gap > 0.5 * kMargin) continue;  // what comes or goes at the margin
      ASSERT_TRUE(recycled.contains(pair));
      worst = std::max(worst, std::abs(deepest(recycled.at(pair)).gap - gap));
    }
  }
  EXPECT_LT(worst, 5e-4);  // a thousandth of bodies of 0.4 to 1.2 m
}

TEST(ManifoldFinder, ASlidingBoxKeepsItsIdsAndEachPointStaysOverItsFoot) {
  ContactScene scene;
  scene.add(Box{{2.0, 2.0, 0.1}});
  scene.add(Box{{0.2, 0.15, 0.1}}, {turned(0.0, 0.0, 0.3), {0.0, 0.0, 0.2}});
  ManifoldFinder finder;
  scene.add_all_to(finder);
  const auto first = contacts_of(finder, scene, 1e-3);
  ASSERT_EQ(first.size(), 4u);
  for (int step = 1; step <= 50; ++step) {
    scene.poses[1].p.x() = 7e-4 * step;
    const auto contacts = contacts_of(finder, scene, 1e-3);
    ASSERT_EQ(contacts.size(), 4u);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(contacts[i].id, first[i].id);
      const Vec3 below = scene.poses[0] * contacts[i].a.point_B, above = scene.poses[1] * contacts[i].b.point_B;
      EXPECT_LE((below - above - contacts[i].gap * contacts[i].normal).norm(), 1e-15);
      EXPECT_LE((above - scene.poses[1] * first[i].b.point_B).norm(), 1e-12);
    }
  }
}

TEST(ManifoldFinder, ContactsThatTheMotionMayCloseAreThereBeforeItAndNoOthers) {
  ContactScene scene;
  scene.add(HalfSpace{});
  scene.add(Box{Vec3::Constant(0.1)}, {{}, {0.0, 0.0, 0.2}});  // 0.1 m above the ground
  std::vector<BodyState> states = scene.states();
  std::vector<ContactPoint> contacts;
  const auto found = [&](const Vec3& displacement, double reach) {
    ManifoldFinder finder;
    scene.add_all_to(finder);
    states[1].displacement = displacement, states[1].reach = reach;
    finder.find_contacts({.states = states, .margin = 1e-3}, contacts, serial_jobs());
    return contacts.size();
  };
  EXPECT_EQ(found({0.0, 0.0, -0.098}, 0.0), 0u);
  EXPECT_EQ(found({0.0, 0.0, -0.1}, 0.0), 4u);
  EXPECT_EQ(found({0.0, 0.0, -0.095}, 0.005), 4u);
  EXPECT_EQ(found({0.3, 0.0, 0.1}, 0.0), 0u);  // away
  EXPECT_EQ(found({5.0, 0.0, 0.0}, 0.0), 0u);  // along
}

TEST(ManifoldFinder, ABoxThatSlidesTowardsAFlushOneIsNotStoppedByItsSideAndByAHigherOneItIs) {
  for (const double step_up : {0.0, 1e-4, 0.05}) {
    ContactScene scene;
    scene.add(Box{{0.5, 0.5, 0.5}}, {{}, {0.5, 0.0, -0.5 + step_up}});
    scene.add(Box{{0.2, 0.2, 0.2}}, {{}, {-0.21, 0.0, 0.2 - 1e-4}});  // 1 cm before it, a little lower than its top
    ManifoldFinder finder;
    scene.add_all_to(finder);
    std::vector<BodyState> states = scene.states();
    states[1].displacement = {0.05, 0.0, 0.0};
    std::vector<ContactPoint> contacts;
    finder.find_contacts({.states = states, .margin = 1e-3}, contacts, serial_jobs());
    if (step_up < 0.01) {
      EXPECT_TRUE(contacts.empty());
    } else {
      ASSERT_FALSE(contacts.empty());
      for (const ContactPoint& c : contacts) EXPECT_LE((c.normal - Vec3::UnitX()).norm(), 1e-12);  // out of b, into a
    }
  }
}

TEST(ManifoldFinder, OverlappingBodiesLeaveEachOtherOneWay) {
  Random random(11);
  for (int trial = 0; trial < 200; ++trial) {
    const double share = random.uniform(0.04, 0.5);
    ContactScene scene;
    scene.add(Box{{0.5, 0.4, 0.3}});
    const Vec3 off = random.vector(0.25);
    scene.add(Box{{0.5, 0.4, 0.3}}, {turned(0.1 * off.x(), 0.1, off.z()), {off.x(), off.y(), 0.6 * (1.0 - share)}});
    ManifoldFinder finder;
    scene.add_all_to(finder);
    auto contacts = contacts_of(finder, scene, 1e-3);
    ASSERT_FALSE(contacts.empty());
    for (const ContactPoint& c : contacts) EXPECT_LE((c.normal - contacts[0].normal).norm(), 1e-12);
    // Moved apart by its depth along the normal, nothing is left of the overlap.
    scene.poses[0].p -= (deepest(contacts).gap - 1e-9) * contacts[0].normal;
    ManifoldFinder after;
    scene.add_all_to(after);
    contacts = contacts_of(after, scene, 1e-3);
    if (!contacts.empty()) {
      EXPECT_GE(deepest(contacts).gap, -1e-9);
    }
  }
}

std::vector<ContactPoint> after_steps(ManifoldFinder& finder, ContactScene& scene, int from, int to, Jobs& jobs) {
  std::vector<ContactPoint> contacts;
  for (int step = from; step < to; ++step) {
    for (std::size_t i = 1; i < scene.poses.size(); ++i)
      scene.poses[i].p += 1e-3 * std::sin(0.7 * step + static_cast<double>(i)) * Vec3(1.0, 0.5, 0.3);
    contacts = contacts_of(finder, scene, 5e-3, Vec3::Zero(), jobs);
  }
  return contacts;
}

void expect_equal_contacts(const std::vector<ContactPoint>& a, const std::vector<ContactPoint>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].id, b[i].id);
    EXPECT_EQ(a[i].gap, b[i].gap);
    EXPECT_EQ(a[i].normal, b[i].normal);
    EXPECT_EQ(a[i].position, b[i].position);
    EXPECT_EQ(a[i].a.point_B, b[i].a.point_B);
    EXPECT_EQ(a[i].b.point_B, b[i].b.point_B);
  }
}

TEST(ManifoldFinder, SameBitsForAnyThreadCountAndAfterARestoredState) {
  const ContactScene start = testing::heap(60);
  ManifoldFinder finder;
  start.add_all_to(finder);
  ContactScene scene = start;
  after_steps(finder, scene, 0, 10, serial_jobs());
  std::vector<std::byte> bytes;
  StateWriter writer(bytes);
  finder.save_state(writer);
  const ContactScene middle = scene;
  const auto expected = after_steps(finder, scene, 10, 20, serial_jobs());
  EXPECT_GT(expected.size(), 100u);
  for (const int threads : testing::all_or_first<int>({3, 2, 8})) {
    testing::ThreadJobs jobs(threads);
    ManifoldFinder other;
    start.add_all_to(other);
    ContactScene again = start;
    expect_equal_contacts(after_steps(other, again, 0, 20, jobs), expected);
  }
  ManifoldFinder restored;
  start.add_all_to(restored);
  StateReader reader(bytes);
  restored.restore_state(reader);
  EXPECT_EQ(reader.left(), 0u);
  scene = middle;
  expect_equal_contacts(after_steps(restored, scene, 10, 20, serial_jobs()), expected);
}

TEST(ManifoldFinder, AWarmQueryAllocatesNothing) {
  ContactScene scene = testing::heap(120);
  ManifoldFinder finder;
  for (std::size_t i = 0; i < scene.geometries.size(); ++i)
    finder.add_body(static_cast<Index>(i), scene.geometries[i], {.self = i % 5 == 0});
  const auto start = scene.poses;
  std::vector<BodyState> states;
  std::vector<ContactPoint> contacts;
  const auto query = [&](int step) {
    for (std::size_t i = 1; i < scene.poses.size(); ++i) {
      scene.poses[i].p = start[i].p + 0.01 * std::sin(0.5 * step + static_cast<double>(i)) * Vec3::Ones();
      scene.asleep[i] = i % 7 == 3 && step / 4 % 2 == 0;
    }
    states.clear();
    for (std::size_t i = 0; i < scene.poses.size(); ++i)
      states.push_back({.pose = scene.poses[i], .amplitudes = scene.amplitudes[i], .asleep = scene.asleep[i]});
    finder.find_contacts({.states = states, .margin = 0.01}, contacts, serial_jobs());
  };
  constexpr int kPeriod = 26;  // 4π / 0.5 steps, rounded up
  for (int step = 0; step < 2 * kPeriod; ++step) query(step);
  const long before = testing::allocations();
  for (int step = 0; step < 2 * kPeriod; ++step) query(step);
  EXPECT_EQ(testing::allocations() - before, 0);
  EXPECT_GT(contacts.size(), 100u);
}

/// Of sheets, which distance fields do not resolve.
TEST(ManifoldFinder, ThinBentBodiesHaveAllContactsByTriangles) {
  Random random(19);
  ContactScene scene;
  const auto sheet = testing::wavy_model(boundary_surface(testing::solid_box({0.3, 0.2, 0.004}, {6, 4, 1})).surface, 6);
  scene.add(HalfSpace{});
  for (int i = 0; i < 6; ++i)
    scene.add(BodyGeometry{.model = sheet, .shape = {}}, {random.pose(0.2).q, {0.02 * i, 0.0, 0.02 + 0.01 * i}},
              random.amplitudes(6, 0.005));
  ManifoldFinder finder;
  ContactFinder exact;
  scene.add_all_to(finder), scene.add_all_to(exact);
  const auto all = contacts_of(exact, scene, 0.01);
  const auto modal = [&](const ContactPoint& c) { return c.a.triangle >= 0 || c.b.triangle >= 0; };
  const auto found = contacts_of(finder, scene, 0.01);
  std::map<std::uint64_t, double> gaps;
  for (const ContactPoint& c : found)
    if (modal(c)) gaps[c.id] = c.gap;
  EXPECT_EQ(static_cast<std::ptrdiff_t>(gaps.size()), std::ranges::count_if(all, modal));
  for (const ContactPoint& c : all) {
    if (!modal(c)) continue;
    ASSERT_TRUE(gaps.contains(c.id));
    EXPECT_NEAR(gaps[c.id], c.gap, 1e-12);
  }
  EXPECT_GT(gaps.size(), 20u);
}

TEST(ManifoldFinder, BentBodiesKeepTheirContactsUntilTheyBend) {
  ContactScene scene = testing::heap(20);
  ManifoldFinder finder;
  scene.add_all_to(finder);
  contacts_of(finder, scene, 0.01);
  contacts_of(finder, scene, 0.01);
  EXPECT_EQ(finder.counts().recycled, finder.counts().pairs);
  for (auto& z : scene.amplitudes)
    for (double& number : z) number *= 2.0;
  contacts_of(finder, scene, 0.01);
  EXPECT_LT(finder.counts().recycled, finder.counts().pairs);
}

TEST(ManifoldFinder, OnlySleepersBesideAwakeBodiesAreLookedAt) {
  ContactScene scene;
  scene.add(HalfSpace{});
  scene.asleep[0] = true;
  for (int i = 0; i < 3; ++i) scene.add(Box{Vec3::Constant(0.1)}, {{}, {0.0, 0.0, 0.1 + 0.2 * i}});
  scene.asleep[1] = scene.asleep[2] = true;
  ManifoldFinder finder;
  scene.add_all_to(finder);
  const auto contacts = contacts_of(finder, scene, 1e-3);
  EXPECT_EQ(finder.counts().pairs, 1);
  ASSERT_EQ(contacts.size(), 4u);
  for (const ContactPoint& c : contacts) EXPECT_EQ(Pair(c.a.body, c.b.body), Pair(2, 3));
  std::vector<ContactPoint> again;
  const std::vector<Index> awake{3};
  finder.find_contacts({.states = scene.states(), .margin = 1e-3, .awake = awake}, again, serial_jobs());
  expect_equal_contacts(again, contacts);
}

TEST(ManifoldFinder, FiltersAndExcludedPairsAreObeyedAndIndicesAreUsedAgain) {
  ContactScene scene;
  for (int i = 0; i < 3; ++i) scene.add(Box{Vec3::Constant(0.1)}, {{}, {0.0, 0.0, 0.2 * i}});
  ManifoldFinder finder;
  scene.add_all_to(finder);
  EXPECT_EQ(by_pair(contacts_of(finder, scene, 1e-3)).size(), 2u);
  finder.exclude_pair(0, 1, true);
  EXPECT_EQ(by_pair(contacts_of(finder, scene, 1e-3)).size(), 1u);
  finder.set_filter(2, {.layers = 2, .mask = 2});
  EXPECT_TRUE(contacts_of(finder, scene, 1e-3).empty());
  finder.remove_body(1);
  finder.add_body(1, {.shape = std::make_shared<const Shape>(Sphere{0.1})}, {});
  const auto contacts = contacts_of(finder, scene, 1e-3);
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_EQ(contacts[0].b.radius, 0.1);
}

TEST(ManifoldFinder, WrongStatesAndOptionsAreRefusedAndChangeNothing) {
  EXPECT_THROW(ManifoldFinder({.recycle_distance = -0.1}), InvalidArgument);
  EXPECT_THROW(ManifoldFinder({.recycle_turn = 0.2}), InvalidArgument);
  EXPECT_THROW(ManifoldFinder({.flush = std::nan("")}), InvalidArgument);
  ContactScene scene = testing::heap(8);
  ManifoldFinder finder;
  scene.add_all_to(finder);
  const auto contacts = contacts_of(finder, scene, 0.01);
  std::vector<ContactPoint> refused = contacts;
  const auto refuses = [&](const auto& change) {
    std::vector<BodyState> states = scene.states();
    change(states);
    EXPECT_THROW(finder.find_contacts({.states = states, .margin = 0.01}, refused, serial_jobs()), InvalidArgument);
    expect_equal_contacts(refused, contacts);
    expect_equal_contacts(contacts_of(finder, scene, 0.01), contacts);
  };
  refuses([](auto& s) { s[1].pose.p.x() = std::nan(""); });
  refuses([](auto& s) { s[1].pose.q = {2.0, 0.0, 0.0, 0.0}; });
  refuses([](auto& s) { s[2].reach = -1.0; });
  refuses([](auto& s) { s[2].displacement.z() = std::numeric_limits<double>::infinity(); });
  refuses([](auto& s) { s[1].amplitudes = {}; });
  refuses([](auto& s) { s.pop_back(); });
  EXPECT_THROW(contacts_of(finder, scene, -1.0), InvalidArgument);
  EXPECT_THROW(finder.add_body(1, scene.geometries[1], {}), InvalidArgument);
  EXPECT_THROW(finder.remove_body(99), InvalidArgument);
}

}  // namespace
}  // namespace limber
