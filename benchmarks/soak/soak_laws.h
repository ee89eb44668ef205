/// @file soak_laws.h
/// The laws that every step of the soak is held to, as far as what a World tells of a step shows them.
#pragma once

#include <array>
#include <span>

#include "limber/constraints/contact_constraint.h"
#include "limber/core/types.h"

namespace limber::testing {

enum class SoakLaw {
  kFinite,       ///< states, forces and energies are finite numbers
  kPush,         ///< a contact pushes: n · p ≥ 0
  kCone,         ///< |p_t| ≤ μ n · p
  kHandForce,    ///< a hand stays within its largest force
  kIndentation,  ///< |u| ≤ largest residual compliance × Σ |F| of the body's contacts
  kEnergy,       ///< E rises by no more than the hands' work and 1e-2 of Σ m g size
};
inline constexpr int kSoakLaws = 6;
const char* name(SoakLaw law);

/// Of one body whose model has a residual compliance.
struct SeenIndentation {
  Index body = -1;
  double largest = 0.0;     ///< of all vertices that touch, m
  double compliance = 0.0;  ///< the largest eigenvalue of a vertex's own block of it, m/N: none of its blocks has more
};

struct SeenHand {
  Vec3 force = Vec3::Zero();  ///< mean over the step, N
  double work = 0.0;          ///< on the body in the step, J
  double max_force = 0.0;     ///< along each axis, N
};

/// One step, as seen from outside.
struct SoakStep {
  double length = 1.0 / 60.0;                ///< s
  double friction = 0.5;                     ///< μ
  double weight = 0.0;                       ///< Σ m g, N
  double energy_scale = 0.0;                 ///< Σ m g size, J
  double energy_before = 0.0, energy = 0.0;  ///< of all bodies, J
  bool finite = true;                        ///< all states, and the forces of joints
  std::span<const ContactEvent> contacts{};
  std::span<const SeenIndentation> indentations{};
  std::span<const SeenHand> hands{};
};

/// How much of each law a step leaves or takes: at most 1 where the law holds. Impulses may be wrong by 1e-6 of
/// Σ m g Δt, indentations by 1e-3 of their bound, forces of hands by 1e-6 of theirs.
struct SoakShares {
  std::array<double, kSoakLaws> by_law{};
  double operator[](SoakLaw law) const { return by_law[static_cast<std::size_t>(law)]; }
};
SoakShares shares_of_laws(const SoakStep& step);

/// What the hands did on the bodies, J.
double work_of(std::span<const SeenHand> hands);

}  // namespace limber::testing
