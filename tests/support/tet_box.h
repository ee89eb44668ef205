/// @file tet_box.h
/// Structured boxes of tetrahedra for the tests.
#pragma once

#include <algorithm>
#include <array>
#include <functional>

#include "limber/mesh/tet_mesh.h"

namespace limber::testing {

/// A box [0, size] of nx × ny × nz cells, each cut into Kuhn's six tets around the diagonal from its lowest to its
/// highest corner: conforming across cells, and the nodes of the box with half the cells are among its own (nested).
/// One region, "*". Nodes run through x first, then y, then z.
inline TetMesh tet_box(int nx, int ny, int nz, const Vec3& size) {
  TetMesh mesh;
  mesh.regions = {{.name = "*"}};
  for (int k = 0; k <= nz; ++k)
    for (int j = 0; j <= ny; ++j)
      for (int i = 0; i <= nx; ++i) mesh.nodes.emplace_back(size.x() * i / nx, size.y() * j / ny, size.z() * k / nz);
  const auto node = [&](const std::array<int, 3>& at) { return at[0] + (nx + 1) * (at[1] + (ny + 1) * at[2]); };
  for (int k = 0; k < nz; ++k)
    for (int j = 0; j < ny; ++j)
      for (int i = 0; i < nx; ++i) {
        std::array<int, 3> axes{0, 1, 2};
        do {
          std::array<int, 3> at{i, j, k};
          Tet t{node(at), 0, 0, 0};
          for (int corner = 1; corner < 4; ++corner) {
            ++at[axes[corner - 1]];
            t[corner] = node(at);
          }
          mesh.tets.push_back(t);
          mesh.tet_region.push_back(0);
        } while (std::next_permutation(axes.begin(), axes.end()));
      }
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    if (signed_volume(mesh, static_cast<Index>(e)) < 0.0) std::swap(mesh.tets[e][2], mesh.tets[e][3]);
  return mesh;
}

inline TetMesh tet_box(int cells, double size) { return tet_box(cells, cells, cells, Vec3::Constant(size)); }

/// The nodes that a test holds for.
inline std::vector<Index> nodes_where(const TetMesh& mesh, const std::function<bool(const Vec3&)>& test) {
  std::vector<Index> nodes;
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if (test(mesh.nodes[i])) nodes.push_back(static_cast<Index>(i));
  return nodes;
}

}  // namespace limber::testing
