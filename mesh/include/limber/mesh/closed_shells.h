/// @file limber/mesh/closed_shells.h
/// Which way the triangles of closed shells run.
#pragma once

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// Turns the closed shells whose triangles run the wrong way round. A shell is what hangs together by edges; vertices
/// at equal coordinates count as one. Shells bound solids by the even-odd rule: one that lies in no other runs
/// counter-clockwise seen from outside, one inside it is a cavity and runs the other way. Shells that are open,
/// non-manifold or of mixed orientation stay, and hold nothing. @return how many shells were turned
/// @pre the surface is valid (see validate())
Index turn_shells_outward(SurfaceMesh& surface);

}  // namespace limber
