#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "counted_new.h"
#include "finder_scenes.h"
#include "limber/core/error.h"
#include "limber/dynamics/exact_motion.h"
#include "limber/jobs_tbb/tbb_jobs.h"

namespace limber {
namespace {

using testing::ContactScene;
using testing::Random;

constexpr double kStep = 1.0 / 60.0, kImpactMargin = 1e-4;

/// A scene with a motion for each body that moves.
struct MovingScene {
  ContactScene scene;
  std::vector<ExactMotion> motions;
  std::vector<const ExactMotion*> pointers;

  Index add(const Shape& shape, const RigidMotion& motion) {
    motions.emplace_back().set_frame(motion, kStep);
    return scene.add(shape, motion.pose);
  }
  Index add_still(const Shape& shape, const RigidTransform& pose) {
    motions.emplace_back();
    still_.push_back(scene.geometries.size());
    return scene.add(shape, pose);
  }
  std::vector<Impact> impacts(ContactSource& finder, Jobs& jobs = serial_jobs()) {
    std::vector<Impact> result;
    point();
    finder.find_impacts({.states = scene.states(), .motions = pointers, .step = kStep, .margin = kImpactMargin}, result,
                        jobs);
    return result;
  }
  void point() {
    pointers.clear();
    for (const ExactMotion& m : motions) pointers.push_back(&m);
    for (const std::size_t i : still_) pointers[i] = nullptr;
  }

 private:
  std::vector<std::size_t> still_;
};

/// Balls of 5 cm that fly about at up to 30 m/s in a room of 3 m, above a floor and around pillars that stand still.
MovingScene flying_balls(int count) {
  Random random(11);
  MovingScene moving;
  moving.add_still(HalfSpace{}, {});
  for (int i = 0; i < 4; ++i) moving.add_still(Box{{0.2, 0.2, 2.0}}, {{}, {0.7 * i, 1.5, 1.0}});
  for (int i = 0; i < count; ++i)
    moving.add(Sphere{0.05}, {.pose = {{}, Vec3(1.5, 1.5, 1.6) + random.vector(1.5)}, .velocity = random.vector(30.0)});
  return moving;
}

bool same(const std::vector<Impact>& a, const std::vector<Impact>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const Impact& i, const Impact& j) {
    return i.a == j.a && i.b == j.b && i.time == j.time && i.resting == j.resting;
  });
}

TEST(ContactFinderImpacts, BallsOnACourseForEachOtherMeetWhenTheirGapIsFlownThrough) {
  MovingScene moving;
  const double radius = 0.1, gap = 0.5, speed = 50.0;
  moving.add(Sphere{radius}, {.pose = {{}, {0, 0, 5}}, .velocity = {speed, 0, 0}});
  moving.add(Sphere{radius}, {.pose = {{}, {2 * radius + gap, 0, 5}}, .velocity = {-speed, 0, 0}});
  moving.add(Sphere{radius}, {.pose = {{}, {0, 3, 5}}, .velocity = {speed, 0, 0}});  // meets nobody
  moving.add_still(HalfSpace{}, {});
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  const auto impacts = moving.impacts(finder);
  ASSERT_EQ(impacts.size(), 1u);
  EXPECT_EQ(impacts[0].a, 0);
  EXPECT_EQ(impacts[0].b, 1);
  EXPECT_FALSE(impacts[0].resting);
  EXPECT_GE(impacts[0].time, (gap - kImpactMargin) / (2 * speed) - 1e-12);
  EXPECT_LE(impacts[0].time, (gap - 0.5 * kImpactMargin) / (2 * speed) + 1e-12);
}

TEST(ContactFinderImpacts, ManyBodiesTogetherHaveTheImpactsOfEachPairAloneInOrderOfTime) {
  MovingScene moving = flying_balls(150);
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  std::vector<Impact> alone;
  const std::size_t bodies = moving.scene.geometries.size();
  for (std::size_t a = 0; a < bodies; ++a)
    for (std::size_t b = a + 1; b < bodies; ++b) {
      ContactFinder pair;
      pair.add_body(static_cast<Index>(a), moving.scene.geometries[a], {});
      pair.add_body(static_cast<Index>(b), moving.scene.geometries[b], {});
      const auto impacts = moving.impacts(pair);
      alone.insert(alone.end(), impacts.begin(), impacts.end());
    }
  std::sort(alone.begin(), alone.end(),
            [](const Impact& i, const Impact& j) { return std::tie(i.time, i.a, i.b) < std::tie(j.time, j.a, j.b); });
  ASSERT_GT(alone.size(), 20u);
  const auto together = moving.impacts(finder);
  EXPECT_TRUE(same(together, alone));
  TbbJobs two(2);
  EXPECT_TRUE(same(moving.impacts(finder, two), alone));
}

