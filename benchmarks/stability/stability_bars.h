/// @file stability_bars.h
/// The bars of the stability cases: mesh, material, bake.
#pragma once

#include <memory>

#include "limber/mesh/tet_mesh.h"
#include "limber/model/material.h"
#include "limber/model/modal_model.h"
#include "limber/precompute/fem.h"
#include "stability_scenes.h"

namespace limber::testing {

inline const Vec3 kBarSize{0.3, 0.1, 0.1};  ///< of a bar of size 1, m

TetMesh bar_mesh(const StabilityCase& at);
/// @param weight times the density, and the stiffness with it, so that the frequencies stay
Material bar_material(const StabilityCase& at, double weight);
/// With a volume block. @param mass kConsistent: the nodes have the inertia by which the frame turns
std::shared_ptr<const ModalModel> baked_bar(const StabilityCase& at, double weight, MassKind mass);

}  // namespace limber::testing
