#include "limber/collision/time_of_impact.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <random>

#include "block_model.h"
#include "constants.h"
#include "counted_new.h"
#include "limber/collision/closest_features.h"
#include "limber/collision/collision_surface.h"
#include "limber/collision/deformed_surface.h"
#include "limber/collision/narrow_phase.h"
#include "limber/core/error.h"
#include "limber/dynamics/body_group.h"
#include "random_states.h"
#include "sample_models.h"
#include "sheet_model.h"

namespace limber {
namespace {

using std::numbers::pi;
using Status = ImpactTime::Status;

using testing::kDown;
using testing::kFrame;
using testing::trials;

ExactMotion mover(const RigidMotion& motion, double step) {
  ExactMotion m;
  m.set_frame(motion, step);
  return m;
}

ImpactTime find(const MovingBody& a, const MovingBody& b, double step, double margin) {
  TimeOfImpact solver;
  const ImpactTime t = solver.find(a, b, step, margin), swapped = solver.find(b, a, step, margin);
  EXPECT_EQ(t.status, swapped.status);
  EXPECT_NEAR(t.time, swapped.time, 1e-12 + 1e-3 * margin);
  return t;
}

// What comes out lies between a gap of half the margin and the margin: over the closing speed, that is its error.
double time_error(double margin, double closing_speed) { return margin / closing_speed + 1e-14; }

TEST(TimeOfImpact, OfABallThatFallsOnAPlaneIsThatOfFreeFall) {
  const RigidGeometry ball{Sphere{0.1}}, ground{HalfSpace{}};
  const ExactMotion fall =
      mover({.pose = {.p = {0.3, 0.2, 2.0}}, .velocity = {5.0, 0.0, 0.0}, .acceleration = kDown}, 1.0);
  const double expected = std::sqrt(2.0 * 1.9 / 9.80665), margin = 1e-10;
  const ImpactTime t = find({.geometry = &ball, .motion = &fall}, {.geometry = &ground}, 1.0, margin);
  EXPECT_EQ(t.status, Status::kImpact);
  EXPECT_NEAR(t.time, expected, 1e-10);
  EXPECT_LE(t.advancements, 4);  // the bound of second order is the motion itself
}

TEST(TimeOfImpact, OfTwoBallsInFlightTakesNoHeedOfTheGravityOfBoth) {
  const RigidGeometry a{Sphere{0.2}}, b{Sphere{0.3}};
  const Vec3 apart(3.0, 0.3, 0.0), closing(-40.0, 0.0, 0.0);
  const ExactMotion one = mover({.pose = {.p = apart}, .velocity = closing, .acceleration = kDown}, 0.1);
  const ExactMotion other = mover({.acceleration = kDown, .angular_velocity = {10.0, 0.0, 0.0}}, 0.1);
  const double expected = (3.0 - std::sqrt(0.25 - 0.09)) / 40.0, margin = 1e-9;
  const ImpactTime t = find({.geometry = &a, .motion = &one}, {.geometry = &b, .motion = &other}, 0.1, margin);
  EXPECT_EQ(t.status, Status::kImpact);
  EXPECT_NEAR(t.time, expected, time_error(margin, 40.0 * 0.8));
}

TEST(TimeOfImpact, OfASpinningRodAndAPostIsWhenItsFlankComesRound) {
  const double omega = 60.0, thick = 0.02, post = 0.01, at = 0.8, angle = 2.5, margin = 1e-9;
  const RigidGeometry rod{Box{{1.0, thick, 0.05}}}, round{Capsule{thick, 1.0}}, pole{Capsule{post, 0.5}};
  const RigidTransform along_x{quaternion_from_rotation_vector({0.0, pi / 2, 0.0}), Vec3::Zero()};
  const MovingBody standing{.geometry = &pole, .pose = {.p = {at * std::cos(angle), at * std::sin(angle), 0.0}}};
  const double expected = (angle - std::asin((thick + post) / at)) / omega;
  const double tolerance = time_error(margin, omega * at * std::cos(std::asin((thick + post) / at)));
  const ExactMotion spin = mover({.angular_velocity = {0.0, 0.0, omega}}, 0.1);
  const ImpactTime flat = find({.geometry = &rod, .motion = &spin}, standing, 0.1, margin);
  EXPECT_EQ(flat.status, Status::kImpact);
  EXPECT_NEAR(flat.time, expected, tolerance);
  const ExactMotion rolled = mover({.pose = along_x, .angular_velocity = {0.0, 0.0, omega}}, 0.1);
  const ImpactTime capsule = find({.geometry = &round, .motion = &rolled}, standing, 0.1, margin);
  EXPECT_EQ(capsule.status, Status::kImpact);
  EXPECT_NEAR(capsule.time, expected, tolerance);
}

/// A vibrating body at rest, without damping.
struct Vibrating {
  Vibrating(const std::shared_ptr<const ModalModel>& model, std::span<const double> z, std::span<const double> rates,
            double step)
      : surface(std::make_shared<const CollisionSurface>(model)) {
    motion.set_frame({}, step);
    motion.set_modes(model->data().eigenvalues, model->data().decays, z, rates);
  }
  MovingBody body() const { return {.surface = surface, .motion = &motion}; }
  std::shared_ptr<const CollisionSurface> surface;
  ExactMotion motion;
};

TEST(TimeOfImpact, OfAVibratingBarAndAWallIsThePhaseAtWhichItsEndGetsThere) {
  ModalModelData data = testing::block_data(3);
  data.decays.assign(3, 0.0);
  const double omega = std::sqrt(data.eigenvalues[0]);
  const auto model = std::make_shared<const ModalModel>(std::move(data));
  const double rate = 2.0, gap = 0.03, margin = 1e-9;
  const double end = -static_cast<double>(model->collision().basis.shape(0, 0).y());  // down where the mode goes up
  ASSERT_GT(end * rate / omega, gap);
  const std::vector<double> z(3, 0.0), rates{-rate, 0.0, 0.0};
  const Vibrating bar(model, z, rates, 0.1);
  const RigidGeometry wall{HalfSpace{{0.0, -1.0, 0.0}, -(0.5 + gap)}};
  const double phase = std::asin(gap * omega / (end * rate));
  // w = √(2/m) cos(2πx/L): its ends go by −1 of that, upwards, as the middle goes down.
  const ImpactTime t = find(bar.body(), {.geometry = &wall}, 0.1, margin);
  EXPECT_EQ(t.status, Status::kImpact);
  EXPECT_NEAR(t.time, phase / omega, time_error(margin, end * rate * std::cos(phase)));
  const RigidGeometry farther{HalfSpace{{0.0, -1.0, 0.0}, -(0.5 + 1.01 * end * rate / omega)}};
  EXPECT_EQ(find(bar.body(), {.geometry = &farther}, 0.1, margin).status, Status::kNone);
}

// -- Against sampling -------------------------------------------------------------------------------------------------

std::vector<TrianglePoints> triangles_at(const MovingBody& body, double t) {
  const CollisionSurface& surface = body.surface ? *body.surface : *body.geometry->surface();
  MotionState s;
  s.pose = body.pose;
  if (body.motion) body.motion->evaluate(t, s);
  std::vector<TrianglePoints> out;
  for (Index i = 0; i < surface.triangles(); ++i) {
    TrianglePoints points;
    for (std::size_t c = 0; c < 3; ++c) {
      const Index v = surface.triangle(i)[c];
      Vec3 p = surface.rest(v);
      for (int axis = 0; axis < 3; ++axis)
        for (std::size_t m = 0; m < s.amplitudes.size(); ++m)
          p[axis] += static_cast<double>(surface.row(v, axis)[m]) * s.amplitudes[m];
      points[c] = s.pose * p;
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
  Tumbling(const std::shared_ptr<const ModalModel>& model, double step, std::mt19937& random, const Vec3& place,
           const Vec3& velocity, double flexing)
      : group(model, step), surface(std::make_shared<const CollisionSurface>(model)) {
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
    const Index slot = group.add({quaternion_from_rotation_vector(3.0 * vector()), place}, velocity, 15.0 * vector());
    std::vector<double> z, rates;
    for (Index i = 0; i < model->modes(); ++i) {
      z.push_back(flexing * unit(random));
      rates.push_back(flexing * unit(random) * std::sqrt(model->data().eigenvalues[static_cast<std::size_t>(i)]));
    }
    group.set_amplitudes(slot, z, rates);
    group.predict_motion(slot, kDown, motion);
  }
  MovingBody body() const { return {.surface = surface, .motion = &motion}; }
  BodyGroup group;
  std::shared_ptr<const CollisionSurface> surface;
  ExactMotion motion;
};

TEST(TimeOfImpact, OfTumblingFlexingBodiesIsRightAmongFineSamples) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  const auto box = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  const auto block = testing::block_model(4);
  TimeOfImpact solver;
  int impacts = 0, misses = 0, most = 0, resting = 0;
  for (int n = 0; n < 80; ++n) {
    const double step = n % 3 == 0 ? 0.1 : 0.05, margin = n % 2 == 0 ? 1e-3 : 1e-5;
    const Vec3 place = Vec3(2.2, 0.0, 0.0) + 0.5 * vector(), velocity = -30.0 * (place + 2.5 * vector());
    const Tumbling a(box, step, random, place, velocity, 0.02), b(block, step, random, Vec3::Zero(), vector(), 0.05);
    const ImpactTime t = solver.find(a.body(), b.body(), step, margin);
    most = std::max(most, t.advancements);
    (t.status == Status::kImpact ? impacts : misses) += 1;
    resting += t.status == Status::kResting ? 1 : 0;
    expect_right(t, a.body(), b.body(), step, margin, 60, n);
  }
  EXPECT_GT(impacts, 20);
  EXPECT_GT(misses, 10);
  EXPECT_EQ(resting, 0);
  EXPECT_LE(most, 64);
}

TEST(TimeOfImpact, OfHugeAmplitudesIsRightToo) {
  std::mt19937 random(9);
  const auto box = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  TimeOfImpact solver;
  for (int n = 0; n < 6; ++n) {
    const double flexing = std::pow(10.0, n - 1);  // shapes turned inside out, up to thousands of times their size
    const Vec3 place(10.0 * flexing + 2.0, 0.0, 0.0);
    const Tumbling a(box, 0.1, random, place, -12.0 * place, flexing);
    const Tumbling b(box, 0.1, random, Vec3::Zero(), Vec3::Zero(), flexing);
    const double margin = 1e-4 * flexing;
    const ImpactTime t = solver.find(a.body(), b.body(), 0.1, margin);
    EXPECT_EQ(t.status, Status::kImpact);
    const double gap = distance_at(a.body(), b.body(), t.time);
    EXPECT_LE(gap, margin * (1.0 + 1e-6));
    EXPECT_GE(gap, 0.5 * margin * (1.0 - 1e-6));
    for (int i = 0; i < 200; ++i)
      if (const double time = t.time * i / 200; true) {
        EXPECT_GT(distance_at(a.body(), b.body(), time), 0.49 * margin);
      }
  }
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
std::optional<double> crossing(const CollisionSurface& sheet, const ExactMotion& sheet_motion, const ExactMotion& shot,
                               double step) {
  MotionState s;
  RigidTransform pose;
  const auto height = [&](double t) {
    sheet_motion.evaluate(t, s);
    shot.at(t, pose, {});
    return height_above_sheet(sheet, s.pose.inverse() * pose.p, s.amplitudes);
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
  BodyGroup group(model, kFrame);
  const Index slot = group.add({}, Vec3::Zero(), Vec3::Zero());
  ExactMotion sheet, shot;
  int crossings = 0, tunnelled = 0, late = 0, resting = 0, most = 0;
  for (int n = 0; n < shots; ++n) {
    const double speed = 500.0 * std::pow(std::abs(unit(random)), 0.5);
    const Vec3 way = vector().normalized(), target = 0.6 * kSheet * Vec3(unit(random), unit(random), 0.0);
    const RigidTransform X_WS{quaternion_from_rotation_vector(2.0 * vector()), vector()};
    group.set_pose(slot, X_WS);
    group.set_velocity(slot, 3.0 * vector(), 6.0 * vector());
    std::vector<double> z(4), rates(4);
    for (std::size_t i = 0; i < 4; ++i) z[i] = 0.02 * unit(random), rates[i] = 4.0 * unit(random);
    group.set_amplitudes(slot, z, rates);
    group.predict_motion(slot, kDown, sheet);
    const double lead = kFrame * std::abs(unit(random));
    shot.set_frame({.pose = {quaternion_from_rotation_vector(vector()), X_WS * Vec3(target - lead * speed * way)},
                    .velocity = X_WS.q * Vec3(speed * way),
                    .acceleration = kDown,
                    .angular_velocity = 100.0 * vector()},
                   kFrame);
    const MovingBody bullet{.geometry = n % 2 == 0 ? &ball : &cube, .motion = &shot};
    const ImpactTime t = solver.find(bullet, {.surface = surface, .motion = &sheet}, kFrame, margin);
    most = std::max(most, t.advancements);
    resting += t.status == Status::kResting ? 1 : 0;
    ASSERT_GE(t.time, 0.0);
    const std::optional<double> through = crossing(*surface, sheet, shot, kFrame);
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
    const ExactMotion pass = mover({.pose = {.p = {-3.0, 1.0 + beside, 0.0}}, .velocity = {300.0, 0.0, 0.0}}, kFrame);
    const ImpactTime t = find({.geometry = &a, .motion = &pass}, {.geometry = &b}, kFrame, margin);
    EXPECT_EQ(t.status, beside < 0.5 * margin ? Status::kImpact : Status::kNone) << beside;
    EXPECT_LE(t.advancements, 40);
  }
}

TEST(TimeOfImpact, StartsInTouchAreForTheContacts) {
  const RigidGeometry ball{Sphere{0.1}}, ground{HalfSpace{}}, cube{Box{{0.1, 0.1, 0.1}}};
  const ExactMotion falling = mover({.pose = {.p = {0.0, 0.0, 0.1 + 5e-5}}, .acceleration = kDown}, kFrame);
  const ExactMotion leaving =
      mover({.pose = {.p = {0.0, 0.0, 0.1 + 5e-5}}, .velocity = {0.0, 0.0, 5.0}, .acceleration = kDown}, kFrame);
  for (const RigidGeometry* shape : {&ball, &cube})
    for (const ExactMotion* motion : {&falling, &leaving}) {
      const ImpactTime t = find({.geometry = shape, .motion = motion}, {.geometry = &ground}, kFrame, 1e-4);
      EXPECT_EQ(t.status, Status::kTouching);
      EXPECT_EQ(t.time, 0.0);
    }
  const ExactMotion inside = mover({.pose = {.p = {0.0, 0.0, -0.05}}}, kFrame);
  EXPECT_EQ(find({.geometry = &ball, .motion = &inside}, {.geometry = &ground}, kFrame, 0.0).status, Status::kTouching);
}

/// A ball that slides along a wall, within the margin of it or just beyond, to another one.
TEST(TimeOfImpact, BodiesThatTouchFromTheStartAreSeenToComeNearerElsewhere) {
  constexpr double kRadius = 0.1, kNear = 1e-3, kSpeed = 5.0, kAway = 0.05;
  const RigidGeometry ball{Sphere{kRadius}};
  const RigidGeometry walls{TriangleMesh{
      {{0.0, -1.0, -1.0}, {0.0, 1.0, -1.0}, {0.0, -1.0, 1.0}, {0.0, 1.0, 1.0}, {1.0, -1.0, -1.0}, {1.0, 1.0, -1.0}},
      {{0, 1, 3}, {0, 3, 2}, {0, 4, 5}, {0, 5, 1}}}};
  const ExactMotion slides =
      mover({.pose = {.p = {kRadius + kNear, 0.0, -1.0 + kRadius + kAway}}, .velocity = {0.0, 0.0, -kSpeed}}, kFrame);
  const MovingBody moving{.geometry = &ball, .motion = &slides}, still{.geometry = &walls};
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
  const RigidGeometry ball{Sphere{0.1}}, ground{HalfSpace{}};
  const ImpactTime t = find({.geometry = &ball, .pose = {.p = {0.0, 0.0, 0.2}}}, {.geometry = &ground}, kFrame, 0.0);
  EXPECT_EQ(t.status, Status::kNone);
  EXPECT_EQ(t.time, kFrame);
  EXPECT_EQ(t.advancements, 1);
  EXPECT_EQ(find({.geometry = &ground}, {.geometry = &ground}, kFrame, 0.0).status, Status::kNone);
}

// A body that slides along the ground ever so little above it: no end of advancements without their limit.
TEST(TimeOfImpact, EndsAtRestWhereAdvancementsDoNot) {
  const RigidGeometry cylinder{Capsule{0.1, 0.3}}, cube{Box{{0.1, 0.1, 0.1}}}, ground{HalfSpace{}};
  const double margin = 1e-9;
  const RigidTransform above{quaternion_from_rotation_vector({0.0, pi / 2, 0.0}), {0.0, 0.0, 0.1 + 1.001 * margin}};
  const ExactMotion sliding = mover({.pose = above, .velocity = {20.0, 5.0, 0.0}}, kFrame);
  const ImpactTime flat = find({.geometry = &cylinder, .motion = &sliding}, {.geometry = &ground}, kFrame, margin);
  EXPECT_EQ(flat.status, Status::kNone);
  const ExactMotion rolling =
      mover({.pose = above, .velocity = {20.0, 5.0, 0.0}, .angular_velocity = {0.0, 0.0, 40.0}}, kFrame);
  const ImpactTime rolled = find({.geometry = &cube, .motion = &rolling}, {.geometry = &ground}, kFrame, margin);
  EXPECT_EQ(rolled.status, Status::kResting);
  EXPECT_EQ(rolled.advancements, TimeOfImpactOptions{}.max_advancements);
  EXPECT_LT(rolled.time, kFrame);
  TimeOfImpact impatient({.max_advancements = 3});
  EXPECT_LE(impatient.find({.geometry = &cube, .motion = &rolling}, {.geometry = &ground}, kFrame, margin).advancements,
            3);
  EXPECT_THROW(TimeOfImpact({.max_advancements = 0}), InvalidArgument);
  EXPECT_THROW(impatient.find({}, {.geometry = &ground}, kFrame, margin), InvalidArgument);
}

TEST(TimeOfImpact, AMillionMetresAwayIsTheSameToTheRoundOffOfPoses) {
  const RigidGeometry ball{Sphere{0.1}}, cube{Box{{0.2, 0.2, 0.2}}};
  const Vec3 far(1e6, -1e6, 5e5);
  for (const Vec3& origin : {Vec3(0.0, 0.0, 0.0), far}) {
    const ExactMotion flight =
        mover({.pose = {.p = origin + Vec3(0.05, 0.0, 1.0)}, .velocity = {0.0, 0.0, -70.0}}, kFrame);
    const ImpactTime t =
        find({.geometry = &ball, .motion = &flight}, {.geometry = &cube, .pose = {.p = origin}}, kFrame, 0.0);
    EXPECT_EQ(t.status, Status::kImpact);
    // A margin of zero is raised to 32 ε of both bodies' coordinates.
    const double raised = 32.0 * std::numeric_limits<double>::epsilon() * (2.0 * origin.norm() + 10.0);
    EXPECT_NEAR(t.time, 0.7 / 70.0, 1.1 * raised / 70.0);
  }
}

// -- Swept boxes ------------------------------------------------------------------------------------------------------

TEST(Swept, EnclosesEveryVertexAtEveryTime) {
  std::mt19937 random(21);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vec3(unit(random), unit(random), unit(random)); };
  const auto model = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  for (int n = 0; n < 100; ++n) {
    const double step = std::pow(10.0, unit(random) - 2.0);
    const Tumbling body(model, step, random, 100.0 * vector(), 50.0 * vector(), 0.05);
    DeformedSurface start;
    MotionState s;
    body.motion.evaluate(0.0, s);
    start.bind(body.surface, s.amplitudes);
    const Aabb box = swept(start.bounds(0), model->collision_extent().shape, body.motion);
    for (int i = 0; i <= 50; ++i)
      for (const TrianglePoints& triangle : triangles_at(body.body(), step * i / 50))
        for (const Vec3& p : triangle) ASSERT_TRUE(box.contains(p));
  }
}

TEST(Swept, OfAFastBallIsItsTrackAndNoSphere) {
  const ExactMotion shot =
      mover({.pose = {.p = {0.0, 0.0, 1.0}}, .velocity = {500.0, 0.0, 2.0}, .acceleration = kDown}, 1.0);
  const Aabb box = swept(RigidGeometry{Sphere{0.1}}.bounds(), {}, shot);
  const double top = 1.0 + 2.0 * 2.0 / (2.0 * 9.80665), bottom = 1.0 + 2.0 - 0.5 * 9.80665;
  EXPECT_NEAR(box.low.x(), -0.1, 1e-9);
  EXPECT_NEAR(box.high.x(), 500.1, 1e-9);
  EXPECT_NEAR(box.low.y(), -0.1, 1e-9);
  EXPECT_NEAR(box.high.y(), 0.1, 1e-9);
  EXPECT_NEAR(box.low.z(), bottom - 0.1, 1e-9);
  EXPECT_NEAR(box.high.z(), top + 0.1, 1e-9);
}

// -- Promises ---------------------------------------------------------------------------------------------------------

TEST(TimeOfImpact, WarmItAllocatesNothingAndRepeatsItsBits) {
  std::mt19937 random(3);
  const auto box = testing::sample_model({.modes = 6, .lowest_hz = 8.0, .decay = 1.0});
  const Tumbling a(box, kFrame, random, {1.2, 0.1, 0.0}, {-80.0, 0.0, 0.0}, 0.02);
  const Tumbling b(box, kFrame, random, Vec3::Zero(), Vec3::Zero(), 0.02);
  const RigidGeometry ball{Sphere{0.1}}, ground{HalfSpace{}};
  const MovingBody one = a.body(), other = b.body();
  TimeOfImpact solver;
  const ImpactTime first = solver.find(one, other, kFrame, 1e-4);
  solver.find(one, {.geometry = &ball}, kFrame, 1e-4);
  solver.find(one, {.geometry = &ground}, kFrame, 1e-4);
  const long before = testing::allocations();
  const ImpactTime again = solver.find(one, other, kFrame, 1e-4);
  solver.find(one, {.geometry = &ball}, kFrame, 1e-4);
  solver.find(one, {.geometry = &ground}, kFrame, 1e-4);
  EXPECT_EQ(testing::allocations(), before);
  EXPECT_EQ(first.status, Status::kImpact);
  EXPECT_EQ(again.time, first.time);
  EXPECT_EQ(TimeOfImpact().find(one, other, kFrame, 1e-4).time, first.time);
}

}  // namespace
}  // namespace limber
