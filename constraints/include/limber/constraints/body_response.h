/// @file limber/constraints/body_response.h
/// How one body answers a generalised impulse: its velocities at once, its place at the step's end.
///
///   Δv = M⁻¹ Jᵀf                    velocity level
///   Δx = G Jᵀf                      end-of-step level: G = θΔt M⁻¹ for the frame, diag(H/Δt) for the modes
///
/// Both are diagonal in the degrees of freedom used here: translation along the world's axes, rotation about the body's
/// principal axes (a body on a line: about the line), amplitudes. So J D Jᵀ of any rows is a sum of squares, positive
/// semidefinite for every step, stiffness and damping. Which degrees of freedom there are depends on the frame:
///
///   kFree 3 + 3 + k,   kPoint 0 + 3 + k,   kLine 0 + 1 + k,   kKinematic 0 + 0 + k,   the world (body −1) none
///
/// Modes above the step's Nyquist rate answer by 1/(λΔt) at the end of the step and not at all at velocity level
/// (modal_step.h). Derivation: docs/derivations/constraints.md.
#pragma once

#include <span>

#include "limber/dynamics/body_group.h"

namespace limber {

/// Names one body of a group. A table of these, indexed by the body numbers that rows use, is how constraints see a
/// scene. An entry without a group does not move: it stands at `pose`.
struct ConstrainedBody {
  BodyGroup* group = nullptr;
  Index slot = 0;
  RigidTransform pose{};  ///< X_WB, where there is no group
};

/// The degrees of freedom of one body at one instant, and what they weigh.
struct BodyResponse {
  int translations = 0, rotations = 0, modes = 0;
  double inverse_mass = 0.0;               ///< 1/kg
  Vec3 inverse_moments = Vec3::Zero();     ///< about `axes`, 1/(kg·m²); the first `rotations` count
  Mat3 axes = Mat3::Identity();            ///< columns: the rotation axes, world; the first `rotations` count
  std::span<const double> position_modes;  ///< H/Δt or 1/(λΔt) per mode, s
  std::span<const double> velocity_modes;  ///< 1 per mode, 0 above the Nyquist rate

  int size() const { return translations + rotations + modes; }

  /// Adds one side of a row of J in these degrees of freedom. @param row size() numbers
  void add_row(const Vec3& linear, const Vec3& angular, std::span<const double> modal, double* row) const;
  /// D at the end of the step, s/kg and so on. @param theta of the frame's impulses: 1 all at the step's start, ½ half
  /// there and half at its end. @param metric size() numbers
  void write_position_metric(double step, double theta, double* metric) const;
  /// D of the velocities. @param metric size() numbers
  void write_velocity_metric(double* metric) const;
  /// D of the frame's velocities alone: 0 for the modes.
  void write_frame_metric(double* metric) const;
};

/// The response of a body as it stands at a pose. Does not allocate or throw.
/// @param modes how they go through the step; kept by reference
BodyResponse body_response(const BodyGroup& group, const Quaternion& q_WB, const ModalStep& modes);

}  // namespace limber
