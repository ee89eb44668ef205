/// @file join_slices.h
/// One spectrum from slices that were computed apart.
#pragma once

#include <span>
#include <string>

#include "eigen/eigen_body.h"
#include "eigen/elastic_modes.h"
#include "limber/precompute/spectrum_slice.h"

namespace limber::internal {

/// What a slice is of: SHA-256 of K, M and the free nodes, to the bit.
std::string fingerprint(const EigenBody& body);

/// The pairs of the slices that are of this body, in its units, ascending. Shapes of different slices are orthogonal to
/// the accuracy of each; W (WᵀMW)^−½, the nearest orthonormal set, makes them so to round-off.
/// @throws ComputationError where a slice is missing, or two overlap, disagree or hold the same mode
EigenPairs join_slices(const EigenBody& body, std::span<const SpectrumSlice> slices);

}  // namespace limber::internal
