/// @file mass_properties.h
/// Mass, centre and inertia of a meshed body whose regions differ in density: exact for the polyhedron, whatever mass
/// matrix the modes use.
#pragma once

#include <span>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"

namespace limber::internal {

struct MassProperties {
  double mass = 0.0;            ///< kg
  double volume = 0.0;          ///< m³
  Vec3 center = Vec3::Zero();   ///< of mass, mesh coordinates, m
  Mat3 inertia = Mat3::Zero();  ///< about the centre of mass, mesh axes, kg·m²

  /// Parallel axes: the inertia about the point center − offset.
  Mat3 inertia_about(const Vec3& offset) const {
    return inertia + mass * (offset.squaredNorm() * Mat3::Identity() - offset * offset.transpose());
  }
};

/// @param materials one per region
MassProperties mass_properties(const TetMesh& mesh, std::span<const Material> materials);

}  // namespace limber::internal
