/// @file bar_model.h
/// The free elastic bar of impact theory, with its modes in closed form: no mesh, no Poisson effect, no dispersion.
///
///   ρA ü = EA u″ along x,   λ_i = (iπc/L)²,   w_i = √(2/m) cos(iπ(x/L + ½)) e_x,   i = 1 … k
///
/// Length and wave speed are 1, so a bar that strikes a rigid wall end on is in contact for T = 2L/c = 2 and leaves it
/// as fast as it came. Residual compliance: Σ_{i>k} w_i w_iᵀ/λ_i, from Σ 1/i² = π²/6 and Σ (−1)^i/i² = −π²/12.
#pragma once

#include <memory>
#include <numbers>

#include "limber/model/modal_model.h"

namespace limber::testing {

inline constexpr double kBarLength = 1.0, kBarWidth = 0.1, kBarMass = 1.0, kBarContactTime = 2.0;

/// Between the ends (`same`: an end and itself) of a bar with k modes, m/N.
inline double bar_residual_compliance(int modes, bool same) {
  constexpr double kPiSquared = std::numbers::pi * std::numbers::pi;
  double rest = same ? kPiSquared / 6.0 : -kPiSquared / 12.0;
  for (int i = 1; i <= modes; ++i) rest -= (same || i % 2 == 0 ? 1.0 : -1.0) / (i * i);
  return 2.0 * kBarLength * kBarLength / (kBarMass * kPiSquared) * rest;
}

inline ModalModelData bar_data(int modes, bool residual_compliance) {
  ModalModelData d;
  d.name = "bar";
  d.mass = kBarMass;
  d.volume = kBarLength * kBarWidth * kBarWidth;
  const double across = kBarMass / 12.0 * (kBarLength * kBarLength + kBarWidth * kBarWidth);
  d.inertia = Vec3(kBarMass / 6.0 * kBarWidth * kBarWidth, across, across).asDiagonal();
  for (int corner = 0; corner < 8; ++corner)
    d.render.rest.push_back(Vec3(0.5 * kBarLength * ((corner & 1) ? 1.0 : -1.0),
                                 0.5 * kBarWidth * ((corner & 2) ? 1.0 : -1.0),
                                 0.5 * kBarWidth * ((corner & 4) ? 1.0 : -1.0))
                                .cast<float>());
  d.render.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                        {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  d.render.basis = ModalBasis(8, modes);
  for (int i = 1; i <= modes; ++i) {
    const double wave_number = i * std::numbers::pi / kBarLength, end = i % 2 == 0 ? 1.0 : -1.0;
    const double shape = std::sqrt(2.0 / kBarMass);
    d.eigenvalues.push_back(wave_number * wave_number);
    d.decays.push_back(0.0);
    d.participation.push_back(Vec3::Zero());
    Mat3 moment = Mat3::Zero();  // ∫ρ x cos(iπ(x/L + ½)) dx = m/L (end − 1)/(iπ/L)²
    moment(0, 0) = shape * kBarMass / kBarLength * (end - 1.0) / (wave_number * wave_number);
    d.moments.push_back(moment);
    for (Index v = 0; v < 8; ++v)
      d.render.basis.set(v, i - 1, Vec3((v & 1) ? end * shape : shape, 0.0, 0.0).cast<float>());
  }
  if (!residual_compliance) return d;
  ResidualCompliance G(ResidualCompliance::Form::kFull, 8);
  for (Index a = 0; a < 8; ++a)
    for (Index b = 0; b <= a; ++b) {
      Mat3 block = Mat3::Zero();
      block(0, 0) = bar_residual_compliance(modes, (a & 1) == (b & 1));
      G.set(a, b, block);
    }
  d.residual_compliance = std::move(G);
  return d;
}

inline std::shared_ptr<const ModalModel> bar_model(int modes, bool residual_compliance) {
  return std::make_shared<const ModalModel>(bar_data(modes, residual_compliance));
}

}  // namespace limber::testing
