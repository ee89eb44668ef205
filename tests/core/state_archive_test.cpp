#include "limber/core/state_archive.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace limber {
namespace {

enum class Colour { kRed, kBlue };

/// Something with all kinds of fields, some of them private.
class Thing {
 public:
  Thing() = default;
  explicit Thing(double x)
      : flag_(true), colour_(Colour::kBlue), place_({{0.6, 0.0, 0.8, 0.0}, {x, -x, 0.0}}), list_({{x, 1.0}, {}}) {}
  friend bool operator==(const Thing& a, const Thing& b) {
    return a.flag_ == b.flag_ && a.colour_ == b.colour_ && a.place_.p == b.place_.p && a.place_.q.y == b.place_.q.y &&
           a.list_ == b.list_;
  }

 private:
  friend struct limber::StateFields;
  template <class Self>
  static auto state_fields(Self& s) {
    return std::tie(s.flag_, s.colour_, s.place_, s.list_);
  }
  bool flag_ = false;
  Colour colour_ = Colour::kRed;
  RigidTransform place_{};
  std::vector<std::vector<double>> list_;
};

std::vector<std::byte> written(const Thing& thing) {
  std::vector<std::byte> bytes;
  StateWriter writer(bytes);
  writer(thing);
  return bytes;
}

TEST(StateArchive, WhatIsReadBackIsTheSameToTheBit) {
  for (const double x : {0.1, -0.0, std::numeric_limits<double>::denorm_min(), 1e308}) {
    const std::vector<std::byte> bytes = written(Thing(x));
    Thing back(7.0);
    StateReader reader(bytes);
    reader(back);
    EXPECT_EQ(back, Thing(x));
    EXPECT_EQ(written(back), bytes);
    EXPECT_EQ(reader.left(), 0u);
  }
}

TEST(StateArchive, BytesThatEndTooEarlyAreRefused) {
  const std::vector<std::byte> bytes = written(Thing(2.0));
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    Thing thing;
    StateReader reader{std::span(bytes).first(size)};
    EXPECT_THROW(reader(thing), InvalidArgument) << size;
  }
}

TEST(StateArchive, ALengthBeyondTheBytesIsRefusedBeforeMemoryIsTaken) {
  std::vector<std::byte> bytes(8, std::byte{0x7f});
  std::vector<double> list;
  StateReader reader(bytes);
  EXPECT_THROW(reader(list), InvalidArgument);
  EXPECT_TRUE(list.empty());
}

}  // namespace
}  // namespace limber
