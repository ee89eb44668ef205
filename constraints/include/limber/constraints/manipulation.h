/// @file limber/constraints/manipulation.h
/// Manipulation as in [H03] section 3.4.1: points ψ are given an acceleration, a velocity or a position by forces at
/// the same or at other points φ.
///
///   f = (J_ψ D J_φᵀ)⁺ (wanted − what comes without f)                                                        (1)
///
///   level              unknown f   D of frames   D of modes   wanted less                  acts
///   kAcceleration      force       M⁻¹           1            acceleration now             over the next step
///   kVelocity          impulse     M⁻¹           1            velocity now                 now
///   kPosition          impulse     ½Δt M⁻¹       H/Δt         position at the step's end   as a force held over the step
///   kPositionImpulse   impulse     Δt M⁻¹        S(Δt)        position at the step's end   now: [H03]'s own form
///
/// The least-norm least-squares answer: redundant and conflicting wishes share. Positions are nonlinear where bodies
/// turn; (1) is repeated for what is missing. S is signed: for modes above the step's Nyquist rate kPositionImpulse is
/// a feedback that can grow without bound when it is repeated step after step.
///
/// Handles (handle.h) do what kPosition does for forces at the held points, together with joints and limits, without
/// allocation, and keep modes above the Nyquist rate still. This is for the rest. Allocates. By body ids:
/// World::manipulate.
#pragma once

#include <span>

#include "limber/constraints/material_frame.h"
#include "limber/solvers/solve_status.h"

namespace limber {

enum class ManipulationLevel { kAcceleration, kVelocity, kPosition, kPositionImpulse };

/// One direction in which a point is to do something.
struct PointWish {
  MaterialFrame point;
  Vec3 direction = Vec3::UnitX();  ///< unit, world
  double wanted = 0.0;             ///< along the direction: m/s², m/s, or the world coordinate at the step's end, m
};

/// One direction in which a force may act.
struct PointForce {
  MaterialFrame point;
  Vec3 direction = Vec3::UnitX();  ///< unit, world
};

struct ManipulationOptions {
  ManipulationLevel level = ManipulationLevel::kPosition;
  Vec3 gravity = Vec3::Zero();  ///< m/s², world
  int max_iterations = 6;       ///< of (1), for positions; ≥ 1
};

struct ManipulationResult {
  int rank = 0;           ///< of J_ψ D J_φᵀ
  double residual = 0.0;  ///< largest |wanted − reached|, unit of the wishes
};

/// Finds f and applies it to the bodies' groups.
/// @param forces where forces may act; empty: along the wishes themselves
/// @param impulses out, one per force: N for kAcceleration, N·s else
/// @throws InvalidArgument if lengths do not fit, a direction is not a unit vector, a number is not finite, bodies
/// differ in their step, or kAcceleration is asked of a body with fixed nodes
ManipulationResult manipulate(std::span<const ConstrainedBody> table, std::span<const PointWish> wishes,
                              std::span<const PointForce> forces, std::span<double> impulses,
                              const ManipulationOptions& options = {});

}  // namespace limber
