// One body of a synthesizer: the state of its modes.
#pragma once

#include <complex>
#include <cstdint>
#include <memory>
#include <vector>

#include "limber/core/aligned_array.h"
#include "limber/sound/modal_sound.h"

namespace limber::internal {

/// What one hears of a body, beside its modes' free ringing, while it is struck: along · cos Ωu + across · sin Ωu.
struct ForcedPart {
  double along = 0.0, across = 0.0;
};

class RingingBody {
 public:
  explicit RingingBody(std::shared_ptr<const ModalSound> sound);

  const ModalSound& sound() const { return *sound_; }
  /// Every group that may ring; none: silent.
  std::size_t active_groups() const { return active_.size(); }
  double level() const { return level_; }
  bool touched() const { return touches_ > 0; }
  bool fading() const { return fade_ < 1.0; }
  void fade_out(double per_sample) { fade_ = per_sample; }

  /// The force of a blow sets in `age` seconds ago, or (end) ceases.
  ForcedPart begin(const StruckPoint& at, const Vec3& impulse, double contact_time, double age);
  void end(const StruckPoint& at, const Vec3& impulse, double contact_time, double age);

  /// sum[n] ← Σ Re z for `samples` samples; `lanes` is scratch of 8 numbers a sample, 64-byte aligned.
  void advance(std::size_t samples, double* lanes, double* sum);

  /// Groups that together stay below `floor` fall silent, and level() is brought up to date.
  void settle(double floor);

 private:
  /// z += sign · wᵀj c/τ Ω²/(s (s² + Ω²)) e^{s·age}, (2) of synthesizer.h
  void kick(const StruckPoint& at, const Vec3& impulse, double contact_time, double age, double sign);

  std::shared_ptr<const ModalSound> sound_;
  AlignedArray<double> z_;  // as ModalSound::propagators()
  std::vector<std::int32_t> active_;
  double level_ = 0.0, fade_ = 1.0;
  int touches_ = 0;
};

}  // namespace limber::internal
