#include <gtest/gtest.h>

#include <map>

#include "grounded_world.h"
#include "limber/core/error.h"

namespace limber::testing {
namespace {

constexpr int kParts = 4;

/// A box that falls on the ground, at a step of 1/60 s in parts, or at the small step.
struct FallingBox : GroundedWorld {
  explicit FallingBox(bool parts)
      : GroundedWorld({}, {.step = 1.0 / 60.0 / (parts ? 1 : kParts), .substeps = parts ? kParts : 1}) {
    box = world.add_body(damped_box(6, 30.0), {.pose = {quaternion_from_rotation_vector({0.2, 0.3, 0.0}), {0, 0, 0.6}},
                                               .velocity = {1.0, 0.0, 0.0}});
  }
  BodyId box;
};

void expect_same_state(const World& a, BodyId in_a, const World& b, BodyId in_b) {
  const BodyView x = a.body(in_a), y = b.body(in_b);
  EXPECT_EQ(x.pose.p, y.pose.p);
  EXPECT_EQ(x.pose.q.x, y.pose.q.x);
  EXPECT_EQ(x.velocity, y.velocity);
  EXPECT_TRUE(std::equal(x.amplitudes.begin(), x.amplitudes.end(), y.amplitudes.begin()));
  EXPECT_TRUE(std::equal(x.rates.begin(), x.rates.end(), y.rates.begin()));
}

TEST(Substeps, ComeToTheBitsOfAsManySmallStepsWithContactAndHeldForces) {
  FallingBox whole(true), small(false);
  const Vec3 force(0.5, -0.2, 0.1), impulse(0.0, 0.1, 0.2);
  for (int i = 0; i < 90; ++i) {
    const bool pushed = i > 20 && i < 40;
    if (pushed) whole.world.apply_force(whole.box, kMarked, force);
    const double part = small.world.options().step;
    if (i == 45) whole.world.apply_impulse(whole.box, kMarked, impulse, Axes::kWorld, 2.0 * part);
    whole.step(1);
    for (int p = 0; p < kParts; ++p) {
      if (pushed) small.world.apply_force(small.box, kMarked, force);
      if (i == 45 && p == 2) small.world.apply_impulse(small.box, kMarked, impulse, Axes::kWorld);
      small.step(1);
    }
    expect_same_state(whole.world, whole.box, small.world, small.box);
  }
  EXPECT_LT(whole.world.body(whole.box).pose.p.z(), 0.4) << "it has met the ground";
}

TEST(Substeps, EventsOfAStepAreTheSumOfItsParts) {
  FallingBox whole(true), small(false);
  std::map<std::uint64_t, Vec3> sums;
  bool begun = false, ended = false;
  for (int i = 0; i < 90; ++i) {
    whole.step(1);
    sums.clear();
    for (int p = 0; p < kParts; ++p) {
      small.step(1);
      for (const ContactEvent& e : small.world.contact_events())
        if (e.phase != ContactPhase::kEnded) sums.try_emplace(e.id, Vec3::Zero()).first->second += e.impulse;
    }
    std::size_t pressing = 0;
    for (const ContactEvent& e : whole.world.contact_events()) {
      begun = begun || e.phase == ContactPhase::kBegun;
      ended = ended || e.phase == ContactPhase::kEnded;
      if (e.phase == ContactPhase::kEnded) {
        EXPECT_FALSE(sums.contains(e.id));
        continue;
      }
      ++pressing;
      ASSERT_TRUE(sums.contains(e.id));
      EXPECT_LT((sums[e.id] - e.impulse).norm(), 1e-12);
    }
    EXPECT_EQ(pressing, sums.size());
  }
  EXPECT_TRUE(begun && ended);
}

TEST(Substeps, EveryContactIsToldToBeginBeforeItLastsOrEnds) {
  FallingBox whole(true);
  std::map<std::uint64_t, bool> pressing;
  for (int i = 0; i < 120; ++i) {
    whole.step(1);
    std::map<std::uint64_t, bool> now;
    for (const ContactEvent& e : whole.world.contact_events()) {
      EXPECT_EQ(e.phase == ContactPhase::kBegun, !pressing.contains(e.id)) << "step " << i;
      if (e.phase != ContactPhase::kEnded) now[e.id] = true;
    }
    for (const auto& [id, was] : pressing)
      EXPECT_TRUE(std::any_of(whole.world.contact_events().begin(), whole.world.contact_events().end(),
                              [&](const ContactEvent& e) { return e.id == id; }));
    pressing = now;
  }
}

TEST(Substeps, HandlesFollowAStraightLineAndMeetTheirTargetAtTheStepsEnd) {
  World world({.substeps = kParts});
  world.set_contact_source(nullptr, exactly());
  const BodyId box = world.add_body(damped_box(4, 30.0));
  const HandleId hand = world.add_handle(box, kMarked);
  const Vec3 start = world.position(box, kMarked);
  for (int i = 1; i <= 30; ++i) {
    const Vec3 target = start + Vec3(0.01 * i, 0.0, 0.005 * i);
    world.set_handle_target(hand, {.position = target, .velocity = {0.6, 0.0, 0.3}});
    world.step();
    EXPECT_LT((world.position(box, kMarked) - target).norm(), 1e-9);
    EXPECT_LT((world.handle(hand).target.position - target - Vec3(0.01, 0.0, 0.005)).norm(), 1e-12);
  }
}

TEST(Substeps, ACarriedBodyIsWhereItsParentIsAtTheStepsEnd) {
  World world({.substeps = kParts});
  const BodyId box = world.add_body(sample_model({.motion = FrameMotion::kKinematic, .modes = 4}));
  const double h = world.options().step;
  for (int i = 1; i <= 30; ++i) {
    const KinematicFrame target{.pose = {quaternion_from_rotation_vector({0.0, 0.0, 0.02 * i}), {0.05 * i, 0.0, 0.0}},
                                .velocity = {0.05 / h, 0.0, 0.0},
                                .angular_velocity = {0.0, 0.0, 0.02 / h}};
    world.set_kinematic_frame(box, target);
    world.step();
    EXPECT_EQ(world.body(box).pose.p, target.pose.p);
    EXPECT_NEAR(world.body(box).pose.q.z, target.pose.q.z, 1e-15);
    // Drawn between whole steps, not between their parts.
    EXPECT_LT((world.interpolated_pose(box, 0.0).p - Vec3(0.05 * (i - 1), 0.0, 0.0)).norm(), 1e-12);
  }
}

TEST(Substeps, AreCountedFromOne) { EXPECT_THROW(World({.substeps = 0}), InvalidArgument); }

}  // namespace
}  // namespace limber::testing
