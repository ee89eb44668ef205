/// @file limber/core/mixed_bits.h
/// Numbers that look random and follow from others.
#pragma once

#include <cstdint>

namespace limber {

/// A bijection that spreads every bit over all (the finaliser of Steele, Lea and Flood's SplitMix, 2014).
inline std::uint64_t mixed_bits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

}  // namespace limber
