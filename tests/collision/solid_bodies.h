// Bodies that are tetrahedra all through, for the overlap methods that need a volume.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "contact_bodies.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"
#include "wavy_model.h"

namespace limber::testing {

/// A box about the origin, `cells` of it along each axis, each cut in six tetrahedra along its diagonal (Kuhn).
inline TetMesh solid_box(const Vec3& half_extents, const std::array<Index, 3>& cells) {
  TetMesh mesh;
  const auto node = [&](const std::array<Index, 3>& at) {
    return at[0] + (cells[0] + 1) * (at[1] + (cells[1] + 1) * at[2]);
  };
  std::array<Index, 3> at{};
  for (at[2] = 0; at[2] <= cells[2]; ++at[2])
    for (at[1] = 0; at[1] <= cells[1]; ++at[1])
      for (at[0] = 0; at[0] <= cells[0]; ++at[0]) {
        Vec3 p;
        for (std::size_t i = 0; i < 3; ++i) p[static_cast<int>(i)] = 2.0 * at[i] / cells[i] - 1.0;
        mesh.nodes.push_back(p.cwiseProduct(half_extents));
      }
  for (at[2] = 0; at[2] < cells[2]; ++at[2])
    for (at[1] = 0; at[1] < cells[1]; ++at[1])
      for (at[0] = 0; at[0] < cells[0]; ++at[0]) {
        std::array<std::size_t, 3> order{0, 1, 2};
        do {
          Tet tet{};
          std::array<Index, 3> corner = at;
          for (std::size_t i = 0; i < 4; ++i) {
            tet[i] = node(corner);
            if (i < 3) ++corner[order[i]];
          }
          mesh.tets.push_back(tet);
          if (signed_volume(mesh, static_cast<Index>(mesh.tets.size()) - 1) < 0.0)
            std::swap(mesh.tets.back()[2], mesh.tets.back()[3]);
        } while (std::next_permutation(order.begin(), order.end()));
      }
  return mesh;
}

/// The cube of solid_box() drawn onto the ball.
inline TetMesh tet_ball(double radius, Index cells) {
  TetMesh mesh = solid_box(Vec3::Ones(), {cells, cells, cells});
  for (Vec3& p : mesh.nodes)
    if (p.norm() > 0.0) p *= radius * p.cwiseAbs().maxCoeff() / p.norm();
  return mesh;
}

/// With waves for modes; the surface is the boundary of the volume.
inline ModalModelData solid_data(const TetMesh& mesh, Index modes = 0) {
  const BoundarySurface boundary = boundary_surface(mesh);
  ModalModelData data = wavy_data(boundary.surface, modes);
  double size = 0.0;
  for (const Vec3& p : boundary.surface.vertices) size = std::max(size, p.cwiseAbs().maxCoeff());
  ModalVolume volume;
  volume.rest = mesh.nodes, volume.tets = mesh.tets;
  const auto nodes = static_cast<Index>(mesh.nodes.size());
  volume.basis = ModalBasis(nodes, modes), volume.mass_times_basis = ModalBasis(nodes, modes);
  for (Index v = 0; v < nodes; ++v)
    for (Index i = 0; i < modes; ++i)
      volume.basis.set(v, i, wavy_shape(mesh.nodes[static_cast<std::size_t>(v)], size, i).cast<float>());
  data.volume_block = std::move(volume);
  return data;
}

inline std::shared_ptr<const ModalModel> solid(const TetMesh& mesh, Index modes = 0) {
  return std::make_shared<const ModalModel>(solid_data(mesh, modes));
}

inline Body body_of(const TetMesh& mesh, Index modes = 0) {
  Body body(solid(mesh, modes));
  body.use_volume();
  return body;
}

}  // namespace limber::testing
