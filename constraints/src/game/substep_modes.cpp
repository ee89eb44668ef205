#include "substep_modes.h"

#include <algorithm>
#include <cmath>

#include "../tuning.h"
#include "limber/dynamics/oscillator.h"

namespace limber::internal {
namespace {

/// The end-of-substep answer to a unit of contact force over the substep.
struct ModeAnswer {
  double displacement = 0.0, rate = 0.0;
  double rest_rate = 0.0;  // κ, under a steady force
};

constexpr double kLeastAnswer = kConstraintsTuning.small_steps.least_answer;

ModeAnswer answer_of(const Mode& mode, double h) {
  const ModePropagator p = propagator(mode, h);
  const double held = std::min(1.0, 0.25 * mode.lambda * h * h), struck = 1.0 - held;
  const double least = kLeastAnswer * (mode.lambda * h * h > 1.0 ? 1.0 / mode.lambda : h * h);
  // (ρ, σ) is (I − flow) times the fixed point. Its part of a held force is at rest; λ goes from the other.
  const double S = p.z_zdot, H = p.z_g, fallen = H * (1.0 - p.zdot_zdot) + S * S;
  return {.displacement = std::max(struck * h * S + held * H, least),
          .rate = struck * h * p.zdot_zdot + held * p.zdot_g,
          .rest_rate = struck > 0.0 ? struck * h * (H * p.zdot_zdot - S * S) / fallen : 0.0};
}

}  // namespace

void SubstepModes::set(const ModalModel& model, double h) {
  if (model_ == &model && flow_.length() == h) return;
  model_ = &model;
  const ModalModelData& data = model.data();
  flow_.set(data.eigenvalues, data.decays, h, ModalStep::kNone);
  const std::size_t modes = data.eigenvalues.size(), padded = (modes + 7) / 8 * 8;
  for (std::vector<float>* numbers : {&roots_, &inverse_roots_, &rates_, &energies_, &rest_rates_})
    numbers->assign(padded, 0.0f);
  for (std::size_t i = 0; i < modes; ++i) {
    const ModeAnswer answer = answer_of({data.eigenvalues[i], data.decays[i]}, h);
    const double root = std::sqrt(answer.displacement);
    roots_[i] = static_cast<float>(root);
    inverse_roots_[i] = static_cast<float>(1.0 / root);
    rates_[i] = static_cast<float>(answer.rate / root);
    rest_rates_[i] = static_cast<float>(answer.rest_rate / root);
    energies_[i] =
        static_cast<float>(data.eigenvalues[i] * answer.displacement + answer.rate * answer.rate / answer.displacement);
  }
}

}  // namespace limber::internal
