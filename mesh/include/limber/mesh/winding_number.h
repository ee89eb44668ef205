/// @file limber/mesh/winding_number.h
/// Tells if a surface goes round a point, also if it has holes.
#pragma once

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// How often a surface winds around a point that is not on it: the sum of its triangles' solid angles there, over 4π.
/// A closed surface has a whole number (1 inside, 0 outside, triangles counter-clockwise seen from outside); holes make
/// it a fraction (Jacobson, Kavan, Sorkine-Hornung, ACM TOG 32(4), 2013). Solid angles after van Oosterom
/// and Strackee (IEEE Transactions on Biomedical Engineering 30(2), 1983). Time: all triangles, at each call.
double winding_number(const SurfaceMesh& surface, const Vec3& p);

}  // namespace limber
