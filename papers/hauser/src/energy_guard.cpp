#include "limber/hauser/energy_guard.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "argument_checks.h"

namespace limber {
using namespace internal;  // kernels and checks

namespace {

using Numbers = std::span<const double>;

// ΔE along f₀ + s (f₁ − f₀), and the size of the terms it is summed from, which bounds its rounding.
struct Line {
  double phi0 = 0.0, phi1 = 0.0, phi2 = 0.0, size = 0.0;
  double at(double s) const { return phi0 + s * (phi1 + s * phi2); }
};

/// ΔE(f) = fᵀq + ½ fᵀQ f with Q = a A and q = c (b − g₀): both levels in one form.
Line along(const ImpulseWork& work, Numbers f1, Numbers f0) {
  Line line;
  const bool gaps = !work.gap_before.empty();
  const double a = gaps ? 2.0 / work.step : 1.0, c = gaps ? 1.0 / work.step : 1.0;
  const std::size_t m = work.b.size();
  for (std::size_t i = 0; i < m; ++i) {
    const double di = f1[i] - f0[i], qi = c * (work.b[i] - (gaps ? work.gap_before[i] : 0.0));
    double Qf = 0.0, Qd = 0.0, size = 0.0;
    for (std::size_t j = 0; j < m; ++j) {
      const double Qij = a * work.A[i * m + j];
      Qf += Qij * f0[j];
      Qd += Qij * (f1[j] - f0[j]);
      size += std::abs(Qij) * (std::abs(f0[j]) + std::abs(f1[j]));
    }
    line.phi0 += f0[i] * (qi + 0.5 * Qf);
    line.phi1 += di * (qi + Qf);
    line.phi2 += 0.5 * di * Qd;
    line.size += (std::abs(f0[i]) + std::abs(f1[i])) * (std::abs(qi) + size);
  }
  return line;
}

}  // namespace

double largest_safe_blend(double phi0, double phi1, double phi2) {
  if (phi0 + phi1 + phi2 <= 0.0) return 1.0;
  if (phi0 > 0.0) {  // no end is safe
    const double lowest = phi2 > 0.0 ? std::clamp(-0.5 * phi1 / phi2, 0.0, 1.0) : phi1 + phi2 < 0.0 ? 1.0 : 0.0;
    const double least = phi0 + lowest * (phi1 + lowest * phi2);
    if (least > 0.0) return lowest;
  }
  // φ(1) > 0 and φ ≤ 0 somewhere before: the last root is where φ rises, the one with φ′ = +√(discriminant).
  const double root = std::sqrt(std::max(phi1 * phi1 - 4.0 * phi0 * phi2, 0.0));
  const double s = phi1 >= 0.0 ? -2.0 * phi0 / (phi1 + root) : (root - phi1) / (2.0 * phi2);
  return std::clamp(s, 0.0, 1.0);
}

void EnergyGuardReport::add(const EnergyGuardResult& result) {
  ++solves;
  clamped += result.blend < 1.0;
  complementary += result.blend == 0.0;
  blend_sum += result.blend;
  energy_refused += std::max(0.0, result.energy_program) - std::max(0.0, result.energy);
}

EnergyGuardResult guard_energy(const ImpulseWork& work, Numbers f_program, Numbers f_complementary,
                               std::span<double> f) {
  const char* name = "guard_energy";
  const std::size_t m = work.b.size();
  check_length(name, "A", work.A.size(), m * m);
  check_optional_length(name, "gap_before", work.gap_before.size(), m);
  check_option(name, "step", work.gap_before.empty() || work.step > 0.0, work.step, "> 0");
  check_length(name, "f_program", f_program.size(), m);
  check_length(name, "f_complementary", f_complementary.size(), m);
  check_length(name, "f", f.size(), m);
  const Line line = along(work, f_program, f_complementary);
  // What the sums above round to is no energy: without this, forces that do no work at all would count as clamped.
  const double rounding = 4.0 * std::numeric_limits<double>::epsilon() * line.size;
  const double s = largest_safe_blend(line.phi0 - rounding, line.phi1, line.phi2);
  for (std::size_t i = 0; i < m; ++i) f[i] = (1.0 - s) * f_complementary[i] + s * f_program[i];
  return {.blend = s, .energy_program = line.at(1.0), .energy_complementary = line.phi0, .energy = line.at(s)};
}

}  // namespace limber
