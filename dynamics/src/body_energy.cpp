// What the bodies of a group hold and lose.
#include "limber/dynamics/body_group.h"

namespace limber {

BodyEnergy BodyGroup::energy(Index slot, const Vec3& gravity) const {
  const bool answers = bodies_[static_cast<std::size_t>(slot)].modes_static;
  BodyEnergy energy = energy_of(frame(slot), amplitudes(slot), rates(slot),
                                answers ? static_amplitudes(slot) : std::span<const double>(), gravity);
  if (coupled(slot))
    energy.kinetic_rigid = 0.5 * constants_.mass * frame(slot).velocity().squaredNorm() +
                           coupled_[static_cast<std::size_t>(slot)]->kinetic_energy();
  return energy;
}

BodyEnergy BodyGroup::predicted_energy(Index slot, const Vec3& gravity) const {
  const Prediction& p = predictions_[static_cast<std::size_t>(slot)];
  return energy_of(p.frame, predicted_amplitudes(slot), predicted_rates(slot),
                   p.modes_static ? predicted_.answers.modes(slot) : std::span<const double>(), gravity);
}

double BodyGroup::predicted_dissipation(Index slot) const {
  const std::span<const double> z0 = amplitudes(slot), z1 = predicted_amplitudes(slot), v0 = rates(slot),
                                v1 = predicted_rates(slot), g = predicted_.forces.modes(slot);
  const bool had = bodies_[static_cast<std::size_t>(slot)].modes_static;
  const bool has = predictions_[static_cast<std::size_t>(slot)].modes_static;
  double taken = 0.0;
  for (std::size_t i = 0; i < z0.size(); ++i) {
    const double before = z0[i] - (had ? static_amplitudes(slot)[i] : 0.0);
    const double after = z1[i] - (has ? predicted_.answers.modes(slot)[i] : 0.0);
    taken += g[i] * (after - before) + 0.5 * (v0[i] * v0[i] - v1[i] * v1[i]) +
             0.5 * model_->data().eigenvalues[i] * (before * before - after * after);
  }
  return taken;
}

BodyEnergy BodyGroup::energy_of(const RigidFrame& frame, std::span<const double> z, std::span<const double> rates,
                                std::span<const double> answer, const Vec3& gravity) const {
  const Vec3 mass_times_center = constants_.mass * frame.pose().p + frame.pose().q * first_moment_of(z);
  BodyEnergy energy{.kinetic_rigid = frame.kinetic_energy(constants_),
                    .potential = -frame.settings().gravity_scale * gravity.dot(mass_times_center)};
  for (std::size_t i = 0; i < z.size(); ++i) {
    const double c = answer.empty() ? 0.0 : answer[i], vibrating = z[i] - c;
    energy.kinetic_modal += 0.5 * rates[i] * rates[i];
    energy.elastic += 0.5 * model_->data().eigenvalues[i] * (vibrating * vibrating + c * c);
  }
  return energy;
}

}  // namespace limber
