/// @file limber/sound/radiation.h
/// From the motion of a surface to the pressure in the air: how loud each mode is.
#pragma once

#include <span>
#include <vector>

#include "limber/core/types.h"
#include "limber/model/sound_modes.h"

namespace limber {

struct Air {
  double density = 1.204;  ///< ρ, kg/m³, > 0: at 20 °C
  double speed = 343.2;    ///< c of sound, m/s, > 0
};

/// Pressure amplitude at one metre per modal rate q̇, Pa·m/(kg^½·m/s), one number per mode. A mode radiates as a
/// pulsating sphere of the surface's area whose speed is the root mean square of the mode's normal velocity:
///
///   p r = ρ c √(σ S/4π) q̇,   S = ∫ (w·n)² dA,   σ = (ka)²/(1 + (ka)²),   k = √λ/c,   4πa² = A
///
/// σ is the radiation efficiency of that sphere [Kinsler and others, Fundamentals of Acoustics, section 7.1]; at low
/// ka this is the monopole ρ Q̇/4π of volume velocity Q = A v_rms. The normal velocity was taken, not the volume
/// velocity ∫ w·n dA: that is zero for a bar or a bell that bends, which one hears well. Modes whose parts cancel
/// (dipoles and higher) come out too loud where ka is below their order. Directions are left out.
/// @param rest vertices of the surface that `modes` has shapes at, m. @param triangles of the same; closed
/// @throws InvalidArgument for counts that do not fit, a triangle that names no vertex, a surface without area
std::vector<double> monopole_gains(const SoundModes& modes, std::span<const Vec3f> rest,
                                   std::span<const Triangle> triangles, const Air& air = {});

/// Speed of one vertex along a direction per modal rate, kg^−½: the motion itself, before radiation.
/// @param direction unit, body frame
/// @throws InvalidArgument for a vertex that is none
std::vector<double> point_velocity_gains(const SoundModes& modes, Index vertex, const Vec3& direction);

}  // namespace limber
