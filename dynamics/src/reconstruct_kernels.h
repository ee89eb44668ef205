// The vector loops behind reconstruct(). Raw pointers only: the file that implements them is compiled for several
// instruction sets, so neither Eigen nor a header that includes it may reach it.
#pragma once

#include <cstddef>
#include <cstdint>

namespace limber::internal {

inline constexpr std::size_t kTileVertices = 16;
inline constexpr std::size_t kBlockInstances = 8;  ///< with AVX-512 their 24 accumulators leave room for the operands

/// A rigid transform in single precision and where the vertices of one instance go.
struct InstanceOutput {
  float rotation[9];     ///< row-major
  float translation[3];  ///< m
  /// xyz per vertex, of vertex 0: added to the rest positions, in the body's frame; null: nothing
  const float* displacement;
  float* positions;  ///< xyz per vertex, of vertex 0
  /// kHandleNumbers per handle of a modal skin: rows of R − 1, t, Θz, e (limber/model/skin_pose.h); null: no skin
  const float* handles;
};

inline constexpr std::size_t kHandleNumbers = 18;

/// Which handles the vertices of a tile hang on (limber/dynamics/skin_tiles.h).
struct TileInfluences {
  const std::uint32_t* starts;  ///< of the entries of each tile, and their end
  const std::uint8_t* handle;   ///< of an entry
  const float* weights;         ///< kTileVertices per entry, 64-byte aligned
};

/// Vertices [16·first_tile, min(16·last_tile, vertices)) of up to kBlockInstances instances of one surface.
struct TileRange {
  const float* basis;               ///< `[tile][mode][x16|y16|z16]`, 64-byte aligned, of tile 0
  const std::uint16_t* half_basis;  ///< in its place: the same in half precision, amplitudes scaled; null: none
  const float* rest;                ///< xyz per vertex, of vertex 0
  std::size_t vertices, stored_modes, first_tile, last_tile;
  std::size_t modes;        ///< those that are summed: the first so many
  const float* amplitudes;  ///< `[mode][instance]`
  const InstanceOutput* outputs;
  std::size_t instances;      ///< 1 … kBlockInstances
  TileInfluences influences;  ///< where an instance has handles
};

/// Each vertex gets the same operations in the same order whatever shares its block, so the same bits.
void reconstruct_tiles(const TileRange& range);

/// Rounds to half precision, to nearest. @param back out: what the halves stand for @param count a multiple of 16
void to_half(const float* from, std::uint16_t* to, float* back, std::size_t count);

/// n ← n/|n| for xyz vectors in a row; (0, 0, 1) where |n|² vanishes in single precision.
void normalize_vectors(float* vectors, std::size_t count);

}  // namespace limber::internal
