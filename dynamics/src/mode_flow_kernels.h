// The vector loops behind ExactMotion's modes at a time within the step. Raw pointers only, as in oscillator_kernels.h.
#pragma once

#include <cstddef>

namespace limber::internal {

/// The oscillators of some modes, as in Mode; any alignment.
struct Oscillators {
  const double* lambda;
  const double* decay;
  std::size_t count;
};

/// The exact flow over t of the states z, v under forces g held: at_z, at_v ← what becomes of them.
void flow_modes(const Oscillators& modes, double t, const double* z, const double* v, const double* g, double* at_z,
                double* at_v);
/// Adds what impulses j that acted a time t ago have become of.
void add_impulse_flow(const Oscillators& modes, double t, const double* j, double* at_z, double* at_v);

}  // namespace limber::internal
