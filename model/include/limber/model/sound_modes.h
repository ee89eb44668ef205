/// @file limber/model/sound_modes.h
/// The modes of a body that one hears: plain data of a bake, beside the few modes that move what is drawn.
#pragma once

#include <cstddef>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// Elastic modes at the vertices of one surface, mass-normalised (WᵀMW = I). Each rings as
///
///   q̈ + 2ξ q̇ + λ q = wᵀ f,   0 < ξ² < λ
///
/// q in kg^½·m. A mode that never ceases (ξ = 0) or does not swing (ξ² ≥ λ) has no place here.
struct SoundModes {
  std::vector<double> eigenvalues;  ///< λ, rad²/s², ascending
  std::vector<double> decays;       ///< ξ, 1/s, one per mode
  /// w, kg^−½, body frame: [mode][vertex][x, y, z], of the vertices of the surface that is struck.
  std::vector<float> shapes;
  Index vertices = 0;
  /// E/(1−ν²) of what lies under the surface, Pa: how hard it is to a blow (limber/sound/contact_time.h). Infinite:
  /// rigid.
  double contact_modulus = kUnbounded;

  Index modes() const { return static_cast<Index>(eigenvalues.size()); }
  Vec3f shape(Index mode, Index vertex) const {
    const float* w = shapes.data() + (static_cast<std::size_t>(mode) * vertices + vertex) * 3;
    return {w[0], w[1], w[2]};
  }
  /// @throws InvalidArgument naming the field: lengths that differ, numbers that are not finite, λ that descend, ξ
  /// outside 0 < ξ² < λ, a modulus that is not above 0
  void validate() const;
};

}  // namespace limber
