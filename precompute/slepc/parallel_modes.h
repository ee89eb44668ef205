/// @file parallel_modes.h
/// Modes of a body by many processes: Krylov–Schur (SLEPc), and a count by inertia that proves that none is missed.
#pragma once

#include <Eigen/Core>

#include "distributed_body.h"

namespace limber::internal {

struct ParallelModes {
  double low = 0.0, high = 0.0;  ///< ends of the interval of λ in the body's units; low = 0: above the zero modes
  int below_low = 0, below_high = 0;
  Eigen::VectorXd lambda = {};  ///< all between the ends, ascending
  Eigen::MatrixXd W = {};       ///< own rows, WᵀMW = I

  double factor_entries = 0.0, factor_flops = 0.0;  ///< of the factor that is solved with
  double factor_memory = 0.0;                       ///< estimated bytes of the process that takes most
};

/// The lowest elastic modes, at least as many as wanted, and up to a gap above them.
ParallelModes lowest_parallel_modes(DistributedBody& body, int wanted);

/// The lowest elastic modes by LOBPCG with algebraic multigrid, in memory that grows as the body does: for bodies whose
/// factor does not fit. Nothing proves that none is missed, and the counts are of those found.
ParallelModes lowest_modes_without_factor(DistributedBody& body, int wanted);

/// What the factor would take, and no modes.
ParallelModes estimated_factor(DistributedBody& body);

/// Those between two λ.
ParallelModes parallel_modes_between(DistributedBody& body, double low, double high);

}  // namespace limber::internal
