// The container of GLB 2.0: a header, and chunks each with a header of its own.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>

namespace limber::internal {

static_assert(std::endian::native == std::endian::little, "GLB is little-endian and is copied from memory as it is");

inline constexpr std::uint32_t kGlbMagic = 0x46546C67, kGlbVersion = 2;
inline constexpr std::uint32_t kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942;
inline constexpr std::size_t kGlbHeaderSize = 12, kChunkHeaderSize = 8;

}  // namespace limber::internal
