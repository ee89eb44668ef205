// The container of GLB 2.0: a header, and chunks each with a header of its own.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace limber::internal {

static_assert(std::endian::native == std::endian::little, "GLB is little-endian and is copied from memory as it is");

inline constexpr std::uint32_t kGlbMagic = 0x46546C67, kGlbVersion = 2;
inline constexpr std::uint32_t kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;
inline constexpr std::size_t kGlbHeaderSize = 12, kChunkHeaderSize = 8;

/// @pre four bytes are there
inline std::uint32_t u32_at(std::string_view bytes, std::size_t offset) {
  std::uint32_t value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

}  // namespace limber::internal
