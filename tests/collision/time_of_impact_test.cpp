#include "manifold/time_of_impact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include "asked.h"
#include "block_model.h"
#include "constants.h"
#include "counted_new.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "random_states.h"
#include "sample_models.h"
#include "sheet_model.h"
#include "tuning.h"

namespace limber {
namespace {

using internal::ImpactTime;
using internal::MovingBody;
using internal::TimeOfImpact;
using std::numbers::pi;
using Status = ImpactTime::Status;

using testing::all_or_tenth;
using testing::kFrame;
using testing::trials;

ImpactTime find(const MovingBody& a, const MovingBody& b, double step, double margin) {
  TimeOfImpact solver;
  const ImpactTime t = solver.find(a, b, step, margin), swapped = solver.find(b, a, step, margin);
  EXPECT_EQ(t.status, swapped.status);
  EXPECT_NEAR(t.time, swapped.time, 1e-12 + 1e-3 * margin);
  return t;
}

// What comes out lies between a gap of half the margin and the margin: over the closing speed, that is its error.
double time_error(double margin, double closing_speed) { return margin / closing_speed + 1e-14; }

TEST(TimeOfImpact, OfTwoBallsInFlightIsThatOfTheirWays) {
  const RigidGeometry a{Sphere{0.2}}, b{Sphere{0.3}};
  const MovingBody one{.geometry = &a, .pose = {.p = {3.0, 0.3, 0.0}}, .displacement = {-43.0, 1.0, 0.0}};
  const MovingBody other{.geometry = &b, .displacement = {-3.0, 1.0, 0.0}, .rotation = {10.0, 0.0, 0.0}};
  const double expected = (3.0 - std::sqrt(0.25 - 0.09)) / 40.0, margin = 1e-9;
  const ImpactTime t = find(one, other, 0.1, margin);
  EXPECT_EQ(t.status, Status::kImpact);
  EXPECT_NEAR(t.time, expected, time_error(margin, 40.0 * 0.8));
}

TEST(TimeOfImpact, OfASpinningRodAndAPostIsWhenItsFlankComesRound) {
  const double omega = 60.0, thick = 0.02, post = 0.01, at = 0.8, angle = 2.5, margin = 1e-9;
  const RigidGeometry rod{Box{{1.0, thick, 0.05}}}, round{Capsule{thick, 1.0}}, pole{Capsule{post, 0.5}};
  const Quaternion along_x = quaternion_from_rotation_vector({0.0, pi / 2, 0.0});
  const MovingBody standing{.geometry = &pole, .pose = {.p = {at * std::cos(angle), at * std::sin(angle), 0.0}}};
  const double expected = (angle - std::asin((thick + post) / at)) / omega;
  const double tolerance = time_error(margin, omega * at * std::cos(std::asin((thick + post) / at)));
  const Vec3 spin(0.0, 0.0, omega);
  const ImpactTime flat = find({.geometry = &rod, .rotation = spin}, standing, 0.1, margin);
  EXPECT_EQ(flat.status, Status::kImpact);
  EXPECT_NEAR(flat.time, expected, tolerance);
  const ImpactTime capsule =
      find({.geometry = &round, .pose = {.q = along_x}, .rotation = spin}, standing, 0.1, margin);
  EXPECT_EQ(capsule.status, Status::kImpact);
  EXPECT_NEAR(capsule.time, expected, tolerance);
}

TEST(TimeOfImpact, OfABendingBarAndABallIsWhenItsEndGetsThere) {
  const auto model = testing::block_model(3);
  const auto bar = std::make_shared<const CollisionSurface>(model);
  const double rate = 2.0, gap = 0.03, radius = 0.2, margin = 1e-9;
  // The mode goes down at the ends: the ball stands below one, midway between its corners.
  const double end = -static_cast<double>(model->collision().basis.shape(0, 0).y());
  ASSERT_GT(end, 0.0);
  const Vec3& corner = bar->rest(0);
  const std::vector<double> z(3, 0.0), rates{rate, 0.0, 0.0};
  const RigidGeometry ball{Sphere{radius}};
  const MovingBody below{.geometry = &ball, .pose = {.p = {corner.x(), corner.y() - radius - gap, corner.z()}}};
  ASSERT_LT(corner.y(), 0.0);
  const ImpactTime t = find({.surface = bar, .amplitudes = z, .rates = rates}, below, 0.1, margin);
  EXPECT_EQ(t.status, Status::kImpact);
  EXPECT_NEAR(t.time, gap / (end * rate), time_error(margin, end * rate));
  EXPECT_EQ(find({.surface = bar, .amplitudes = z, .rates = rates}, below, 0.9 * t.time, margin).status, Status::kNone);
}

// -- Against sampling -------------------------------------------------------------------------------------------------

RigidTransform pose_at(const MovingBody& body, double t) {
  return {quaternion_from_rotation_vector(t * body.rotation) * body.pose.q, body.pose.p + t * body.displacement};
}

std::vector<double> amplitudes_at(const MovingBody& body, double t) {
  std::vector<double> z(body.amplitudes.begin(), body.amplitudes.end());
  for (std::size_t m = 0; m < body.rates.size(); ++m) z[m] += t * body.rates[m];
  return z;
}

std::vector<TrianglePoints> triangles_at(const MovingBody& body, double t) {
  const CollisionSurface& surface = body.surface ? *body.surface : *body.geometry->surface();
  const RigidTransform pose = pose_at(body, t);
  const std::vector<double> z = amplitudes_at(body, t);
  std::vector<TrianglePoints> out;
  for (Index i = 0; i < surface.triangles(); ++i) {
    TrianglePoints points;
    for (std::size_t c = 0; c < 3; ++c) {
      const Index v = surface.triangle(i)[c];
      Vec3 p = surface.rest(v);
      for (int axis = 0; axis < 3; ++axis)
        for (std::size_t m = 0; m < z.size(); ++m) p[axis] += static_cast<double>(surface.row(v, axis)[m]) * z[m];
      points[c] = pose * p;
    }
    out.push_back(points);
  }
  return out;
}

double distance_at(const MovingBody& a, const MovingBody& b, double t) {
  double least = std::numeric_limits<double>::infinity();
  const auto ours = triangles_at(a, t), theirs = triangles_at(b, t);
  for (const TrianglePoints& x : ours)
    for (const TrianglePoints& y : theirs) {
      const Vec3 low = x[0].cwiseMin(x[1]).cwiseMin(x[2]) - y[0].cwiseMax(y[1]).cwiseMax(y[2]);
      const Vec3 high = y[0].cwiseMin(y[1]).cwiseMin(y[2]) - x[0].cwiseMax(x[1]).cwiseMax(x[2]);
      if (std::max(low.maxCoeff(), high.maxCoeff()) < least) least = std::min(least, closest_points(x, y).distance);
    }
  return least;
}

/// No sample before the answer is nearer than half the margin; at an impact the gap is between that and the margin.
void expect_right(const ImpactTime& t, const MovingBody& a, const MovingBody& b, double step, double margin,
                  int samples, int n) {
  constexpr double kSlack = 1e-12;  // of positions of size 1
  for (int i = 0; i < samples; ++i)
    if (const double time = step * i / samples; time < t.time) {
      ASSERT_GE(distance_at(a, b, time), 0.5 * margin - kSlack) << "pair " << n << " at " << time << " of " << t.time;
    }
  if (t.status != Status::kImpact) return;
  const double gap = distance_at(a, b, t.time);
  ASSERT_LE(gap, margin + kSlack) << n;
  ASSERT_GE(gap, 0.5 * margin - kSlack) << n;
}

struct Tumbling {
  Tumbling(const std::shared_ptr<const ModalModel>& model, std::mt19937& random, const Vec3& place,
           const Vec3& velocity, double flexing)
      : surface(std::make_shared<const CollisionSurface>(model)), way(velocity) {
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
    pose = {quaternion_from_rotation_vector(3.0 * vector()), place};
    rotation = 15.0 * vector();
    for (const double lambda : model->data().eigenvalues) {
      z.push_back(flexing * unit(random));
      rates.push_back(flexing * unit(random) * std::sqrt(lambda));
    }
  }
  MovingBody body() const {
    return {
        .surface = surface, .pose = pose, .displacement = way, .rotation = rotation, .amplitudes = z, .rates = rates};
  }
  std::shared_ptr<const CollisionSurface> surface;
  RigidTransform pose;
  Vec3 way, rotation;
  std::vector<double> z, rates;
};

TEST(TimeOfImpact, OfTumblingFlexingBodiesIsRightAmongFineSamples) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  const auto box = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  const auto block = testing::block_model(4);
  TimeOfImpact solver;
  int impacts = 0, misses = 0, most = 0, resting = 0;
  for (int n = 0; n < all_or_tenth(80); ++n) {
    const double step = n % 3 == 0 ? 0.1 : 0.05, margin = n % 2 == 0 ? 1e-3 : 1e-5;
    const Vec3 place = Vec3(2.2, 0.0, 0.0) + 0.5 * vector(), velocity = -30.0 * (place + 2.5 * vector());
    const Tumbling a(box, random, place, velocity, 0.02), b(block, random, Vec3::Zero(), vector(), 0.05);
    const ImpactTime t = solver.find(a.body(), b.body(), step, margin);
    most = std::max(most, t.advancements);
    (t.status == Status::kImpact ? impacts : misses) += 1;
    resting += t.status == Status::kResting ? 1 : 0;
    expect_right(t, a.body(), b.body(), step, margin, 60, n);
  }
  EXPECT_GT(impacts, all_or_tenth(20));
  EXPECT_GT(misses, all_or_tenth(10));
  EXPECT_EQ(resting, 0);
  EXPECT_LE(most, 64);
}

TEST(TimeOfImpact, OfHugeAmplitudesIsRightToo) {
  std::mt19937 random(9);
  const auto box = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  TimeOfImpact solver;
  int impacts = 0;
  for (int n = 0; n < 12; ++n) {
    const double flexing = std::pow(10.0, n % 6 - 1);  // shapes turned inside out, up to thousands of times their size
    const Vec3 place(10.0 * flexing + 2.0, 0.0, 0.0);
    const Tumbling a(box, random, place, -12.0 * place, flexing);
    const Tumbling b(box, random, Vec3::Zero(), Vec3::Zero(), flexing);
    const double margin = 1e-4 * flexing;
    const ImpactTime t = solver.find(a.body(), b.body(), 0.1, margin);
    impacts += t.status == Status::kImpact ? 1 : 0;
    if (t.status == Status::kImpact) {
      const double gap = distance_at(a.body(), b.body(), t.time);
      EXPECT_LE(gap, margin * (1.0 + 1e-6));
      EXPECT_GE(gap, 0.5 * margin * (1.0 - 1e-6));
    }
    const int samples = all_or_tenth(200);
    for (int i = 0; i < samples; ++i) EXPECT_GT(distance_at(a.body(), b.body(), t.time * i / samples), 0.49 * margin);
  }
  EXPECT_GT(impacts, 4);
}

// -- Tunnelling -------------------------------------------------------------------------------------------------------

constexpr int kCells = 12;
constexpr double kSheet = testing::kSheetSide;

/// Height of a point of the sheet's frame above its bent middle; none beside it. The sheet's own triangles.
std::optional<double> height_above_sheet(const CollisionSurface& sheet, const Vec3& p_B, std::span<const double> z) {
  const double x = (p_B.x() / kSheet + 0.5) * kCells, y = (p_B.y() / kSheet + 0.5) * kCells;
  const int i = static_cast<int>(std::floor(x)), j = static_cast<int>(std::floor(y));
  if (i < 0 || j < 0 || i >= kCells || j >= kCells) return std::nullopt;
  const auto bent = [&](int a, int b) {
    const Index v = Index(b * (kCells + 1) + a);  // of the lower side: flexes as the upper one does
    double w = 0.0;
    for (std::size_t m = 0; m < z.size(); ++m) w += static_cast<double>(sheet.row(v, 2)[m]) * z[m];
    return w;
  };
  const double s = x - i, t = y - j, w00 = bent(i, j), w11 = bent(i + 1, j + 1);
  const double w = s > t ? w00 + s * (bent(i + 1, j) - w00) + t * (w11 - bent(i + 1, j))
                         : w00 + t * (bent(i, j + 1) - w00) + s * (w11 - bent(i, j + 1));
  return p_B.z() - w;
}

/// When the shot's centre first passes through the sheet's middle; by sampling and bisection.
std::optional<double> crossing(const MovingBody& sheet, const MovingBody& shot, double step) {
  const auto height = [&](double t) {
    return height_above_sheet(*sheet.surface, pose_at(sheet, t).inverse() * pose_at(shot, t).p,
                              amplitudes_at(sheet, t));
  };
  constexpr int kSamples = 150;
  std::optional<double> before = height(0.0);
  for (int i = 1; i <= kSamples; ++i) {
    double low = step * (i - 1) / kSamples, high = step * i / kSamples;
    const std::optional<double> after = height(high);
    if (before && after && (*before > 0.0) != (*after > 0.0)) {
      for (int bisection = 0; bisection < 40; ++bisection) {
        const double middle = 0.5 * (low + high);
        ((*height(middle) > 0.0) == (*before > 0.0) ? low : high) = middle;
      }
      return high;
    }
    before = after;
  }
  return std::nullopt;
}

TEST(TimeOfImpact, NoShotPassesThroughASheetOfOneMillimetre) {
  const int shots = trials(1000);
  const auto model = testing::sheet_model(kCells, 4);
  const auto surface = std::make_shared<const CollisionSurface>(model);
  const RigidGeometry ball{Sphere{0.004}}, cube{Box{{0.003, 0.002, 0.004}}};
  const double margin = 1e-4;
  std::mt19937 random(17);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  TimeOfImpact solver;
  int crossings = 0, tunnelled = 0, late = 0, resting = 0, most = 0;
  for (int n = 0; n < shots; ++n) {
    const double speed = 500.0 * std::pow(std::abs(unit(random)), 0.5);
    const Vec3 way = vector().normalized(), target = 0.6 * kSheet * Vec3(unit(random), unit(random), 0.0);
    const RigidTransform X_WS{quaternion_from_rotation_vector(2.0 * vector()), vector()};
    std::vector<double> z(4), rates(4);
    for (std::size_t i = 0; i < 4; ++i) z[i] = 0.02 * unit(random), rates[i] = 4.0 * unit(random);
    const MovingBody sheet{.surface = surface,
                           .pose = X_WS,
                           .displacement = 3.0 * vector(),
                           .rotation = 6.0 * vector(),
                           .amplitudes = z,
                           .rates = rates};
    const double lead = kFrame * std::abs(unit(random));
    const MovingBody bullet{
        .geometry = n % 2 == 0 ? &ball : &cube,
        .pose = {quaternion_from_rotation_vector(vector()), X_WS * Vec3(target - lead * speed * way)},
        .displacement = X_WS.q * Vec3(speed * way),
        .rotation = 100.0 * vector()};
    const ImpactTime t = solver.find(bullet, sheet, kFrame, margin);
    most = std::max(most, t.advancements);
    resting += t.status == Status::kResting ? 1 : 0;
    ASSERT_GE(t.time, 0.0);
    const std::optional<double> through = crossing(sheet, bullet, kFrame);
    if (!through) continue;
    ++crossings;
    tunnelled += t.status == Status::kNone ? 1 : 0;
    late += t.status != Status::kNone && t.time > *through + 1e-12 ? 1 : 0;
  }
  EXPECT_EQ(tunnelled, 0);
  EXPECT_EQ(late, 0);
  EXPECT_EQ(resting, 0);
  EXPECT_GT(crossings, shots / 2);
  EXPECT_LE(most, 80);  // far from the limit
}

// -- Grazing, resting, far away ---------------------------------------------------------------------------------------

TEST(TimeOfImpact, OfAGrazeIsToldWithinHalfAMarginAndOnlyThere) {
  const RigidGeometry a{Sphere{0.5}}, b{Sphere{0.5}};
  const double margin = 1e-4;
  for (const double beside : {0.2 * margin, 0.45 * margin, 1.01 * margin, 2.0 * margin, 1e-2}) {
    const MovingBody passing{
        .geometry = &a, .pose = {.p = {-3.0, 1.0 + beside, 0.0}}, .displacement = {300.0, 0.0, 0.0}};
    const ImpactTime t = find(passing, {.geometry = &b}, kFrame, margin);
    EXPECT_EQ(t.status, beside < 0.5 * margin ? Status::kImpact : Status::kNone) << beside;
    EXPECT_LE(t.advancements, 40);
  }
}

TEST(TimeOfImpact, StartsInTouchAreForTheContacts) {
  const RigidGeometry ball{Sphere{0.1}}, cube{Box{{0.1, 0.1, 0.1}}};
  const RigidGeometry floor{TriangleMesh{{{-9.0, -9.0, 0.0}, {9.0, -9.0, 0.0}, {0.0, 9.0, 0.0}}, {{0, 1, 2}}}};
  for (const RigidGeometry* shape : {&ball, &cube})
    for (const double up : {0.0, 5.0}) {
      const ImpactTime t =
          find({.geometry = shape, .pose = {.p = {0.0, 0.0, 0.1 + 5e-5}}, .displacement = {0.0, 0.0, up}},
               {.geometry = &floor}, kFrame, 1e-4);
      EXPECT_EQ(t.status, Status::kTouching);
      EXPECT_EQ(t.time, 0.0);
    }
  EXPECT_EQ(find({.geometry = &ball, .pose = {.p = {0.0, 0.0, 0.05}}}, {.geometry = &floor}, kFrame, 0.0).status,
            Status::kTouching);
}

/// A ball that slides along a wall, within the margin of it or just beyond, to another one.
TEST(TimeOfImpact, BodiesThatTouchFromTheStartAreSeenToComeNearerElsewhere) {
  constexpr double kRadius = 0.1, kNear = 1e-3, kSpeed = 5.0, kAway = 0.05;
  const RigidGeometry ball{Sphere{kRadius}};
  const RigidGeometry walls{TriangleMesh{
      {{0.0, -1.0, -1.0}, {0.0, 1.0, -1.0}, {0.0, -1.0, 1.0}, {0.0, 1.0, 1.0}, {1.0, -1.0, -1.0}, {1.0, 1.0, -1.0}},
      {{0, 1, 3}, {0, 3, 2}, {0, 4, 5}, {0, 5, 1}}}};
  const MovingBody moving{.geometry = &ball,
                          .pose = {.p = {kRadius + kNear, 0.0, -1.0 + kRadius + kAway}},
                          .displacement = {0.0, 0.0, -kSpeed}},
      still{.geometry = &walls};
  TimeOfImpact solver;
  for (const double gap : {1.2, 1.0 + 1e-12, 0.9, 0.3}) {  // of the margin, to the wall that it slides along
    const double margin = kNear / gap;
    const ImpactTime t = solver.find(moving, still, kFrame, margin, 1e-3 * margin);
    EXPECT_EQ(t.status, Status::kImpact) << gap;
    EXPECT_LE(t.time, kAway / kSpeed) << gap;
    EXPECT_GE(t.time, (kAway - margin) / kSpeed) << gap;
    EXPECT_LT(t.advancements, 10) << gap;
  }
  EXPECT_EQ(solver.find(moving, still, kFrame, 2.0 * kNear).status, Status::kTouching);
}

TEST(TimeOfImpact, WhatStandsStillNeverMeets) {
  const RigidGeometry ball{Sphere{0.1}};
  const ImpactTime t = find({.geometry = &ball, .pose = {.p = {0.0, 0.0, 0.3}}}, {.geometry = &ball}, kFrame, 0.0);
  EXPECT_EQ(t.status, Status::kNone);
  EXPECT_EQ(t.time, kFrame);
  EXPECT_EQ(t.advancements, 1);
}

// A body that slides along the ground ever so little above it: no end of advancements without their limit.
TEST(TimeOfImpact, EndsAtRestWhereAdvancementsDoNot) {
  const RigidGeometry cylinder{Capsule{0.1, 0.3}}, cube{Box{{0.1, 0.1, 0.1}}};
  const RigidGeometry floor{TriangleMesh{{{-9.0, -9.0, 0.0}, {9.0, -9.0, 0.0}, {0.0, 9.0, 0.0}}, {{0, 1, 2}}}};
  const double margin = 1e-9;
  const RigidTransform above{quaternion_from_rotation_vector({0.0, pi / 2, 0.0}), {0.0, 0.0, 0.1 + 1.001 * margin}};
  const Vec3 sliding(20.0, 5.0, 0.0);
  const ImpactTime flat =
      find({.geometry = &cylinder, .pose = above, .displacement = sliding}, {.geometry = &floor}, kFrame, margin);
  EXPECT_EQ(flat.status, Status::kNone);
  const ImpactTime rolled =
      find({.geometry = &cube, .pose = above, .displacement = sliding, .rotation = {0.0, 0.0, 40.0}},
           {.geometry = &floor}, kFrame, margin);
  EXPECT_EQ(rolled.status, Status::kResting);
  EXPECT_EQ(rolled.advancements, internal::collision_tuning().impact.most_advancements);
  EXPECT_LT(rolled.time, kFrame);
}

TEST(TimeOfImpact, AMillionMetresAwayIsTheSameToTheRoundOffOfPoses) {
  const RigidGeometry ball{Sphere{0.1}}, cube{Box{{0.2, 0.2, 0.2}}};
  const Vec3 far(1e6, -1e6, 5e5);
  for (const Vec3& origin : {Vec3(0.0, 0.0, 0.0), far}) {
    const MovingBody flight{
        .geometry = &ball, .pose = {.p = origin + Vec3(0.05, 0.0, 1.0)}, .displacement = {0.0, 0.0, -70.0}};
    const ImpactTime t = find(flight, {.geometry = &cube, .pose = {.p = origin}}, kFrame, 0.0);
    EXPECT_EQ(t.status, Status::kImpact);
    // A margin of zero is raised to 32 ε of both bodies' coordinates.
    const double raised = 32.0 * std::numeric_limits<double>::epsilon() * (2.0 * origin.norm() + 10.0);
    EXPECT_NEAR(t.time, 0.7 / 70.0, 1.1 * raised / 70.0);
  }
}

// -- Promises ---------------------------------------------------------------------------------------------------------

TEST(TimeOfImpact, WarmItAllocatesNothingAndRepeatsItsBits) {
  std::mt19937 random(3);
  const auto box = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  const Tumbling a(box, random, {1.2, 0.1, 0.0}, {-80.0, 0.0, 0.0}, 0.02);
  const Tumbling b(box, random, Vec3::Zero(), Vec3::Zero(), 0.02);
  const RigidGeometry ball{Sphere{0.1}};
  const MovingBody one = a.body(), other = b.body();
  TimeOfImpact solver;
  const ImpactTime first = solver.find(one, other, kFrame, 1e-4);
  solver.find(one, {.geometry = &ball}, kFrame, 1e-4);
  const long before = testing::allocations();
  const ImpactTime again = solver.find(one, other, kFrame, 1e-4);
  solver.find(one, {.geometry = &ball}, kFrame, 1e-4);
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_EQ(first.status, Status::kImpact);
  EXPECT_EQ(again.time, first.time);
  EXPECT_EQ(TimeOfImpact().find(one, other, kFrame, 1e-4).time, first.time);
}

}  // namespace
}  // namespace limber
