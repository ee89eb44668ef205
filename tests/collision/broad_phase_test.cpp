#include "limber/collision/broad_phase.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <random>
#include <set>

#include "asked.h"
#include "constants.h"
#include "counted_new.h"
#include "instruction_sets.h"
#include "limber/core/error.h"
#include "limber/jobs_tbb/tbb_jobs.h"

namespace limber {
namespace {

using testing::kInfinity;

/// The same bodies in a BroadPhase and in a plain list, where every pair is looked at.
class Both {
 public:
  struct Entry {
    std::optional<Aabb> box;
    std::optional<HalfSpace> half_space;
    CollisionFilter filter;
    bool asleep = false;
  };

  void add(Index body, const CollisionFilter& filter = {}) {
    broad_phase_.add(body, filter);
    entries_[body] = {.box = {}, .half_space = {}, .filter = filter};
  }
  void remove(Index body) {
    broad_phase_.remove(body);
    entries_.erase(body);
    std::erase_if(excluded_, [&](const BodyPair& p) { return p.a == body || p.b == body; });
  }
  void set_box(Index body, const Aabb& box) {
    broad_phase_.set_box(body, box);
    entries_.at(body).box = box;
    entries_.at(body).half_space.reset();
  }
  void set_half_space(Index body, const HalfSpace& half_space) {
    broad_phase_.set_half_space(body, half_space);
    entries_.at(body).half_space = half_space;
    entries_.at(body).box.reset();
  }
  void set_asleep(Index body, bool asleep) {
    broad_phase_.set_asleep(body, asleep);
    entries_.at(body).asleep = asleep;
  }
  void set_filter(Index body, const CollisionFilter& filter) {
    broad_phase_.set_filter(body, filter);
    entries_.at(body).filter = filter;
  }
  void exclude_pair(Index a, Index b, bool excluded) {
    broad_phase_.exclude_pair(a, b, excluded);
    if (excluded)
      excluded_.insert({std::min(a, b), std::max(a, b)});
    else
      excluded_.erase({std::min(a, b), std::max(a, b)});
  }

  std::vector<BodyPair> expected(double margin) const {
    std::vector<BodyPair> pairs;
    for (const auto& [a, A] : entries_)
      for (const auto& [b, B] : entries_)
        if (a < b && !(A.asleep && B.asleep) && !excluded_.contains({a, b}) && (A.filter.layers & B.filter.mask) != 0 &&
            (B.filter.layers & A.filter.mask) != 0 && near(A, B, margin))
          pairs.push_back({a, b});
    return pairs;
  }
  std::vector<BodyPair> found(double margin, Jobs& jobs = serial_jobs()) {
    std::vector<BodyPair> pairs;
    broad_phase_.find_pairs(margin, pairs, jobs);
    return pairs;
  }
  const std::map<Index, Entry>& entries() const { return entries_; }

 private:
  static bool near(const Entry& A, const Entry& B, double margin) {
    if (A.box && B.box)
      return (A.box->low.array() <= B.box->high.array() + margin).all() &&
             (B.box->low.array() <= A.box->high.array() + margin).all();
    if (!(A.box && B.half_space) && !(A.half_space && B.box)) return false;
    const Aabb& box = A.box ? *A.box : *B.box;
    const HalfSpace& plane = A.box ? *B.half_space : *A.half_space;
    double lowest = kInfinity;
    for (int corner = 0; corner < 8; ++corner) {
      double height = 0.0;
      for (int i = 0; i < 3; ++i)
        if (plane.normal[i] != 0.0) height += plane.normal[i] * (corner >> i & 1 ? box.high : box.low)[i];
      if (!std::isnan(height)) lowest = std::min(lowest, height);
    }
    return lowest <= plane.offset + margin;
  }

