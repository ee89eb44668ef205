#include "bake/body_surfaces.h"

#include <cmath>

#include "bake/simplify_surface.h"
#include "limber/core/error.h"

namespace limber::internal {
namespace {

std::vector<SurfaceMesh> deal(const SurfaceMesh& surface, const TetMesh& mesh, std::span<const Index> component,
                              Index bodies) {
  if (bodies == 1) return {surface};
  const Embedding whole = embed(surface.vertices, mesh);
  const auto body_of = [&](Index vertex) { return component[whole.vertices[vertex].tet]; };
  std::vector<SurfaceMesh> parts(bodies);
  std::vector<std::vector<Index>> new_index(bodies, std::vector<Index>(surface.vertices.size(), -1));
  for (const Triangle& t : surface.triangles) {
    const Index body = body_of(t[1]) == body_of(t[2]) ? body_of(t[1]) : body_of(t[0]);
    SurfaceMesh& part = parts[body];
    Triangle mapped{};
    for (int a = 0; a < 3; ++a) {
      Index& index = new_index[body][t[a]];
      if (index < 0) {
        index = static_cast<Index>(part.vertices.size());
        part.vertices.push_back(surface.vertices[t[a]]);
      }
      mapped[a] = index;
    }
    part.triangles.push_back(mapped);
  }
  return parts;
}

PlacedSurface place(const SurfaceMesh& surface, const TetMesh& mesh) {
  return {surface, embed(surface.vertices, mesh)};
}

PlacedSurface place_boundary(const TetMesh& mesh) {
  BoundarySurface boundary = boundary_surface(mesh);
  Embedding embedding = embed_nodes(boundary.node_of, mesh);
  return {std::move(boundary.surface), std::move(embedding)};
}

/// A coarser surface on some of the vertices of a finer one.
PlacedSurface simplified(const PlacedSurface& fine, std::size_t triangles, double& error) {
  SimplifiedSurface coarse = simplify_surface(fine.surface, triangles);
  error = coarse.error;
  PlacedSurface placed{std::move(coarse.surface), fine.embedding};
  placed.embedding.vertices.clear();
  for (const Index v : coarse.vertex_of) placed.embedding.vertices.push_back(fine.embedding.vertices[v]);
  return placed;
}

}  // namespace

std::vector<std::optional<SurfaceMesh>> deal_if_any(const std::optional<SurfaceMesh>& surface, const TetMesh& mesh,
                                                    std::span<const Index> component, Index bodies, const char* which) {
  std::vector<std::optional<SurfaceMesh>> out(bodies);
  if (!surface) return out;
  auto parts = deal(*surface, mesh, component, bodies);
  for (Index b = 0; b < bodies; ++b) {
    if (parts[b].triangles.empty())
      throw InputError(std::string(which) + " surface: no triangle of it lies at body " + std::to_string(b + 1) +
                       " of " + std::to_string(bodies) + ", expected it to cover every connected part of the mesh");
    out[b] = std::move(parts[b]);
  }
  return out;
}

BodySurfaces place_surfaces(const TetMesh& mesh, const std::optional<SurfaceMesh>& render,
                            const std::optional<SurfaceMesh>& collision, Index most_triangles,
                            BodySurfacesReport& report) {
  BodySurfaces s;
  s.render = render ? place(*render, mesh) : place_boundary(mesh);
  if (collision) s.collision = place(*collision, mesh);
  if (!collision && render) s.collision = place_boundary(mesh);
  if (const auto most = static_cast<std::size_t>(most_triangles);
      most > 0 && s.touching().surface.triangles.size() > most)
    s.collision = simplified(s.touching(), most, report.collision_error);
  report.collision_triangles = static_cast<Index>(s.touching().surface.triangles.size());
  return s;
}

void warn_of_far_surface(const PlacedSurface& placed, const TetMesh& mesh, const std::string& which,
                         Warnings& warnings) {
  constexpr double kFar = 0.1;  // of the diagonal of the mesh
  Eigen::AlignedBox3d box;
  for (const Vec3& x : mesh.nodes) box.extend(x);
  const double part = placed.embedding.max_distance / box.diagonal().norm();
  if (part <= kFar) return;
  warnings.push_back(which + " surface: " + std::to_string(placed.embedding.outside) + " of " +
                     std::to_string(placed.surface.vertices.size()) + " vertices lie outside the tetrahedra, up to " +
                     std::to_string(std::lround(100.0 * part)) +
                     " % of the mesh's diagonal away; are its unit and origin those of the mesh?");
}

}  // namespace limber::internal
