#include <gtest/gtest.h>

#include <cmath>

#include "counted_new.h"
#include "finder_scenes.h"

namespace limber {
namespace {

TEST(ContactFinder, AWarmQueryAllocatesNothing) {
  testing::ContactScene scene = testing::heap(120);
  ContactFinder finder;
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

}  // namespace
}  // namespace limber
