/// @file limber/dynamics/half_basis.h
/// Mode shapes in half precision: half the bytes to read, where bodies are drawn one at a time and their bases come
/// from memory. Single precision is as fast if many instances share a basis or it lies in a cache.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "limber/core/aligned_array.h"
#include "limber/core/types.h"
#include "limber/dynamics/reconstruct.h"
#include "limber/model/modal_basis.h"

namespace limber {

/// The numbers of a ModalBasis as IEEE binary16, in the same tiles. Each mode is scaled by a power of two so that its
/// largest component lies in [2¹⁴, 2¹⁵): components down to 2⁻²⁹ of that keep all of the format's 11 binary digits, and
/// smaller ones are off by less than 2⁻⁴⁰ of it.
class HalfBasis {
 public:
  explicit HalfBasis(const ModalBasis& basis);

  Index vertices() const { return vertices_; }
  Index modes() const { return modes_; }
  std::size_t bytes() const { return data_.size() * sizeof(std::uint16_t); }
  /// Per mode the largest length by which a vertex's shape is off, kg^−½: a vertex is drawn off by at most Σ |z_i| of
  /// these, beside the round-off of reconstruct().
  std::span<const double> errors() const { return errors_; }
  /// A stored number of a mode times this is the shape: what amplitudes are multiplied with.
  std::span<const float> scales() const { return scales_; }
  /// Start of a tile: modes() blocks of 3 · ModalBasis::kTile numbers.
  const std::uint16_t* tile(Index t) const {
    return data_.data() + static_cast<std::size_t>(t) * static_cast<std::size_t>(modes_) * 3 * ModalBasis::kTile;
  }

 private:
  Index vertices_ = 0, modes_ = 0;
  AlignedArray<std::uint16_t> data_;
  std::vector<float> scales_;
  std::vector<double> errors_;
};

/// reconstruct() from a basis in half precision. Skins are not taken. A vertex is off by at most Σ |z_i| errors()[i]
/// beside the error told there.
/// @param basis of surface.basis @throws InvalidArgument as reconstruct(), and if it is not as large as that
void reconstruct(const ModalSurface& surface, const HalfBasis& basis, std::span<const ReconstructionTarget> targets,
                 Jobs& jobs = serial_jobs());

}  // namespace limber
