/// @file limber/sound/modal_sound.h
/// What a kind of body sounds like, for one sample rate: immutable, shared by all its instances.
#pragma once

#include <array>
#include <complex>
#include <span>
#include <vector>

#include "limber/core/aligned_array.h"
#include "limber/core/types.h"
#include "limber/model/sound_modes.h"

namespace limber {

/// A point of the surface that was struck: in a triangle, or at one vertex with weights (1, 0, 0).
struct StruckPoint {
  std::array<Index, 3> vertices{0, 0, 0};
  std::array<double, 3> weights{1.0, 0.0, 0.0};  ///< barycentric
};

/// Modes with their gains, laid out for the synthesizer. Modes at or above half the sample rate are left out: sampled,
/// they would sound at another pitch. Modes stand in groups of eight; the last group is padded with silent ones.
class ModalSound {
 public:
  static constexpr Index kGroup = 8;

  /// @param gains what one hears per modal rate, such as monopole_gains(); one per mode
  /// @param sample_rate 1/s, 8,000 to 384,000
  /// @throws InvalidArgument as SoundModes::validate(), and for gains that are not finite or of another count
  ModalSound(const SoundModes& modes, std::span<const double> gains, double sample_rate);

  Index modes() const { return static_cast<Index>(exponents_.size()); }
  Index groups() const { return (modes() + kGroup - 1) / kGroup; }
  Index vertices() const { return vertices_; }
  double sample_rate() const { return sample_rate_; }
  double contact_modulus() const { return contact_modulus_; }  ///< SoundModes::contact_modulus, Pa

  /// s = −ξ + iω of a mode, 1/s, ω = √(λ − ξ²).
  std::complex<double> exponent(Index mode) const { return exponents_[mode]; }
  /// c, which makes of the response z to a unit impulse, c e^{st}, what one hears: Re z = gain · q̇.
  std::complex<double> output(Index mode) const { return outputs_[mode]; }
  /// wᵀ j: how an impulse j (N·s, body frame) at a point strikes a mode, kg^½·m/s.
  double excitation(Index mode, const StruckPoint& at, const Vec3& impulse) const;

  /// e^{s/rate}: [group][re × 8 | im × 8].
  const double* propagators() const { return propagators_.data(); }

 private:
  double sample_rate_, contact_modulus_;
  Index vertices_;
  std::vector<std::complex<double>> exponents_, outputs_;
  AlignedArray<double> propagators_;
  std::vector<float> shapes_;  // [vertex][mode][x, y, z]: a blow reads the rows of three vertices
};

}  // namespace limber
