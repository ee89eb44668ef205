/// @file limber/dynamics/body_energy.h
#pragma once

namespace limber {

/// Mechanical energy of one body, J.
struct BodyEnergy {
  double kinetic_rigid = 0.0;  ///< translation and rotation of the frame
  double potential = 0.0;      ///< −m g·x of the centre of mass, deformed; 0 at the world's origin
  double kinetic_modal = 0.0;  ///< ½ Σ ż²
  /// ½ Σ λ z²; of modes above the step's Nyquist rate ½ Σ λ((z − c)² + c²), c their static answer to constraints
  double elastic = 0.0;
  double total() const { return kinetic_rigid + potential + kinetic_modal + elastic; }
};

}  // namespace limber
