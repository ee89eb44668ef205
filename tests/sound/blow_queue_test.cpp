#include "limber/sound/blow_queue.h"

#include <gtest/gtest.h>

#include <thread>

#include "counted_new.h"

namespace limber {
namespace {

Blow numbered(Index n) {
  return {.body = n, .impulse = {1.0 * n, 2.0 * n, 3.0 * n}, .contact_time = 1e-3 + n, .delay = 0.5 * n};
}

TEST(BlowQueue, WhatOneThreadPushesAnotherPopsOnceWholeAndInOrder) {
  constexpr Index kBlows = 20'000;
  BlowQueue queue(100);
  std::thread game([&] {
    for (Index n = 0; n < kBlows;)
      if (queue.push(numbered(n)))
        ++n;
      else
        std::this_thread::yield();
  });
  Index wrong = 0;
  for (Index n = 0; n < kBlows;) {
    Blow blow;
    if (!queue.pop(blow)) {
      std::this_thread::yield();
      continue;
    }
    const Blow expected = numbered(n++);
    if (blow.body != expected.body || blow.impulse != expected.impulse || blow.contact_time != expected.contact_time ||
        blow.delay != expected.delay)
      ++wrong;
  }
  game.join();
  EXPECT_EQ(wrong, 0);
  Blow none;
  EXPECT_FALSE(queue.pop(none));
}

TEST(BlowQueue, HoldsItsCapacityAndTellsThatItIsFull) {
  BlowQueue queue(3);
  const long before = testing::allocations();
  for (int round = 0; round < 5; ++round) {
    for (Index n = 0; n < 3; ++n) EXPECT_TRUE(queue.push(numbered(n)));
    EXPECT_FALSE(queue.push(numbered(3)));
    Blow blow;
    for (Index n = 0; n < 3; ++n) {
      ASSERT_TRUE(queue.pop(blow));
      EXPECT_EQ(blow.body, n);
    }
    EXPECT_FALSE(queue.pop(blow));
  }
  EXPECT_EQ(testing::allocations(), before);
}

}  // namespace
}  // namespace limber