TEST(ContactFinderImpacts, AFewBodiesMeetWhatTheyMeetWhereAllOthersStandStill) {
  MovingScene moving = flying_balls(150);
  ContactFinder all, few;
  moving.scene.add_all_to(all);
  moving.scene.add_all_to(few);
  moving.point();
  std::vector<Index> movers;
  for (std::size_t i = 0; i < moving.pointers.size(); ++i) {
    if (i % 3 != 0) moving.pointers[i] = nullptr;
    if (moving.pointers[i] != nullptr) movers.push_back(static_cast<Index>(i));
  }
  const std::vector<BodyState> states = moving.scene.states();
  ImpactQuery query{.states = states, .motions = moving.pointers, .step = kStep, .margin = kImpactMargin};
  std::vector<Impact> expected, found;
  all.find_impacts(query, expected, serial_jobs());
  ASSERT_FALSE(expected.empty());
  std::vector<ContactPoint> contacts;
  few.find_contacts({.states = states}, contacts, serial_jobs());
  query.bodies = movers;
  few.find_impacts(query, found, serial_jobs());
  EXPECT_TRUE(same(found, expected));

  const std::vector<std::pair<Index, Index>> known{{expected.front().a, expected.front().b}};
  query.except = known;
  few.find_impacts(query, found, serial_jobs());
  expected.erase(expected.begin());
  EXPECT_TRUE(same(found, expected));
}

TEST(ContactFinderImpacts, WhatTouchesAlreadyOrStandsStillIsNoImpact) {
  MovingScene moving;
  moving.add_still(HalfSpace{}, {});
  moving.add_still(Box{Vec3::Ones()}, {{}, {0, 0, 0.5}});                                  // stands in the floor
  moving.add(Sphere{0.5}, {.pose = {{}, {3, 0, 0.4}}, .velocity = {0, 0, -1}});            // is in it, and sinks
  moving.add(Sphere{0.5}, {.pose = {{}, {6, 0, 0.5 + 0.01}}, .velocity = {0, 0, 1}});      // leaves
  moving.add(Sphere{0.5}, {.pose = {{}, {9, 0, 0.5 + 0.01}}, .velocity = {0, 0, -10.0}});  // arrives
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  const auto impacts = moving.impacts(finder);
  ASSERT_EQ(impacts.size(), 1u);
  EXPECT_EQ(impacts[0].b, 4);
}

TEST(ContactFinderImpacts, ASleeperIsHitAndContactsAfterwardsAreThoseOfItsState) {
  MovingScene moving;
  moving.add_still(Box{{0.5, 0.5, 0.5}}, {});
  moving.add(Sphere{0.1}, {.pose = {{}, {0, 0, 1.0}}, .velocity = {0, 0, -60.0}});
  moving.scene.asleep[0] = true;
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  EXPECT_TRUE(testing::contacts_of(finder, moving.scene, 0.01).empty());
  const auto impacts = moving.impacts(finder);
  ASSERT_EQ(impacts.size(), 1u);
  EXPECT_NEAR(impacts[0].time, 0.4 / 60.0, kImpactMargin / 60.0);
  EXPECT_TRUE(testing::contacts_of(finder, moving.scene, 0.01).empty());  // still where the state says
  moving.scene.poses[1] = moving.motions[1].path().pose(impacts[0].time);
  EXPECT_FALSE(testing::contacts_of(finder, moving.scene, 0.01).empty());
}

TEST(ContactFinderImpacts, AFloorThatMovesMeetsWhatItMovesTo) {
  MovingScene moving;
  moving.add(HalfSpace{}, {.velocity = {0, 0, 30.0}});
  moving.add_still(Sphere{0.5}, {{}, {100, 0, 0.5 + 0.3}});
  moving.add_still(Sphere{0.5}, {{}, {-100, 0, 0.5 + 0.6}});
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  const auto impacts = moving.impacts(finder);
  ASSERT_EQ(impacts.size(), 1u);
  EXPECT_EQ(impacts[0].b, 1);
  EXPECT_NEAR(impacts[0].time, 0.01, kImpactMargin / 30.0);
}

TEST(ContactFinderImpacts, AWarmQueryAllocatesNothing) {
  MovingScene moving = flying_balls(100);
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  moving.point();
  const auto& states = moving.scene.states();
  std::vector<Impact> impacts;
  const auto query = [&] {
    finder.find_impacts({.states = states, .motions = moving.pointers, .step = kStep, .margin = kImpactMargin}, impacts,
                        serial_jobs());
  };
  query();
  const long before = testing::allocations();
  query();
  EXPECT_EQ(testing::allocations() - before, 0);
  EXPECT_FALSE(impacts.empty());
}

TEST(ContactFinderImpacts, WrongMotionsAreRefused) {
  MovingScene moving = flying_balls(1);
  ContactFinder finder;
  moving.scene.add_all_to(finder);
  moving.point();
  std::vector<Impact> impacts;
  const auto& states = moving.scene.states();
  const auto find = [&](double step, double margin) {
    finder.find_impacts({.states = states, .motions = moving.pointers, .step = step, .margin = margin}, impacts,
                        serial_jobs());
  };
  EXPECT_NO_THROW(find(kStep, kImpactMargin));
  EXPECT_THROW(find(2.0 * kStep, kImpactMargin), InvalidArgument);  // the motions end before
  EXPECT_THROW(find(-1.0, kImpactMargin), InvalidArgument);
  EXPECT_THROW(find(kStep, std::nan("")), InvalidArgument);
  finder.add_body(6, {.model = testing::wavy_model(shapes::sphere(Vec3::Zero(), 0.5, 1), 2), .shape = {}}, {});
  moving.pointers.push_back(moving.pointers.back());
  EXPECT_THROW(find(kStep, kImpactMargin), InvalidArgument);  // a motion without modes for a body of two
}

}  // namespace
}  // namespace limber
