#include "limber/dynamics/oscillator.h"

#include <cmath>
#include <string>

#include "limber/core/error.h"
#include "limber/core/exact_math.h"
#include "oscillator_kernels.h"

namespace limber {
namespace {

using internal::advance_blocks;
using internal::advance_blocks_free;
using internal::kBlockModes;
using internal::kVv;
using internal::kVz;
using internal::kZg;
using internal::kZv;
using internal::kZz;

static_assert(PropagatorTable::kPad == Index{kBlockModes});

/// No intermediate result below overflows or becomes NaN for arguments up to here.
constexpr double kLargest = 1e100;

void require_in_range(double value, const char* name) {
  if (!(value >= 0.0 && value <= kLargest))
    throw InvalidArgument("propagator: " + std::string(name) + " is " + std::to_string(value) +
                          ", expected a number from 0 to 1e100");
}

// Underdamped and critical, δ² = −ω_d² ≤ 0. With a = ξh, θ = ω_d h:
//   C = e^{−a} cos θ,  S = e^{−a} h sinc θ
//   λH = 1 − C − ξS = (1 − (1 + a)e^{−a}) + e^{−a}((1 − cos θ) + a(1 − sinc θ)),      every term ≥ 0
ModePropagator oscillating(double lambda, double xi, double delta_squared, double h) {
  const double theta = std::sqrt(-delta_squared) * h, a = xi * h;
  const double e = std::exp(-a), C = e * std::cos(theta), S = e * h * sinc(theta);
  const double damped = lambda > 0.0 ? xi * xi / lambda : 0.0;          // ξ²/λ
  const double elastic = lambda > 0.0 ? -delta_squared / lambda : 1.0;  // ω_d²/λ
  const double y = theta * theta;
  const double H = h * h * (damped * decay_ramp(a) + elastic * e * (stumpff_c2(y) + a * stumpff_c3(y)));
  return {C + xi * S, S, -lambda * S, C - xi * S, H, S};
}

// H of two real decay rates r₁ < r₂, which is the integral of S. Three forms, each where it does not cancel.
double held_response(double lambda, double xi, double delta_squared, double h, double r1, double r2, double z_z) {
  if (r1 * h >= 1.0) return (1.0 - z_z) / lambda;  // z_z ≤ (1 + r₁h)e^{−r₁h} ≤ 0.74
  if (r2 >= 3.0 * r1) return h * h * (r2 * decay_second(r2 * h) - r1 * decay_second(r1 * h)) / (r2 - r1);
  // Near critical, hence a = ξh < 2 and δh < 1: the oscillating form with θ² < 0.
  const double a = xi * h, y = -delta_squared * h * h;
  return h * h *
         (xi * xi / lambda * decay_ramp(a) -
          delta_squared / lambda * std::exp(-a) * (stumpff_c2(y) + a * stumpff_c3(y)));
}

// Overdamped, δ² > 0: decay rates r₁ = λ/(ξ + δ) (never as ξ − δ, which cancels) and r₂ = ξ + δ. Written from e^{−r₁h}
// alone, the slower decay, nothing overflows and nothing is divided by δ:
//   S = e^{−r₁h} (1 − e^{−2δh})/2δ,  C + ξS = e^{−r₁h} + r₁S,  C − ξS = e^{−r₂h} − r₁S
ModePropagator decaying(double lambda, double xi, double delta_squared, double h) {
  const double delta = std::sqrt(delta_squared), r2 = xi + delta, r1 = lambda / r2;
  const double slow = std::exp(-r1 * h), fast = std::exp(-r2 * h);
  const double S = slow * h * decay_mean(2.0 * delta * h);
  const double z_z = slow + r1 * S;
  return {z_z, S, -lambda * S, fast - r1 * S, held_response(lambda, xi, delta_squared, h, r1, r2, z_z), S};
}

}  // namespace

ModePropagator propagator(const Mode& mode, double h) {
  require_in_range(mode.lambda, "lambda");
  require_in_range(mode.decay, "decay");
  require_in_range(h, "h");
  const double delta_squared = std::fma(mode.decay, mode.decay, -mode.lambda);  // one rounding: right next to critical
  return delta_squared > 0.0 ? decaying(mode.lambda, mode.decay, delta_squared, h)
                             : oscillating(mode.lambda, mode.decay, delta_squared, h);
}

ModeState impulse_response(const Mode& mode, double remaining, double j) {
  return advance(propagator(mode, remaining), {.z = 0.0, .zdot = j});
}

void PropagatorTable::set(std::span<const double> lambda, std::span<const double> decay, double h) {
  if (lambda.size() != decay.size())
    throw InvalidArgument("PropagatorTable: " + std::to_string(lambda.size()) + " lambdas and " +
                          std::to_string(decay.size()) + " decays, expected as many of each");
  require_in_range(h, "h");
  modes_ = static_cast<Index>(lambda.size());
  step_ = h;
  blocks_.assign(static_cast<std::size_t>(padded() / kPad), Block{});
  for (Index mode = 0; mode < modes_; ++mode) {
    const ModePropagator p = propagator({lambda[mode], decay[mode]}, h);
    auto& c = blocks_[mode / kPad].coefficients;
    const Index lane = mode % kPad;
    c[kZz][lane] = p.z_z, c[kZv][lane] = p.z_zdot, c[kVz][lane] = p.zdot_z, c[kVv][lane] = p.zdot_zdot;
    c[kZg][lane] = p.z_g;
  }
}

ModePropagator PropagatorTable::at(Index mode) const {
  const auto& c = blocks_[mode / kPad].coefficients;
  const Index lane = mode % kPad;
  return {c[kZz][lane], c[kZv][lane], c[kVz][lane], c[kVv][lane], c[kZg][lane], c[kZv][lane]};
}

void PropagatorTable::advance(double* z, double* zdot, const double* g) const {
  advance_blocks(coefficients(), blocks_.size(), z, zdot, g);
}

void PropagatorTable::advance_free(double* z, double* zdot) const {
  advance_blocks_free(coefficients(), blocks_.size(), z, zdot);
}

}  // namespace limber
