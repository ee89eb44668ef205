/// @file limber/collision/shape_surface.h
/// Rigid shapes as triangles to look at, for those who draw scenes.
#pragma once

#include "limber/core/rigid_transform.h"
#include "limber/model/shape.h"

namespace limber {

/// Triangles of a shape's surface, in its own frame; round ones in 32 parts around. A half-space, which has no end, is
/// a square in its plane.
/// @param about the square's middle is the point of the plane nearest to this, shape frame, m
/// @param half_side of the square, m; > 0
TriangleMesh surface_of(const Shape& shape, const Vec3& about, double half_side);

}  // namespace limber
