/// @file limber/model/shape.h
/// Rigid collision shapes, in the frame of the body that wears them; lengths in m.
#pragma once

#include <variant>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// All points with normal · x ≤ offset are solid.
struct HalfSpace {
  Vec3 normal = Vec3::UnitZ();  ///< unit, out of the solid
  double offset = 0.0;          ///< m
};

/// About the origin.
struct Sphere {
  double radius = 0.5;  ///< > 0
};

/// All points within `radius` of the segment from (0, 0, −half_length) to (0, 0, half_length).
struct Capsule {
  double radius = 0.5;       ///< > 0
  double half_length = 0.5;  ///< ≥ 0
};

/// |x_i| ≤ half_extents_i.
struct Box {
  Vec3 half_extents = Vec3::Constant(0.5);  ///< > 0 each
};

/// The convex hull of its points; at least four, not in one plane.
struct ConvexHull {
  std::vector<Vec3> points;
};

/// A surface that does not deform; counter-clockwise seen from outside. Closed or open: an open one is one-sided.
struct TriangleMesh {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
};

/// Heights over a regular grid in the xy plane, solid below; vertex (i, j) is at (i·spacing_x, j·spacing_y,
/// heights[j·columns + i]). Each cell is split along its diagonal from (i, j) to (i+1, j+1).
struct HeightField {
  Index columns = 2, rows = 2;              ///< ≥ 2 each
  double spacing_x = 1.0, spacing_y = 1.0;  ///< > 0
  std::vector<float> heights;               ///< columns · rows
};

using Shape = std::variant<HalfSpace, Sphere, Capsule, Box, ConvexHull, TriangleMesh, HeightField>;

/// @throws InvalidArgument naming the member, the value seen and what was expected
void validate(const Shape& shape);

}  // namespace limber
