/// @file limber/mesh/surface_mesh.h
/// A triangulated surface, and the boundary of a tetrahedral mesh.
#pragma once

#include <string>
#include <vector>

#include "limber/core/types.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

/// Triangles over shared vertices; may be open, non-manifold or self-intersecting. Lengths in metres.
struct SurfaceMesh {
  std::vector<Vec3> vertices;
  std::vector<Triangle> triangles;
};

/// Checks coordinates and indices; drops triangles that name a vertex twice, with one warning that counts them.
/// Zero-area triangles of three distinct vertices stay. @throws InputError naming the first wrong element, or if
/// nothing is left.
void validate(SurfaceMesh& surface, const std::string& name, Warnings& warnings);

/// Joins vertices at equal coordinates (exactly; −0 equals 0), in order of first appearance. Triangles keep their
/// order. Unused vertices stay unless they are joined. @return how many vertices went. @pre indices are in range
Index weld(SurfaceMesh& surface);

/// The boundary of a tetrahedral mesh: faces that belong to one tet, seen from outside; of ten-node tets each is four
/// triangles over its six nodes.
struct BoundarySurface {
  SurfaceMesh surface;         ///< vertices in ascending order of their node
  std::vector<Index> node_of;  ///< per vertex, its node in the tet mesh
};
BoundarySurface boundary_surface(const TetMesh& mesh);

/// Signed volume enclosed by a closed surface, m³ (divergence theorem); meaningless for an open one.
double enclosed_volume(const SurfaceMesh& surface);

/// Integrals over the solid that a closed surface bounds; outward triangles. Meaningless for an open one.
struct SolidProperties {
  double volume = 0.0;           ///< m³
  Vec3 centroid = Vec3::Zero();  ///< m
  Mat3 inertia = Mat3::Zero();   ///< ∫ (|x|² 1 − x xᵀ) dV about the centroid, m⁵; times the density: kg·m²
};
SolidProperties solid_properties(const SurfaceMesh& surface);

/// Counts of the defects that keep a surface from bounding a solid.
struct SurfaceQuality {
  Index boundary_edges = 0;      ///< edges of one triangle
  Index non_manifold_edges = 0;  ///< edges of three or more triangles
  Index misoriented_edges = 0;   ///< edges that two triangles run through the same way
  Index components = 0;          ///< sets of triangles connected through shared vertices
  bool closed_manifold() const { return boundary_edges == 0 && non_manifold_edges == 0 && misoriented_edges == 0; }
};
SurfaceQuality surface_quality(const SurfaceMesh& surface);

}  // namespace limber
