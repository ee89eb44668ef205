/// Meshes compared to the last bit.
#pragma once

#include <gtest/gtest.h>

#include "limber/core/error.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber {

inline void expect_same(const TetMesh& seen, const TetMesh& expected) {
  EXPECT_EQ(seen.nodes, expected.nodes);
  EXPECT_EQ(seen.tets, expected.tets);
  EXPECT_EQ(seen.tet_region, expected.tet_region);
  ASSERT_EQ(seen.regions.size(), expected.regions.size());
  for (std::size_t r = 0; r < seen.regions.size(); ++r) {
    EXPECT_EQ(seen.regions[r].name, expected.regions[r].name);
    EXPECT_EQ(seen.regions[r].tag, expected.regions[r].tag);
  }
  ASSERT_EQ(seen.node_groups.size(), expected.node_groups.size());
  for (std::size_t g = 0; g < seen.node_groups.size(); ++g) {
    EXPECT_EQ(seen.node_groups[g].name, expected.node_groups[g].name);
    EXPECT_EQ(seen.node_groups[g].nodes, expected.node_groups[g].nodes);
  }
}

/// Three positions per triangle: what a surface is, however its vertices are numbered.
inline std::vector<Vec3> corner_positions(const SurfaceMesh& surface) {
  std::vector<Vec3> out;
  for (const Triangle& t : surface.triangles)
    for (const Index v : t) out.push_back(surface.vertices[v]);
  return out;
}

}  // namespace limber
