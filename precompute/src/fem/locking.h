/// @file locking.h
/// Linear tets near ν = ½: each has one dilatation, there are more tets than nodes, and modes that should keep every
/// volume cannot.
#pragma once

#include <span>
#include <string>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"

namespace limber::internal {

/// ½ ∫ κ (div u)² dV over ½ ω², with bulk modulus κ: what part of a mode's energy changes volumes. 1 − 2ν over 3 where
/// a bar is pulled or bent.
/// @param shape 3n, mass-normalised. @param eigenvalue ω² > 0. @pre four-node tets
double dilatation_share(const TetMesh& mesh, std::span<const Material> materials, std::span<const double> shape,
                        double eigenvalue);

/// How much too high a mode's frequency is by locking, about: 1/√(1 − e) − 1 of the excess e of its share over that of
/// a bent bar of the body's largest ν.
double locking_error(double share, double poisson_ratio);

}  // namespace limber::internal
