/// @file closed_forms.h
/// Closed forms, without a mesh: bars, beams and plates of a length L, a cross-section A with second moment I,
/// thickness t, Young's modulus E, Poisson's ratio ν, density ρ. SI units.
#pragma once

#include <array>
#include <cmath>
#include <numbers>

namespace limber::testing {

/// Waves in a thin bar, m/s.
inline double bar_wave_speed(double E, double rho) { return std::sqrt(E / rho); }

/// Stretching modes of a free bar: f_n = n c/(2L), n = 1, 2, …, Hz.
inline double ringing_bar_hz(int n, double L, double E, double rho) { return n * bar_wave_speed(E, rho) / (2.0 * L); }

/// How long a bar that flies end on stays at a rigid wall, 2L/c, s. It leaves as fast as it came, without vibration.
inline double bar_contact_time(double L, double E, double rho) { return 2.0 * L / bar_wave_speed(E, rho); }

/// By how much each end of a bar that spins about its middle at ω moves outwards: σ = ρω²(a² − x²)/2 with a = L/2, so
/// u(a) = ρω²a³/(3E), small strains, m.
inline double spinning_bar_stretch(double L, double E, double rho, double omega) {
  return rho * omega * omega * std::pow(0.5 * L, 3) / (3.0 * E);
}

/// Bending modes of a beam clamped at one end (cos β cosh β = −1), Euler and Bernoulli, Hz. @param n 1 … 3
inline double clamped_beam_hz(int n, double L, double E, double rho, double A, double I) {
  constexpr std::array kBeta{1.8751040687, 4.6940911330, 7.8547574382};
  const double k = kBeta[static_cast<std::size_t>(n - 1)] / L;
  return k * k * std::sqrt(E * I / (rho * A)) / (2.0 * std::numbers::pi);
}

/// The tip of a beam clamped at the other end under a small force P, with shear (Timoshenko, κ = 5/6), m.
inline double tip_deflection(double P, double L, double E, double nu, double A, double I) {
  return P * L * L * L / (3.0 * E * I) + P * L / (5.0 / 6.0 * E / (2.0 * (1.0 + nu)) * A);
}

/// The elastica: where the tip of an inextensible beam goes under a dead force P across it, α = P L²/(E I). EI θ″ = −P
/// cos θ, θ(0) = 0, θ′(L) = 0, by shooting; over L.
struct ElasticaTip {
  double across = 0.0, along = 0.0;  ///< displacement with the force, and back towards the clamp
};
inline ElasticaTip elastica_tip(double alpha) {
  constexpr int kParts = 2000;
  const auto shoot = [&](double curvature, ElasticaTip* tip) {
    double theta = 0.0, rate = curvature, across = 0.0, along = 0.0;
    constexpr double ds = 1.0 / kParts;
    for (int i = 0; i < kParts; ++i) {  // the midpoint rule
      const double middle = theta + 0.5 * ds * rate, middle_rate = rate - 0.5 * ds * alpha * std::cos(theta);
      across += ds * std::sin(middle), along += ds * std::cos(middle);
      theta += ds * middle_rate, rate -= ds * alpha * std::cos(middle);
    }
    if (tip != nullptr) *tip = {across, 1.0 - along};
    return rate;
  };
  double low = 0.0, high = alpha;  // of the curvature at the clamp: the moment is at most P L
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (shoot(middle, nullptr) > 0.0 ? high : low) = middle;
  }
  ElasticaTip tip;
  shoot(low, &tip);
  return tip;
}

/// A blow J on an infinite thin plate, spread as a Gaussian of variance s² along each axis; the mean displacement of
/// what was struck, weighted alike, at time τ after it: J/(8 √(D ρ t)) · (2/π) atan(√(D/(ρ t)) τ/s²), D = E t³/(12(1 −
/// ν²)). It goes to its limit and stays there: ∫ e^(−k² s²) sin(a k² τ)/(a k²) k dk/(2π) over all wave numbers, a =
/// √(D/(ρ t)). m
inline double struck_plate_displacement(double J, double t, double E, double nu, double rho, double s, double tau) {
  const double D = E * t * t * t / (12.0 * (1.0 - nu * nu)), speed = std::sqrt(D / (rho * t));
  return J / (8.0 * std::sqrt(D * rho * t)) * 2.0 / std::numbers::pi * std::atan(speed * tau / (s * s));
}

}  // namespace limber::testing
