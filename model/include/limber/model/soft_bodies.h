/// @file limber/model/soft_bodies.h
/// Bodies that bend, ready without a file: for first programs, tests and prototypes.
///
///   const auto jelly = make_soft_ball(0.3, 6, material_preset("jelly"), 12);
///   world.add_body(jelly, {.pose = {.p = {0, 0, 2}}});
///
/// A grid of cells, each cut in six linear tetrahedra, with masses at the nodes; its lowest modes by a block Krylov
/// method (B. N. Parlett, The Symmetric Eigenvalue Problem, 1998, 13.10) on (K + σM)⁻¹M, to 1e-10 of each λ; σ stands
/// for the rigid motions, which are kept out exactly. Linear tetrahedra are too stiff where few cells span what bends:
/// a bar of two cells across rings a fifth too high, of four a twentieth; a ball of six cells twists within 1 %.
/// limber-precompute bakes quadratic ones, certifies that no mode is missed, and makes all else that an asset may hold.
///
/// A ball of six cells, 343 nodes, takes a tenth of a second; a thousand nodes take up to half a second.
#pragma once

#include <array>
#include <memory>

#include "limber/model/material.h"
#include "limber/model/modal_model.h"

namespace limber {

/// A free box about its middle, with a volume block.
/// @param half_extents m, > 0 @param cells along each axis, ≥ 1 @param modes the lowest so many, ≥ 1; at most a third
/// of the nodes' degrees of freedom
/// @param damping_ratio ζ of each mode, ≥ 0; 1 is critical
/// @throws InvalidArgument naming what is out of range
std::shared_ptr<const ModalModel> make_soft_box(const Vec3& half_extents, const std::array<Index, 3>& cells,
                                                const Material& material, int modes, double damping_ratio = 0.02);

/// A free ball: the cube of so many cells, drawn onto the ball ring by ring.
/// @param radius m, > 0 @param cells across, ≥ 2
std::shared_ptr<const ModalModel> make_soft_ball(double radius, Index cells, const Material& material, int modes,
                                                 double damping_ratio = 0.02);

}  // namespace limber
