/// @file limber/precompute/elastic_compliance.h
/// K⁺: how a body yields to static loads, kept from a modal analysis so that its factor is used again.
#pragma once

#include <span>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// u = K⁺ f, the static displacement without the zero modes: K⁺ = P K_pin⁻¹ Pᵀ, P = 1 − N NᵀM with N the zero modes.
/// Inertia balances the part of a load on the rigid motions and mechanisms ("inertia relief").
class ElasticCompliance {
 public:
  virtual ~ElasticCompliance() = default;

  /// @param forces 3n per load, load after load, N at every node of the mesh; those at fixed nodes have no effect.
  /// @return displacements, the same shape, m; 0 at fixed nodes
  virtual std::vector<double> displacements(std::span<const double> forces) = 0;
  /// M u for displacements of the free nodes, the same shape, kg·m; 0 at fixed nodes.
  virtual std::vector<double> mass_times(std::span<const double> displacements) const = 0;
};

}  // namespace limber
