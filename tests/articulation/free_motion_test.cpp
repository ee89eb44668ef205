// Motions whose ends are known on paper: bars that hit stops, drawers, wheels, screws.
#include "limber/articulation/free_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>
#include <random>

#include "asked.h"
#include "constants.h"
#include "limber/core/error.h"
#include "parts.h"
#include "shells.h"

namespace limber {
namespace {

using Kind = MotionPath::Kind;
using testing::kDegree;
using testing::kPi;

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Ends are followed down to a tenth of the tolerance across, which is 2e-4 of the smaller body's diagonal.
constexpr double kEnd = 1e-4;

FreeMotion turn(const SurfaceMesh& moving, const SurfaceMesh& fixed, const MotionPath& path, double sagitta = 0.0,
                const FreeMotionOptions& options = {}) {
  const MotionBody m{&moving, surface_quality(moving).closed_manifold()},
      f{&fixed, surface_quality(fixed).closed_manifold()};
  return free_motion({&m, 1}, {&f, 1}, path, options, sagitta);
}

const MotionPath kAboutZ{.kind = Kind::kRotation, .axis = Vec3::UnitZ()};
const MotionPath kAlongX{.kind = Kind::kTranslation, .axis = Vec3::UnitX()};

/// A bar along x from the z axis, 2 wide.
SurfaceMesh bar() { return shapes::box({0, -1, -1}, {10, 1, 1}); }

TEST(FreeMotion, BarStopsWhereItsFaceMeetsTheBlock) {
  // The block's edge at (8, 5) meets the bar's upper face, which is 1 from the axis: atan2(5, 8) − asin(1/√89).
  const SurfaceMesh block = shapes::box({5, 5, -1}, {8, 9, 1});
  const FreeMotion m = turn(bar(), block, kAboutZ);
  EXPECT_NEAR(m.reachable.high, std::atan2(5.0, 8.0) - std::asin(1.0 / std::sqrt(89.0)), kEnd);
  EXPECT_EQ(m.high.body, 0);
  EXPECT_TRUE(m.others.empty());
  EXPECT_FALSE(m.overlapping);
}

TEST(FreeMotion, BothEndsAndWhatLiesBehindAnObstacleAreFound) {
  // Two thin posts, at 60° and −100°, radius 6: the bar is free between them on either side.
  SurfaceMesh posts =
      parts::cylinder({6 * std::cos(60 * kDegree), 6 * std::sin(60 * kDegree), 0}, Vec3::UnitZ(), 0.1, 4, 64);
  shapes::append(
      parts::cylinder({6 * std::cos(100 * kDegree), -6 * std::sin(100 * kDegree), 0}, Vec3::UnitZ(), 0.1, 4, 64),
      posts);
  const FreeMotion m = turn(bar(), posts, kAboutZ);
  const double half = std::asin(1.1 / 6.0);  // the bar's half width and the post's radius, seen from the axis
  EXPECT_NEAR(m.reachable.high, 60 * kDegree - half, 1e-3);
  EXPECT_NEAR(m.reachable.low, -100 * kDegree + half, 1e-3);
  ASSERT_EQ(m.others.size(), 1u);
  EXPECT_NEAR(m.others[0].low, 60 * kDegree + half, 1e-3);
  EXPECT_NEAR(m.others[0].high, 260 * kDegree - half, 1e-3);
}

TEST(FreeMotion, WheelOnItsAxleTurnsForEver) {
  for (const int segments : {8, 16, 32, 64})
    for (const double clearance : {0.0, 0.01, -0.01}) {
      const SurfaceMesh wheel = parts::tube({0, 0, 0}, Vec3::UnitZ(), 1.0, 5.0, 2.0, segments);
      const SurfaceMesh axle = parts::cylinder({0, 0, 0}, Vec3::UnitZ(), 1.0 - clearance, 6.0, segments);
      const double sagitta = facet_sagitta(axle, Vec3::Constant(-10), Vec3::Constant(10));
      EXPECT_NEAR(sagitta, (1.0 - clearance) * (1.0 - std::cos(kPi / segments)), 1e-9);
      const FreeMotion m = turn(wheel, axle, kAboutZ, sagitta);
      EXPECT_TRUE(m.reachable.open()) << segments << " segments, clearance " << clearance << ": " << m.reachable.low
                                      << " to " << m.reachable.high;
      EXPECT_FALSE(m.overlapping);
    }
}

TEST(FreeMotion, PinSlidesInItsHoleUntilItsHeadMeetsTheBlock) {
  for (const int segments : {8, 16, 32}) {
    const SurfaceMesh block = parts::tube({0, 0, 0}, Vec3::UnitX(), 1.0, 3.0, 4.0, segments);
    SurfaceMesh pin = parts::cylinder({1, 0, 0}, Vec3::UnitX(), 1.0, 8.0, segments);       // x from −3 to 5
    shapes::append(parts::cylinder({5.5, 0, 0}, Vec3::UnitX(), 2.0, 1.0, segments), pin);  // head from 5 to 6
    const FreeMotion m = turn(pin, block, kAlongX, facet_sagitta(block, Vec3::Constant(-10), Vec3::Constant(10)));
    EXPECT_NEAR(m.reachable.low, 2.0 - 5.0, kEnd) << segments;
    EXPECT_EQ(m.reachable.high, std::numeric_limits<double>::infinity());
  }
}

TEST(FreeMotion, DrawerGoesFromItsBackToItsLip) {
  // A drawer that lies on the floor of its case and touches both sides; closed, it is 0.5 from the back.
  SurfaceMesh shell = shapes::box({0, -6, -1}, {20, 6, 0});     // floor
  shapes::append(shapes::box({0, -6, 0}, {20, -5, 5}), shell);  // sides
  shapes::append(shapes::box({0, 5, 0}, {20, 6, 5}), shell);
  shapes::append(shapes::box({-1, -6, -1}, {0, 6, 5}), shell);  // back
  shapes::append(shapes::box({17, -6, 3}, {20, 6, 5}), shell);  // lip at the top
  SurfaceMesh drawer = shapes::box({0.5, -5, 0}, {18, 5, 2.5});
  shapes::append(shapes::box({0.5, -5, 2.5}, {1.5, 5, 4}), drawer);  // its tall back meets the lip
  const FreeMotion m = turn(drawer, shell, kAlongX);
  EXPECT_NEAR(m.reachable.low, -0.5, kEnd);
  EXPECT_NEAR(m.reachable.high, 17.0 - 1.5, kEnd);
}

TEST(FreeMotion, WhatTouchesAsReadBlocksOneWayOnly) {
  for (const double overlap : {0.0, 1e-3, -1e-3}) {
    const SurfaceMesh wall = shapes::box({-1, -5, -5}, {0, 5, 5}), block = shapes::box({-overlap, -1, -1}, {2, 1, 1});
    const FreeMotion m = turn(block, wall, kAlongX);
    EXPECT_NEAR(m.reachable.low, std::min(overlap, 0.0), 1e-9) << overlap;
    EXPECT_EQ(m.reachable.high, std::numeric_limits<double>::infinity());
  }
}

TEST(FreeMotion, SheetsStopWhatCrossesThem) {
  SurfaceMesh sheet;
  sheet.vertices = {{4, -5, -5}, {4, 5, -5}, {4, 0, 9}};
  sheet.triangles = {{0, 2, 1}};
  const SurfaceMesh block = shapes::box({0, -1, -1}, {2, 1, 1});
  const FreeMotion m = turn(block, sheet, kAlongX);
  EXPECT_NEAR(m.reachable.high, 2.0, kEnd);
  EXPECT_EQ(m.reachable.low, -std::numeric_limits<double>::infinity());
  const FreeMotion back = turn(sheet, block, kAlongX);
  EXPECT_NEAR(back.reachable.low, -2.0, kEnd);
}

TEST(FreeMotion, ScrewStopsWhereItsHeadArrives) {
  const SurfaceMesh block = parts::tube({0, 0, 0}, Vec3::UnitX(), 1.0, 3.0, 4.0, 32);
  SurfaceMesh screw = parts::cylinder({1, 0, 0}, Vec3::UnitX(), 1.0, 8.0, 32);
  shapes::append(parts::cylinder({5.5, 0, 0}, Vec3::UnitX(), 2.0, 1.0, 32), screw);
  const MotionPath path{.kind = Kind::kScrew, .axis = Vec3::UnitX(), .pitch = 0.5};
  const FreeMotion m = turn(screw, block, path, facet_sagitta(block, Vec3::Constant(-10), Vec3::Constant(10)));
  EXPECT_NEAR(m.reachable.low, (2.0 - 5.0) / 0.5, 10 * kEnd);
  EXPECT_EQ(m.reachable.high, std::numeric_limits<double>::infinity());
}

TEST(FreeMotion, CollarThatLiesAlongAScrewsMotionStopsItAllTheSame) {
  // A bolt in a nut from −1 to 1, with a collar from 3 on, twice as wide: its face is inclined to the motion by 1 : 8
  // to 1 : 16. What may overlap as drawn (0.1) is as much as 48 degrees of the thread.
  const double lead = 0.75, pitch = lead / (2.0 * kPi);
  const auto plain = [](const assemblies::Shell& shell) { return SurfaceMesh{shell.vertices, shell.triangles}; };
  SurfaceMesh bolt = plain(assemblies::thread(1.0, 0.3, pitch, -3, 4, 32, 0.0, false));
  shapes::append(plain(assemblies::lathe({{0, 3}, {2, 3}, {2, 4.5}, {0, 4.5}}, 32)), bolt);
  const SurfaceMesh nut = plain(assemblies::thread(1.0, 0.3, pitch, -1, 1, 32, 0.5, true, 1.9));
  const MotionPath path{.kind = Kind::kScrew, .axis = Vec3::UnitZ(), .pitch = pitch};
  const FreeMotion m = turn(nut, bolt, path, 0.1, {.largest_overlap = 0.1});
  EXPECT_NEAR(m.tolerance, 0.1, 2e-3);
  EXPECT_NEAR(m.reachable.high, (3.0 - 1.0) / pitch, 10 * kEnd);
  EXPECT_EQ(m.reachable.low, -std::numeric_limits<double>::infinity());
}

TEST(FreeMotion, BlockGoesThroughARowOfFramesToTheWall) {
  // All boxes are in the way, all frames are open: the eleventh body is the first that stops.
  std::vector<SurfaceMesh> row;
  for (int i = 1; i <= 10; ++i) row.push_back(parts::tube({5.0 * i, 0, 0}, Vec3::UnitX(), 2.0, 3.0, 1.0, 16));
  row.push_back(shapes::box({60, -3, -3}, {61, 3, 3}));
  const SurfaceMesh block = shapes::box({0, -1, -1}, {2, 1, 1});
  const MotionBody moving{&block};
  std::vector<MotionBody> fixed;
  for (const SurfaceMesh& body : row) fixed.push_back({&body});
  const FreeMotion m = free_motion({&moving, 1}, fixed, kAlongX);
  EXPECT_NEAR(m.reachable.high, 60.0 - 2.0, kEnd);
  EXPECT_EQ(m.high.body, 10);
  EXPECT_EQ(m.reachable.low, -std::numeric_limits<double>::infinity());
}

TEST(FreeMotion, ArmTurnsThroughARingOfFramesToTheWallFromBothSides) {
  const SurfaceMesh arm = shapes::box({4, -0.5, -1}, {6, 0.5, 1});
  const auto turned = [](double angle) { return parts::placed(Vec3::Zero(), {0, 0, angle}, 1.0); };
  std::vector<SurfaceMesh> ring{turned(-30 * kDegree)(arm)};  // the wall is like the arm
  for (int i = 0; i < 11; ++i)
    ring.push_back(turned(30 * i * kDegree)(parts::tube({5, 0, 0}, Vec3::UnitY(), 1.8, 2.5, 0.4, 16)));
  const MotionBody moving{&arm};
  std::vector<MotionBody> fixed;
  for (const SurfaceMesh& body : ring) fixed.push_back({&body});
  const FreeMotion m = free_motion({&moving, 1}, fixed, kAboutZ);
  const double half = std::atan(0.5 / 4.0);  // the inner edges meet halfway
  EXPECT_NEAR(m.reachable.low, 2.0 * half - 30 * kDegree, kEnd);
  EXPECT_NEAR(m.reachable.high, 330 * kDegree - 2.0 * half, kEnd);
  EXPECT_EQ(m.low.body, 0);
  EXPECT_EQ(m.high.body, 0);
}

TEST(FreeMotion, WhatLiesFarBehindTheNearestBodiesIsNotToldAndChangesNothing) {
  const SurfaceMesh block = shapes::box({0, -1, -1}, {2, 1, 1});
  const MotionBody moving{&block};
  std::vector<SurfaceMesh> row;
  for (int i = 1; i <= 20; ++i) row.push_back(shapes::box({5.0 * i, -3, -3}, {5.0 * i + 1.0, 3, 3}));
  std::vector<MotionBody> fixed;
  for (const SurfaceMesh& body : row) fixed.push_back({&body});
  const FreeMotion all = free_motion({&moving, 1}, fixed, kAlongX);
  const FreeMotion few = free_motion({&moving, 1}, std::span(fixed).first(4), kAlongX);
  EXPECT_NEAR(all.reachable.high, 3.0, kEnd);
  EXPECT_EQ(all.reachable, few.reachable);
  ASSERT_EQ(all.others.size(), 3u);  // between the first four; behind the fourth others follow that nobody looked at
  EXPECT_EQ(few.others.size(), 4u);
  EXPECT_NEAR(all.others[2].low, 16.0, kEnd);
  EXPECT_NEAR(all.others[2].high, 18.0, kEnd);
}

TEST(FreeMotion, ThinWiresThatCrossAreNotMissed) {
  // Neither wire has a corner near the crossing: edge meets edge.
  const SurfaceMesh wire = shapes::box({0, -0.05, -0.05}, {20, 0.05, 0.05});
  const SurfaceMesh other = shapes::box({14 * std::cos(1.0) - 0.05, 14 * std::sin(1.0) - 0.05, -30},
                                        {14 * std::cos(1.0) + 0.05, 14 * std::sin(1.0) + 0.05, 30});
  const FreeMotion m = turn(wire, other, kAboutZ);
  EXPECT_NEAR(m.reachable.high, 1.0 - (0.05 + 0.05 * (std::cos(1.0) + std::sin(1.0))) / 14.0, 1e-3);
}

/// A prism over a regular polygon, anywhere.
SurfaceMesh random_prism(std::mt19937& generator) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto number = [&] { return unit(generator); };
  const int sides = 3 + static_cast<int>(3.0 * (number() + 1.0));
  const double radius = 0.1 + 0.1 * (number() + 1.0), half = 0.4 + 0.3 * (number() + 1.0);
  const double x = 0.7 * number(), y = 0.7 * number(), z = 0.4 * number();
  const Vec3 turned(2.0 * number(), 2.0 * number(), 2.0 * number());
  return parts::placed({x, y, z}, turned, 1.0)(parts::cylinder(Vec3::Zero(), Vec3::UnitZ(), radius, 2.0 * half, sides));
}

/// True if two convex bodies overlap: no normal, and no product of two edges, parts them.
bool convex_overlap(const SurfaceMesh& a, const SurfaceMesh& b) {
  std::vector<Vec3> edges[2], axes;
  for (const SurfaceMesh* body : {&a, &b})
    for (const Triangle& t : body->triangles) {
      const Vec3 &p = body->vertices[t[0]], &q = body->vertices[t[1]], &r = body->vertices[t[2]];
      axes.push_back((q - p).cross(r - p));
      for (const Vec3& e : {Vec3(q - p), Vec3(r - q), Vec3(p - r)}) edges[body == &b].push_back(e);
    }
  for (const Vec3& e : edges[0])
    for (const Vec3& f : edges[1]) axes.push_back(e.cross(f));
  return std::none_of(axes.begin(), axes.end(), [&](const Vec3& axis) {
    if (axis.norm() < 1e-9) return false;
    Interval of[2] = {{kInfinite, -kInfinite}, {kInfinite, -kInfinite}};
    for (const SurfaceMesh* body : {&a, &b})
      for (const Vec3& p : body->vertices) {
        Interval& i = of[body == &b];
        i = {std::min(i.low, axis.dot(p)), std::max(i.high, axis.dot(p))};
      }
    return of[0].high <= of[1].low || of[1].high <= of[0].low;
  });
}

TEST(FreeMotion, RandomPrismsStopWhereSeparatingAxesSayTheyOverlap) {
  std::mt19937 generator(7);
  int ends = 0;
  for (int pair = 0; pair < testing::all_or_tenth(60); ++pair) {
    const SurfaceMesh a = random_prism(generator), b = random_prism(generator);
    const auto overlap_at = [&](double t) { return convex_overlap(parts::placed(Vec3::Zero(), {0, 0, t}, 1.0)(a), b); };
    if (overlap_at(0.0)) continue;
    // Facets that other parts slide on do not matter to these, which do not touch.
    for (const double sagitta : {0.0, 0.01}) {
      const Interval free = turn(a, b, kAboutZ, sagitta).reachable;
      const bool open = free.open();
      const double low = open ? -kPi : free.low, high = open ? kPi : free.high;
      for (int i = 1; i < 50; ++i) EXPECT_FALSE(overlap_at(low + (high - low) * i / 50)) << pair;
      if (open) continue;
      const auto stops_within = [&](double end, double sense) {
        for (const double beyond : {1e-6, 1e-5, 1e-4, 1e-3})
          if (overlap_at(end + sense * beyond)) return true;
        return false;
      };
      EXPECT_TRUE(stops_within(high, 1.0)) << pair << ": " << high;
      EXPECT_TRUE(stops_within(low, -1.0)) << pair << ": " << low;
      ends += 2;
    }
  }
  EXPECT_GT(ends, testing::all_or_tenth(80));
}

TEST(FreeMotion, ScaleAndPlaceDoNotMatter) {
  const SurfaceMesh block = shapes::box({5, 5, -1}, {8, 9, 1});
  const double expected = std::atan2(5.0, 8.0) - std::asin(1.0 / std::sqrt(89.0));
  for (const double scale : {1e-3, 1.0, 1e3}) {
    const auto place = parts::placed({1.0, 2.0, 3.0}, Vec3(0.3, -1.1, 0.7), scale);
    const SurfaceMesh m = place(bar()), f = place(block);
    const MotionPath path{
        .kind = Kind::kRotation, .origin = place(Vec3::Zero()), .axis = place.direction(Vec3::UnitZ())};
    EXPECT_NEAR(turn(m, f, path).reachable.high, expected, kEnd) << scale;
    EXPECT_NEAR(turn(f, m, path).reachable.low, -expected, kEnd) << scale;
  }
}

TEST(FreeMotion, WrongArgumentsAreToldInOneLine) {
  const SurfaceMesh b = bar();
  const MotionBody body{&b, true};
  EXPECT_THROW(free_motion({}, {&body, 1}, kAboutZ), InvalidArgument);
  EXPECT_THROW(free_motion({&body, 1}, {&body, 1}, {.axis = {0, 0, 2}}), InvalidArgument);
  EXPECT_THROW(free_motion({&body, 1}, {&body, 1}, {.kind = Kind::kScrew}), InvalidArgument);
  EXPECT_THROW(free_motion({&body, 1}, {&body, 1}, kAboutZ, {.tolerance = -1.0}), InvalidArgument);
}

}  // namespace
}  // namespace limber
