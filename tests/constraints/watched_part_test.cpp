// Parts of steps that a watch ends where what is ahead would be passed.
#include <gtest/gtest.h>

#include <vector>

#include "contact_scene.h"

namespace limber::testing {
namespace {

constexpr double kSpeed = 3.0;  // m/s, towards the ground
constexpr double kGap = 3e-9;   // m, what gaps are met to at a metre from the origin

/// Lets the motions that it is shown go on for so long, one after the other, and all later ones all the way.
struct Lets final : MotionWatch {
  explicit Lets(std::vector<double> times) : times_(std::move(times)) {}
  double clear_until(const FreeMotions&, double length) override {
    return looks < times_.size() ? times_[looks++] : length;
  }
  std::size_t looks = 0;

 private:
  std::vector<double> times_;
};

/// A box that falls flat, its lower corners `gap` above the ground, takes a part of a step.
struct FallingBox : GroundedIsland {
  explicit FallingBox(double gap) : GroundedIsland({.modes = 0}, kFrame, {}, Vec3::UnitZ(), Vec3::Zero()) {
    add_body({}, -kSpeed * Vec3::UnitZ());
    group.set_pose(0, {{}, (gap - lowest_gap()) * Vec3::UnitZ()});
  }
  double take(Lets& watch) {
    foresee_contacts();
    return solver->step(table, members, constraints, {.step = kFrame, .gravity = Vec3::Zero(), .watch = &watch}).taken;
  }
  double velocity() const { return group.frame(0).velocity().z(); }
};

/// What it meets ahead slows it to where it is there at the step's end: by as much, however short the part.
TEST(WatchedPart, GoesAsTheWholeStepWouldUntilItIsCut) {
  const double gap = 0.4 * kSpeed * kFrame;
  Lets all({});
  FallingBox whole(gap);
  EXPECT_EQ(whole.take(all), kFrame);
  EXPECT_NEAR(whole.lowest_gap(), 0.0, kGap);
  for (const double cut : {0.5, 0.1}) {
    Lets part({cut * kFrame});
    FallingBox box(gap);
    EXPECT_EQ(box.take(part), cut * kFrame);
    EXPECT_NEAR(box.lowest_gap(), (1.0 - cut) * gap, kGap) << cut;
    EXPECT_NEAR(box.velocity(), whole.velocity(), 2.0 * kGap / kFrame) << cut;
  }
}

TEST(WatchedPart, ItsImpulsesActHoweverShortItIs) {
  Lets none({0.0, 0.0, 0.0});
  FallingBox box(0.0);
  const double taken = box.take(none);
  EXPECT_LT(taken, 1e-6 * kFrame);
  EXPECT_NEAR(box.lowest_gap(), 0.0, kGap);
  EXPECT_NEAR(box.velocity(), 0.0, 1e-3 * kSpeed) << "of a gap met to a picometre within " << taken << " s";
}

}  // namespace
}  // namespace limber::testing
