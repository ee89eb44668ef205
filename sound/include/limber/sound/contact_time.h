/// @file limber/sound/contact_time.h
/// How long two bodies touch as one strikes the other: what makes a blow bright or dull.
///
/// Hertz's collision of two elastic bodies that meet at speed v [Johnson, Contact Mechanics, 1985, section 11.4]:
///
///   τ = 2.87 (m² / (R E² v))^⅕                                          (1)
///   1/m = 1/m_a + 1/m_b,   1/R = 1/R_a + 1/R_b,   1/E = 1/E_a + 1/E_b
///
/// It holds where the bodies' own waves are faster than the blow. Steel balls of 10 mm at 1 m/s: 0.04 ms.
#pragma once

#include "limber/core/types.h"

namespace limber {

/// One of two bodies that meet. The defaults are those of rigid flat ground.
struct StrikeSide {
  double mass = kUnbounded;  ///< m, kg, > 0: what the contact feels, 1/(1/M + (r × n)ᵀ I⁻¹ (r × n)) for a free body
  double radius = kUnbounded;   ///< R of the surface at the contact, m, > 0
  double modulus = kUnbounded;  ///< E/(1−ν²), Pa, > 0
};

/// τ of (1), s.
/// @param speed v at which they meet along the normal, m/s, > 0
/// @throws InvalidArgument for numbers out of range, and where mass, radius or modulus is infinite on both sides
double contact_time(const StrikeSide& a, const StrikeSide& b, double speed);

}  // namespace limber
