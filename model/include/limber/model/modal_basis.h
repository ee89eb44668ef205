/// @file limber/model/modal_basis.h
/// Mode shapes at the vertices of a surface, in single precision, laid out for streaming.
#pragma once

#include <cstddef>
#include <vector>

#include "limber/core/aligned_array.h"
#include "limber/core/types.h"

namespace limber {

/// U: the rows of W at V vertices, 3V × k, float. Mass-normalised like W: units of kg^−½.
///
/// Stored once, in tiles of 16 vertices, `[tile][mode][x×16 | y×16 | z×16]`, 64-byte aligned, the last tile padded with
/// zeros: a reconstruction streams it in order, and the rows of one vertex lie within one tile (k · 192 bytes).
class ModalBasis {
 public:
  static constexpr int kTile = 16;

  ModalBasis() = default;
  /// All zero, to be filled through set().
  ModalBasis(Index vertices, Index modes);

  Index vertices() const { return vertices_; }
  Index modes() const { return modes_; }
  Index tiles() const { return (vertices_ + kTile - 1) / kTile; }

  /// Displacement of a vertex per unit amplitude of a mode.
  Vec3f shape(Index vertex, Index mode) const {
    const float* p = data_.data() + offset(vertex, mode);
    return {p[0], p[kTile], p[2 * kTile]};
  }
  void set(Index vertex, Index mode, const Vec3f& u) {
    float* p = data_.data() + offset(vertex, mode);
    p[0] = u.x(), p[kTile] = u.y(), p[2 * kTile] = u.z();
  }

  /// Start of a tile: modes() blocks of 3·kTile floats.
  const float* tile(Index t) const { return data_.data() + static_cast<std::size_t>(t) * modes_ * 3 * kTile; }

 private:
  std::size_t offset(Index vertex, Index mode) const {
    const std::size_t tile = static_cast<std::size_t>(vertex / kTile);
    return (tile * modes_ + mode) * 3 * kTile + vertex % kTile;
  }

  Index vertices_ = 0, modes_ = 0;
  AlignedArray<float> data_;
};

/// A triangulated surface that moves with the modes, in the body frame.
///   p_BP = rest + Σ_i z_i shape_i
struct ModalSurface {
  std::vector<Vec3f> rest;          ///< m, body frame
  std::vector<Triangle> triangles;  ///< indices into `rest`
  ModalBasis basis;                 ///< one row block per vertex

  Index vertices() const { return static_cast<Index>(rest.size()); }
};

}  // namespace limber
