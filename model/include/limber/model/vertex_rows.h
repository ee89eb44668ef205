/// @file limber/model/vertex_rows.h
/// U once more, laid out for those who need single vertices: contacts, handles, joints.
#pragma once

#include <cstddef>

#include "limber/core/aligned_array.h"
#include "limber/core/types.h"
#include "limber/model/modal_basis.h"

namespace limber {

/// The same numbers as a ModalBasis, as `[vertex][axis][mode]`: the three rows of U at a vertex lie together, each
/// 64-byte aligned and padded with zeros to stride() modes. In a ModalBasis they are spread over 192 · k bytes.
class VertexRows {
 public:
  /// Rows are padded to a multiple of so many modes, one cache line.
  static constexpr Index kPadding = 16;

  VertexRows() = default;
  explicit VertexRows(const ModalBasis& basis);

  Index vertices() const { return vertices_; }
  Index modes() const { return modes_; }
  /// Floats from one row to the next: modes() rounded up to a multiple of kPadding.
  Index stride() const { return stride_; }
  /// stride() floats: displacement of a vertex along a body axis per unit amplitude of each mode, kg^−½.
  const float* row(Index vertex, int axis) const {
    return data_.data() + (std::size_t{3} * static_cast<std::size_t>(vertex) + static_cast<std::size_t>(axis)) *
                              static_cast<std::size_t>(stride_);
  }

 private:
  Index vertices_ = 0, modes_ = 0, stride_ = 0;
  AlignedArray<float> data_;
};

}  // namespace limber
