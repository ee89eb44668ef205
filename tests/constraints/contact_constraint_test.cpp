#include "limber/constraints/contact_constraint.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "asked.h"
#include "constants.h"
#include "contact_scene.h"
#include "counted_new.h"
#include "limber/core/error.h"

namespace limber::testing {
namespace {

RigidTransform above(double height, const Vec3& turn = Vec3::Zero()) {
  return {quaternion_from_rotation_vector(turn), {0.0, 0.0, height}};
}

TEST(Contact, ABoxComesToRestOnTheGround) {
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4;  // m
  for (const int modes : {0, 20}) {
    // 3 % of critical damping in the first mode.
    const double hz = 30.0;
    GroundedIsland island({.modes = modes, .lowest_hz = hz, .decay = 0.03 * 2.0 * std::numbers::pi * hz}, kFrame);
    island.add_body(above(0.5, {0.3, 0.2, 0.1}));
    for (int i = 0; i < 300; ++i) island.step();
    const Vec3 before = island.group.frame(0).pose().p;
    double lowest = kUnbounded;
    for (int i = 0; i < 60; ++i) {
      island.step();
      lowest = std::min(lowest, island.lowest_gap());
    }
    EXPECT_GT(lowest, -kPenetration) << modes;
    EXPECT_LT((island.group.frame(0).pose().p - before).norm(), kShift) << modes;
    EXPECT_LT(island.group.frame(0).velocity().norm(), kShift) << modes;
  }
}

TEST(Contact, EnergyNeverRisesForAnyStiffnessStepDampingOrFriction) {
  constexpr double kRise = 1e-6;  // of the energy scale, per step: overlap that a step leaves is not pushed out here
  double worst = 0.0;
  for (const double hz : {0.1, 10.0, 1e4})
    for (const double decay : {0.0, 1e4})
      for (const int modes : {0, 20})
        for (const double step : {1e-3, 1e-2, 0.1})
          for (const double friction : {0.0, 0.7}) {
            GroundedIsland island({.modes = modes, .lowest_hz = hz, .decay = decay}, step,
                                  {.friction = friction, .recovery_speed = 0.0});
            // Corners just above the ground: the impact is within the first steps, whatever their length.
            island.add_body(above(0.45, {0.4, 0.5, 0.0}), {1.0, 0.0, -2.0}, {1.0, 2.0, -1.0});
            const double scale = island.energy_scale();
            double before = island.energy();
            for (int i = 0; i < 30; ++i) {
              island.step();
              const double after = island.energy();
              ASSERT_TRUE(std::isfinite(after)) << hz << ' ' << decay << ' ' << modes << ' ' << step << ' ' << friction;
              worst = std::max(worst, (after - before) / scale);
              before = after;
            }
          }
  EXPECT_LT(worst, kRise);
}

/// A contact of two points on two bodies as they stand.
ContactPoint contact_between(const Island& island, Index a, const SurfacePoint& on_a, Index b, const SurfacePoint& on_b,
                             const Vec3& normal, std::uint64_t id) {
  const Vec3 p = island.group.position(a, on_a), q = island.group.position(b, on_b);
  return {.a = contact_side(island, a, on_a),
          .b = contact_side(island, b, on_b),
          .normal = normal,
          .position = 0.5 * (p + q),
          .gap = normal.dot(p - q),
          .id = id};
}

TEST(Contact, FreeBodiesThatCollideKeepLinearAndAngularMomentum) {
  constexpr double kRelative = 1e-10;
  for (const int modes : {0, 12})
    for (const double friction : {0.0, 0.6}) {
      Island island({.modes = modes, .lowest_hz = 20.0}, kFrame, Vec3::Zero());
      island.add_body({quaternion_from_rotation_vector({0.1, 0.2, 0.0}), {-0.4, 0.0, 0.0}}, {3.0, 0.5, 0.0},
                      {2.0, 1.0, 4.0});
      island.add_body({quaternion_from_rotation_vector({0.0, -0.1, 0.3}), {0.4, 0.1, 0.05}}, {-2.0, 0.0, 0.3},
                      {0.0, 3.0, 1.0});
      ContactSet contacts({.friction = friction});
      const Vec3 linear = island.linear_momentum(), angular = island.angular_momentum();
      const double scale = 10.0 * island.model->data().mass;
      double impulse = 0.0;
      for (int i = 0; i < 60; ++i) {
        std::vector<ContactPoint> found;
        for (Index c = 0; c < 4; ++c)
          found.push_back(contact_between(island, 0, corner_point(*island.model, 2 * c + 1), 1,
                                          corner_point(*island.model, 2 * c), -Vec3::UnitX(),
                                          static_cast<std::uint64_t>(c + 1)));
        contacts.update(island.states(), found);
        island.constraints.assign(contacts.constraints().begin(), contacts.constraints().end());
        island.step();
        contacts.finish();
        for (const ContactEvent& event : contacts.events()) impulse += event.impulse.norm();
      }
      EXPECT_GT(impulse, 1.0);  // they met
      EXPECT_LT((island.linear_momentum() - linear).norm(), kRelative * scale) << modes << ' ' << friction;
      EXPECT_LT((island.angular_momentum() - angular).norm(), kRelative * scale) << modes << ' ' << friction;
    }
}

/// Rounds go on until the slowest body of an island has settled: the others' answer is that of islands of their own.
TEST(Contact, BodiesThatDoNotMeetMoveInOneIslandAsEachInItsOwn) {
  constexpr double kApart = 1e-7;  // m, after half a second: rounds end by the worst row of an island
  constexpr int kBodies = 7, kSteps = 30;
  const SampleOptions sample{.modes = 16, .dropped = 4, .lowest_hz = 30.0, .decay = 6.0};
  GroundedIsland together(sample, kFrame);
  std::vector<Vec3> alone;
  for (int i = 0; i < kBodies; ++i) {
    const RigidTransform pose{quaternion_from_rotation_vector({0.2 * i, 0.1, 0.05 * i}), {2.0 * i, 0.0, 0.35}};
    const Vec3 velocity(0.5, 0.1 * i, -1.0);
    together.add_body(pose, velocity);
    GroundedIsland island(sample, kFrame);
    island.add_body(pose, velocity);
    for (int n = 0; n < kSteps; ++n) ASSERT_EQ(island.step().status, IslandStatus::kSolved);
    alone.push_back(island.group.frame(0).pose().p);
  }
  for (int n = 0; n < kSteps; ++n) {
    const IslandReport report = together.step();
    ASSERT_EQ(report.status, IslandStatus::kSolved) << n;
    ASSERT_EQ(report.rows, 24 * kBodies);
  }
  for (Index i = 0; i < kBodies; ++i)
    EXPECT_LT((together.group.frame(i).pose().p - alone[static_cast<std::size_t>(i)]).norm(), kApart) << i;
}

/// More than 150 rows, with what the bodies yield beyond their modes.
TEST(Contact, BodiesThatBendComeToRestInOneLargeIslandAndGainNoEnergy) {
  constexpr double kPenetration = 1e-3 * kSampleSize, kShift = 1e-4, kRise = 1e-6;
  constexpr int kBodies = 7, kSteps = testing::kSanitized ? 30 : 240;
  GroundedIsland island({.modes = 8, .dropped = 4, .lowest_hz = 30.0, .decay = 6.0}, kFrame);
  for (int i = 0; i < kBodies; ++i)
    island.add_body({quaternion_from_rotation_vector({0.05 * i, 0.1, 0.05 * i}), {2.0 * i, 0.0, 0.35}});
  const double scale = island.energy_scale();
  double before = island.energy(), worst = 0.0;
  IslandStatusCounts statuses;
  for (int n = 0; n < kSteps; ++n) {
    const IslandReport report = island.step();
    EXPECT_TRUE(report.accepted) << n;
    statuses.add(report.statuses);
    EXPECT_GT(report.rows, 150);
    const double after = island.energy();
    worst = std::max(worst, (after - before) / scale);
    before = after;
  }
  EXPECT_LE(statuses[IslandStatus::kLimit], 5);  // as all of them land: the limit of contact solves
  EXPECT_LT(worst, kRise);
  if (testing::kSanitized) return;
  EXPECT_GT(island.lowest_gap(), -kPenetration);
  double weight = 0.0;
  for (const Index body : island.members) {
    EXPECT_LT(island.group.frame(body).velocity().norm(), kShift) << body;
    weight += kGravity * island.model->data().mass;
  }
  EXPECT_NEAR(island.contact_impulse().z(), weight * kFrame, 1e-6 * weight * kFrame);
}

TEST(Contact, BodiesCaughtInEachOtherStayAsTheyAre) {
  Island island({.modes = 12, .lowest_hz = 20.0}, kFrame, Vec3::Zero());
  island.add_body({{}, Vec3::Zero()});
  island.add_body({quaternion_from_rotation_vector({0.0, 0.0, 0.02}), Vec3::Zero()});
  ContactSet contacts;
  for (int i = 0; i < 10; ++i) {
    std::vector<ContactPoint> found;
    double opposed = 0.0;
    for (Index corner = 0; corner < 8; ++corner) {
      const SurfacePoint at = corner_point(*island.model, corner);
      const double across = (island.group.position(0, at) - island.group.position(1, at)).x();
      found.push_back(contact_between(island, 0, at, 1, at, Vec3(across > 0.0 ? -1.0 : 1.0, 0.0, 0.0),
                                      static_cast<std::uint64_t>(corner + 1)));
      EXPECT_LT(found.back().gap, -1e-3);
      opposed += found.back().normal.x();
    }
    EXPECT_EQ(opposed, 0.0);
    contacts.update(island.states(), found);
    island.constraints.assign(contacts.constraints().begin(), contacts.constraints().end());
    EXPECT_EQ(island.step().status, IslandStatus::kSolved);
    contacts.finish();
    EXPECT_TRUE(contacts.events().empty());
  }
  EXPECT_LT(island.group.frame(1).velocity().norm() + island.energy(), 1e-12);
}

Vec3 slope(double angle) { return {-std::sin(angle), 0.0, std::cos(angle)}; }

/// A box that lies on a slope, gap 0.
void lay_on(GroundedIsland& island, double angle) {
  const Quaternion q = quaternion_from_rotation_vector({0.0, -angle, 0.0});
  island.add_body({q, Vec3::Zero()});
  const double gap = island.lowest_gap();
  island.group.set_pose(0, {q, -gap * slope(angle)});
}

TEST(Contact, ABlockOnASlopeBelowTheFrictionAngleDoesNotCreep) {
  constexpr double kCreep = 1e-6 * kSampleSize;  // m per second
  constexpr double kFriction = 0.5;
  for (const int modes : {0, 12}) {
    const double angle = 0.9 * std::atan(kFriction), hz = 40.0;
    GroundedIsland island({.modes = modes, .lowest_hz = hz, .decay = 0.05 * 2.0 * std::numbers::pi * hz}, kFrame,
                          {.friction = kFriction}, slope(angle));
    lay_on(island, angle);
    for (int i = 0; i < 120; ++i) island.step();
    const Vec3 before = island.group.frame(0).pose().p;
    for (int i = 0; i < 60; ++i) island.step();
    EXPECT_LT((island.group.frame(0).pose().p - before).norm(), kCreep) << modes;
  }
}

TEST(Contact, ABlockOnASteeperSlopeSlidesAsCoulombSays) {
  constexpr double kRelative = 1e-3;
  constexpr double kFriction = 0.3, kAngle = 0.5;
  GroundedIsland island({.modes = 0}, kFrame, {.friction = kFriction}, slope(kAngle));
  lay_on(island, kAngle);
  for (int i = 0; i < 2; ++i) island.step();
  const Vec3 start = island.group.frame(0).pose().p, speed = island.group.frame(0).velocity();
  constexpr int kSteps = 60;
  for (int i = 0; i < kSteps; ++i) island.step();
  const double t = kSteps * kFrame;
  const double acceleration = kGravity * (std::sin(kAngle) - kFriction * std::cos(kAngle));
  const Vec3 down{-std::cos(kAngle), 0.0, -std::sin(kAngle)};
  EXPECT_NEAR((island.group.frame(0).velocity() - speed).dot(down), acceleration * t, kRelative * acceleration * t);
  // Of what touches gravity comes at the step's start: it moves with the velocity of the step's end.
  EXPECT_NEAR((island.group.frame(0).pose().p - start).dot(down),
              speed.dot(down) * t + 0.5 * acceleration * t * (t + kFrame), kRelative * 0.5 * acceleration * t * t);
}

TEST(Contact, TheGroundCarriesTheWeight) {
  constexpr double kRelative = 1e-9;
  GroundedIsland island({.modes = 0}, kFrame);
  lay_on(island, 0.0);
  for (int i = 0; i < 10; ++i) island.step();
  Vec3 impulse = Vec3::Zero();
  for (const ContactEvent& event : island.contacts.events()) {
    EXPECT_EQ(event.phase, ContactPhase::kLasting);
    impulse += event.impulse;
  }
  const double weight = island.model->data().mass * kGravity * kFrame;
  EXPECT_NEAR(impulse.z(), weight, kRelative * weight);
  EXPECT_LT(impulse.head<2>().norm(), kRelative * weight);
}

TEST(Contact, StepsThatEndAtALimitAreToldAndTheirMotionIsTaken) {
  constexpr int kSteps = 20;
  for (const int rounds : {1, 30}) {
    GroundedIsland island({.modes = 3}, kFrame);
    island.max_iterations = rounds;
    island.add_body(above(0.4, {0.3, 0.2, 0.1}), {1.0, 0.0, -3.0}, {2.0, -1.0, 0.5});
    int limited = 0;
    for (int i = 0; i < kSteps; ++i) {
      const IslandReport report = island.step();
      EXPECT_EQ(report.status, report.change > 1.0 ? IslandStatus::kLimit : IslandStatus::kSolved) << i;
      EXPECT_EQ(report.statuses[report.status], 1) << i;
      EXPECT_TRUE(report.accepted) << i;
      limited += report.statuses[IslandStatus::kLimit];
    }
    EXPECT_EQ(limited > 0, rounds == 1) << rounds;
    EXPECT_GT(island.lowest_gap(), -0.1 * kSampleSize) << rounds;
  }
}

TEST(Contact, EventsTellWhenContactsBeginAndEnd) {
  GroundedIsland island({.modes = 0}, kFrame);
  island.add_body(above(0.2));
  int begun = 0, ended = 0;
  for (int i = 0; i < 60; ++i) {
    if (i == 40) island.group.set_velocity(0, {0.0, 0.0, 3.0}, Vec3::Zero());
    island.step();
    for (const ContactEvent& event : island.contacts.events()) {
      begun += event.phase == ContactPhase::kBegun ? 1 : 0;
      ended += event.phase == ContactPhase::kEnded ? 1 : 0;
      EXPECT_EQ(event.phase == ContactPhase::kEnded, event.impulse.isZero(0.0));
    }
  }
  EXPECT_GE(begun, 3);
  EXPECT_GE(ended, 3);
}

TEST(Contact, BodiesThatOverlapArePushedApartSlowly) {
  constexpr double kSpeed = 0.05, kDepth = 0.03;
  constexpr double kSlack = 1.01;  // round-off of the turn that uneven masses bring
  GroundedIsland island({.modes = 0}, kFrame, {.recovery_speed = kSpeed});
  lay_on(island, 0.0);
  RigidTransform pose = island.group.frame(0).pose();
  pose.p.z() -= kDepth;
  island.group.set_pose(0, pose);
  double before = island.lowest_gap();
  for (int i = 0; i < 120; ++i) {
    island.step();
    EXPECT_LE(island.lowest_gap() - before, kSlack * kSpeed * kFrame);
    before = island.lowest_gap();
  }
  EXPECT_GT(before, -1e-3 * kSampleSize);
  EXPECT_LT(before, 1e-3 * kSampleSize);
}

TEST(Contact, AWarmStepAllocatesNothing) {
  GroundedIsland island({.modes = 6, .lowest_hz = 20.0, .decay = 5.0}, kFrame);
  island.add_body(above(0.4, {0.3, 0.1, 0.0}));
  for (int i = 0; i < 120; ++i) island.step();
  const std::vector<ContactPoint> found = island.found;
  const long before = allocations();
  island.contacts.update(island.states(), found);
  island.Island::step();
  island.contacts.finish();
  EXPECT_EQ(allocations() - before, 0);
  EXPECT_FALSE(island.contacts.events().empty());
}

TEST(Contact, RowsMadeAgainAfterOthersYieldAsTheyDid) {
  GroundedIsland island({.modes = 4, .dropped = 3}, 1e-2);
  island.add_body({{}, {0.0, 0.0, 1.0}});
  island.step();
  const auto yields_at = [&](Index first) {
    ConstraintRows rows;
    for (const int makings : {0, 1}) {  // a step in halves makes rows anew, here with more of them before these
      rows.clear();
      for (Index i = 0; i < first + 30 * makings; ++i) rows.add({}, {}, {});
      for (Constraint* constraint : island.contacts.constraints())
        constraint->add_rows(island.states(), StepTime::kStart, 1e-2, rows);
    }
    return rows.flexibility().size();
  };
  EXPECT_GT(yields_at(0), 0u);
  EXPECT_EQ(yields_at(0), yields_at(5));
  // Each pair of the eight corners' 24 rows once.
  EXPECT_EQ(yields_at(5), 24u * 25u / 2u);
}

TEST(Contact, OptionsOutOfRangeAreRefused) {
  EXPECT_THROW(ContactSet({.friction = -0.1}), InvalidArgument);
  EXPECT_THROW(ContactSet({.recovery_speed = kUnbounded}), InvalidArgument);
}

}  // namespace
}  // namespace limber::testing
