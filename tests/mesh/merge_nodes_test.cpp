// Parts that belong together, and parts that do not.
#include "limber/mesh/merge_nodes.h"

#include <gtest/gtest.h>

#include "sample_meshes.h"

namespace limber {
namespace {

/// Two blocks of a cube each that meet at x = 1, the second off by `gap`.
TetMesh halves(double gap) {
  TetMesh mesh = samples::block(1, 1, 1, 1.0);
  const TetMesh other = samples::block(1, 1, 1, 1.0);
  for (const Vec3& p : other.nodes) mesh.nodes.emplace_back(p + Vec3(1.0 + gap, 0, 0));
  for (Tet t : other.tets) {
    for (Index& n : t) n += 8;
    mesh.tets.push_back(t);
    mesh.tet_region.push_back(0);
  }
  mesh.node_groups = {{"face", {8, 10, 12, 14}}};
  return mesh;
}

TEST(MergeNodes, HalvesOfABlockBecomeOneBody) {
  TetMesh mesh = halves(1e-9);
  EXPECT_EQ(count_touching_nodes(mesh, 1e-8), 4);
  EXPECT_EQ(count_touching_nodes(mesh, 1e-10), 0);
  EXPECT_EQ(merge_nodes(mesh, 1e-8), 4);
  Warnings warnings;
  validate(mesh, "halves", warnings);
  const auto body = connected_components(mesh);
  EXPECT_EQ(*std::max_element(body.begin(), body.end()), 0);
  EXPECT_NEAR(volume_properties(mesh).volume, 2.0, 1e-8);
  EXPECT_EQ(mesh.node_groups[0].nodes, (std::vector<Index>{1, 3, 5, 7}));
  EXPECT_EQ(mesh.nodes.size(), 16u);  // numbers of nodes stay
  EXPECT_EQ(count_touching_nodes(mesh, 1e-8), 0);
}

TEST(MergeNodes, ZeroMergesEqualCoordinatesAndNoOthers) {
  TetMesh equal = halves(0.0), near = halves(1e-15);
  EXPECT_EQ(merge_nodes(equal, 0.0), 4);
  EXPECT_EQ(merge_nodes(near, 0.0), 0);
}

TEST(MergeNodes, AcrossZeroAndOnEitherSideOfACell) {
  TetMesh mesh;
  mesh.regions = {{"0", 0}};
  mesh.nodes = {{-0.4e-6, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.4e-6, 0, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 0, -1}};
  mesh.tets = {{0, 1, 2, 3}, {4, 5, 6, 7}};
  mesh.tet_region = {0, 0};
  EXPECT_EQ(count_touching_nodes(mesh, 1e-6), 1);
  EXPECT_EQ(count_touching_nodes(mesh, 0.7e-6), 0);
}

TEST(MergeNodes, BlocksApartStayTwo) { EXPECT_EQ(count_touching_nodes(halves(0.1), 1e-6), 0); }

TEST(CrowdedFaces, AreThoseOfThreeTets) {
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, -1}, {1, 1, 1}};
  mesh.tets = {{0, 1, 2, 3}, {0, 2, 1, 4}};
  EXPECT_EQ(count_crowded_faces(mesh), 0);
  mesh.tets.push_back({0, 1, 2, 5});
  EXPECT_EQ(count_crowded_faces(mesh), 1);
}

}  // namespace
}  // namespace limber
