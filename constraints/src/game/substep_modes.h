// How the modes of one model go through a substep, freely and under a contact's impulse.
//
// A mode answers a force f, per unit, by ρ in its displacement and σ in its rate at the substep's end:
//
//   ρ = (1 − b) h S + b H,   σ = (1 − b) h Ṡ + b S,   b = min(1, (ω h/2)²)
//
// as to an impulse h f at the substep's start where it is slow, as to a force held over it from ω h = 2 on
// (oscillator.h has S and H). Held, the work of contacts on it in a substep is at most 0; the blend's spectral radius
// with a contact is at most 1 for all ω h. Static answers are exact for any ρ, as fixed points do not depend on it.
//
// A slow mode at rest under a steady force falls and is struck in each substep. Its rate at the substep's end is then
// κ f, the fixed point of flow and answer; nearly −(1 − b) h/2 f, half of the impulse to come.
#pragma once

#include <vector>

#include "limber/dynamics/modal_step.h"
#include "limber/model/modal_model.h"

namespace limber::internal {

class SubstepModes {
 public:
  /// Nothing where they are those already. @param h length of a substep, s
  void set(const ModalModel& model, double h);

  const ModalModel* model() const { return model_; }
  /// Freely.
  const ModalStep& flow() const { return flow_; }
  /// √ρ, m per √(N·s) and the like, one per mode, padded with zeros to whole blocks of eight.
  const std::vector<float>& roots() const { return roots_; }
  /// 1/√ρ, padded likewise.
  const std::vector<float>& inverse_roots() const { return inverse_roots_; }
  /// What a mode's rate changes by per unit of its scaled coordinate: σ/√ρ.
  const std::vector<float>& rates() const { return rates_; }
  /// Twice the energy of a mode per square of its scaled coordinate, λρ + σ²/ρ: 1 where it is slow, 2 where it is held.
  const std::vector<float>& energies() const { return energies_; }
  /// A mode's rate at rest per unit of its scaled coordinate: κ/√ρ.
  const std::vector<float>& rest_rates() const { return rest_rates_; }

 private:
  const ModalModel* model_ = nullptr;
  ModalStep flow_;
  std::vector<float> roots_, inverse_roots_, rates_, energies_, rest_rates_;
};

}  // namespace limber::internal