  BroadPhase broad_phase_;
  std::map<Index, Entry> entries_;
  std::set<BodyPair> excluded_;
};

struct RandomBoxes {
  std::mt19937 random;
  double side = 20.0;
  double uniform(double low, double high) { return std::uniform_real_distribution(low, high)(random); }
  Vec3 point() { return {uniform(0, side), uniform(0, side), uniform(0, 0.3 * side)}; }
  Aabb box() {
    const Vec3 low = point();
    return {low, low + Vec3(uniform(0, 2), uniform(0, 2), uniform(0, 2))};
  }
};

TEST(BroadPhase, FindsWhatEveryPairLookedAtGivesWhileBodiesMoveSleepComeAndGo) {
  RandomBoxes random{std::mt19937(1)};
  Both both;
  constexpr Index kBodies = 300;
  for (Index i = 0; i < kBodies; ++i) {
    both.add(i);
    if (i % 50 == 7) {
      both.set_half_space(i, {.normal = Vec3(0.1, random.uniform(-1, 1), 1).normalized(), .offset = 0.5});
    } else {
      both.set_box(i, random.box());
    }
  }
  std::size_t pairs_seen = 0;
  for (int step = 0; step < testing::all_or_tenth(200); ++step) {
    const double margin = step % 3 == 0 ? 0.0 : random.uniform(0, 0.2);
    const auto expected = both.expected(margin);
    ASSERT_EQ(both.found(margin), expected) << "step " << step;
    pairs_seen += expected.size();
    for (Index i = 0; i < kBodies; ++i) {
      const int what = std::uniform_int_distribution(0, 999)(random.random);
      if (!both.entries().contains(i)) {
        if (what < 100) both.add(i), both.set_box(i, random.box());
      } else if (what < 4) {
        both.remove(i);
      } else if (what < 10) {
        both.set_half_space(i, {.normal = Vec3(random.uniform(-1, 1), 0.2, 1).normalized(), .offset = -1.0});
      } else if (what < 12) {
        both.set_box(i, {Vec3(-kInfinity, 2.0, 0.0), Vec3(kInfinity, 2.5, kInfinity)});
      } else if (what < 30) {
        both.set_asleep(i, !both.entries().at(i).asleep);
      } else if (what < 40) {
        both.set_box(i, random.box());  // far away at once, asleep or not
      } else if (what < 60) {
        both.set_filter(i, {.layers = 1u << what % 3, .mask = what % 2 == 0 ? 5u : 0xffffffffu});
      } else if (what < 100) {
        const Index j = (i + 1 + what % 7) % kBodies;
        if (both.entries().contains(j)) both.exclude_pair(i, j, what < 90);
      } else if (!both.entries().at(i).asleep && both.entries().at(i).box) {
        const Vec3 by(random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1), random.uniform(-0.1, 0.1));
        const Aabb box = *both.entries().at(i).box;
        both.set_box(i, {box.low + by, box.high + by});
      }
    }
  }
  EXPECT_GT(pairs_seen, testing::all_or_tenth(10000u));
}

TEST(BroadPhase, ThousandsOfBodiesOnAnyThreadCountAndInstructionSetGiveThePairsOfBruteForce) {
  RandomBoxes random{std::mt19937(2), 45.0};
  Both both;
  for (Index i = 0; i < 3000; ++i) both.add(i), both.set_box(i, random.box()), both.set_asleep(i, i % 3 == 0);
  const auto expected = both.expected(0.1);
  EXPECT_GT(expected.size(), 1000u);
  TbbJobs two(2), four(4);
  EXPECT_EQ(both.found(0.1), expected);
  EXPECT_EQ(both.found(0.1, two), expected);
  EXPECT_EQ(both.found(0.1, four), expected);
  for_each_instruction_set([&](std::int64_t) { EXPECT_EQ(both.found(0.1), expected); });
}

TEST(BroadPhase, FarFromTheOriginNoPairIsLostToRounding) {
  // At 1e6 m a float's step is 6 cm; these boxes are 1 cm wide and touch exactly.
  Both both;
  for (Index i = 0; i < 100; ++i) {
    both.add(i);
    const double x = 1e6 + 0.0078125 * i;  // 2⁻⁷: exact in double precision
    both.set_box(i, {{x, 1e6, -1e6}, {x + 0.0078125, 1e6, -1e6}});
  }
  std::vector<BodyPair> neighbours;
  for (Index i = 0; i + 1 < 100; ++i) neighbours.push_back({i, i + 1});
  EXPECT_EQ(both.found(0.0), neighbours);
}

TEST(BroadPhase, BoxesBeyondSinglePrecisionAreCompared) {
  Both both;
  const double xs[] = {-1e300, -1e39, -1e-46, 0.0, 1e-46, 1e39, 1e300};
  Index body = 0;
  for (const double x : xs)
    for (int twice = 0; twice < 2; ++twice)
      both.add(body), both.set_box(body++, {Vec3::Constant(x), Vec3::Constant(x)});
  const std::vector<BodyPair> same_place{{0, 1}, {2, 3}, {4, 5}, {6, 7}, {8, 9}, {10, 11}, {12, 13}};
  EXPECT_EQ(both.found(0.0), same_place);
}

TEST(BroadPhase, BodiesInTheSamePlaceAllMeetEachOther) {
  Both both;
  for (Index i = 0; i < 70; ++i) both.add(i), both.set_box(i, {Vec3::Zero(), Vec3::Ones()});
  EXPECT_EQ(both.found(0.0).size(), 70u * 69u / 2u);
  EXPECT_EQ(both.found(0.0), both.expected(0.0));
}

TEST(BroadPhase, OnlyAwakeBodiesMeetThoseThatSleep) {
  Both both;
  for (Index i = 0; i < 3; ++i) both.add(i), both.set_box(i, {Vec3::Zero(), Vec3::Ones()});
  both.set_asleep(0, true);
  both.set_asleep(1, true);
  EXPECT_EQ(both.found(0.0), (std::vector<BodyPair>{{0, 2}, {1, 2}}));
  both.set_asleep(2, true);
  EXPECT_TRUE(both.found(0.0).empty());
  both.set_asleep(0, false);
  EXPECT_EQ(both.found(0.0), (std::vector<BodyPair>{{0, 1}, {0, 2}}));
}

TEST(BroadPhase, ABodyMeetsNothingBeforeItIsPlacedNorWhenItsIndexWasReused) {
  BroadPhase broad_phase;
  std::vector<BodyPair> pairs;
  for (Index i = 0; i < 2; ++i) broad_phase.add(i), broad_phase.set_box(i, {Vec3::Zero(), Vec3::Ones()});
  broad_phase.exclude_pair(0, 1, true);
  broad_phase.set_asleep(1, true);
  broad_phase.remove(1);
  broad_phase.add(1);  // awake again, without a box, an exclusion or a filter
  broad_phase.find_pairs(0.0, pairs, serial_jobs());
  EXPECT_TRUE(pairs.empty());
  broad_phase.set_box(1, {Vec3::Zero(), Vec3::Ones()});
  broad_phase.find_pairs(0.0, pairs, serial_jobs());
  EXPECT_EQ(pairs, (std::vector<BodyPair>{{0, 1}}));
}

TEST(BroadPhase, AWarmQueryAllocatesNothing) {
  RandomBoxes random{std::mt19937(3)};
  BroadPhase broad_phase;
  std::vector<Aabb> boxes;
  for (Index i = 0; i < 1000; ++i) {
    boxes.push_back(random.box());
    broad_phase.add(i);
    broad_phase.set_box(i, boxes.back());
  }
  broad_phase.set_half_space(999, {});
  std::vector<BodyPair> pairs;
  const auto frame = [&](int step) {
    for (Index i = 0; i < 999; ++i) {
      const double t = 0.1 * step + i;
      const Vec3 by(0.1 * std::sin(t), 0.1 * std::cos(t), 0.0);
      broad_phase.set_asleep(i, (i + step) % 4 == 0);
      const auto& box = boxes[static_cast<std::size_t>(i)];
      broad_phase.set_box(i, {box.low + by, box.high + by});
    }
    broad_phase.find_pairs(0.01, pairs, serial_jobs());
  };
  for (int step = 0; step < 70; ++step) frame(step);
  const long before = testing::allocations();
  for (int step = 70; step < 130; ++step) frame(step);
  EXPECT_EQ(testing::allocations() - before, 0);
}

TEST(BroadPhase, WrongArgumentsAreRefused) {
  BroadPhase broad_phase;
  broad_phase.add(3);
  const double nan = std::nan("");
  std::vector<BodyPair> pairs;
  EXPECT_THROW(broad_phase.add(3), InvalidArgument);
  EXPECT_THROW(broad_phase.add(-1), InvalidArgument);
  EXPECT_THROW(broad_phase.remove(2), InvalidArgument);
  EXPECT_THROW(broad_phase.set_box(4, {Vec3::Zero(), Vec3::Ones()}), InvalidArgument);
  EXPECT_THROW(broad_phase.set_box(3, {}), InvalidArgument);
  EXPECT_THROW(broad_phase.set_box(3, {Vec3(0, nan, 0), Vec3::Ones()}), InvalidArgument);
  EXPECT_THROW(broad_phase.set_half_space(3, {.normal = {0, 0, 2}}), InvalidArgument);
  EXPECT_THROW(broad_phase.exclude_pair(3, 3, true), InvalidArgument);
  EXPECT_THROW(broad_phase.exclude_pair(3, 4, true), InvalidArgument);
  EXPECT_THROW(broad_phase.find_pairs(-1.0, pairs, serial_jobs()), InvalidArgument);
  EXPECT_THROW(broad_phase.find_pairs(nan, pairs, serial_jobs()), InvalidArgument);
}

}  // namespace
}  // namespace limber
