/// @file body_surfaces.h
/// Surfaces that move with a body's tets: dealt out to the bodies, and embedded.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "limber/mesh/surface_mesh.h"
#include "limber/model/embedding.h"
#include "limber/precompute/bake.h"

namespace limber::internal {

/// Deals the triangles of a surface of the whole input out to the bodies: each goes to the one that holds most of its
/// vertices. @return per body; none where there is no surface. @param which "render" or "collision", for messages
/// @throws InputError if a body gets no triangle
std::vector<std::optional<SurfaceMesh>> deal_if_any(const std::optional<SurfaceMesh>& surface, const TetMesh& mesh,
                                                    std::span<const Index> component, Index bodies, const char* which);

/// A surface with where its vertices sit in the mesh of one body.
struct PlacedSurface {
  SurfaceMesh surface;
  Embedding embedding;
  EmbeddingReport report() const {
    return {static_cast<Index>(surface.vertices.size()), embedding.outside, embedding.max_distance};
  }
};

struct BodySurfaces {
  PlacedSurface render;
  std::optional<PlacedSurface> collision;  // none: the render surface
  const PlacedSurface& touching() const { return collision ? *collision : render; }
};

/// A given render surface is often far finer than the tets, so what touches is then their boundary.
/// @param most_triangles of the surface that touches; 0: as many as it has
BodySurfaces place_surfaces(const TetMesh& mesh, const std::optional<SurfaceMesh>& render,
                            const std::optional<SurfaceMesh>& collision, Index most_triangles,
                            BodySurfacesReport& report);

/// A surface that lies elsewhere follows extrapolated modes: likely another unit or another origin than the mesh's.
void warn_of_far_surface(const PlacedSurface& placed, const TetMesh& mesh, const std::string& which,
                         Warnings& warnings);

}  // namespace limber::internal
