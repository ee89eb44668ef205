// The hash behind World::state_hash().
#pragma once

#include <bit>
#include <cstdint>
#include <span>

#include "limber/core/quaternion.h"
#include "limber/core/types.h"

namespace limber::internal {

/// FNV-1a over the bits of doubles.
class StateHash {
 public:
  void add(double x) { add(std::bit_cast<std::uint64_t>(x)); }
  void add(std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte) value_ = (value_ ^ ((bits >> (8 * byte)) & 0xff)) * 0x100000001b3ull;
  }
  void add(const Vec3& v) { add(v.x()), add(v.y()), add(v.z()); }
  void add(const Quaternion& q) { add(q.w), add(q.x), add(q.y), add(q.z); }
  void add(std::span<const double> values) {
    for (const double x : values) add(x);
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325ull;
};

}  // namespace limber::internal
