/// @file limber/dynamics/skin_tiles.h
/// The influences of a surface's vertices once more, laid out for streaming beside a ModalBasis.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limber/core/aligned_array.h"
#include "limber/model/modal_skin.h"

namespace limber {

/// For each tile of 16 vertices the handles that any of them hangs on, each with 16 weights (0 where a vertex does
/// not). Some 20 bytes a vertex where neighbours in the array are neighbours on the surface.
class SkinTiles {
 public:
  SkinTiles() = default;
  explicit SkinTiles(std::span<const SkinInfluences> vertices);

  Index vertices() const { return vertices_; }
  /// One more than the largest handle that is named.
  Index handles() const { return handles_; }
  /// Entries [starts()[t], starts()[t + 1]) belong to tile t.
  const std::uint32_t* starts() const { return starts_.data(); }
  const std::uint8_t* handle_of_entry() const { return handle_.data(); }
  /// 16 per entry, 64-byte aligned.
  const float* weights() const { return weights_.data(); }

 private:
  Index vertices_ = 0, handles_ = 0;
  std::vector<std::uint32_t> starts_{};
  std::vector<std::uint8_t> handle_{};
  AlignedArray<float> weights_;
};

}  // namespace limber
