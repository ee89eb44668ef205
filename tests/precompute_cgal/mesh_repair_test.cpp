// What is done to a mesh once it is made: flat tets peeled, touching edges opened.
#include <gtest/gtest.h>

#include "flat_tets.h"
#include "limber/mesh/surface_mesh.h"
#include "pinched_edges.h"

namespace limber {
namespace {

TEST(FlatTets, OneInTheBoundaryIsPeeledAndFlipsAnEdge) {
  // A pyramid of two tets over a square whose diagonal is 0-2, and a flat tet below it that makes the diagonal 1-3.
  TetMesh mesh;
  mesh.nodes = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0.5, 0.5, 1}};
  mesh.tets = {{0, 1, 2, 4}, {0, 2, 3, 4}, {0, 1, 3, 2}};
  EXPECT_EQ(internal::worst_shape(mesh), 0.0);
  EXPECT_EQ(internal::peel_flat_tets(mesh, 0.01), 1);
  EXPECT_EQ(mesh.tets, (std::vector<Tet>{{0, 1, 2, 4}, {0, 2, 3, 4}}));
  EXPECT_TRUE(surface_quality(boundary_surface(mesh).surface).closed_manifold());
}

TEST(FlatTets, TheRegularTetHasShapeOneAndStays) {
  TetMesh mesh;
  mesh.nodes = {{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}};
  mesh.tets = {{0, 1, 2, 3}};
  EXPECT_NEAR(std::abs(internal::worst_shape(mesh)), 1.0, 1e-15);
  EXPECT_EQ(internal::peel_flat_tets(mesh, -2.0), 0);
}

TEST(PinchedEdges, TetsThatShareAnEdgeAloneGetOneEach) {
  TetMesh mesh;  // one on each side of the edge 0-1
  mesh.nodes = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
  mesh.tets = {{0, 2, 3, 1}, {0, 4, 5, 1}};
  EXPECT_EQ(surface_quality(boundary_surface(mesh).surface).non_manifold_edges, 1);
  EXPECT_EQ(internal::open_pinched_edges(mesh), 1);
  EXPECT_EQ(mesh.tets.size(), 3u);
  EXPECT_TRUE(surface_quality(boundary_surface(mesh).surface).closed_manifold());
  double volume = 0.0;
  for (Index i = 0; i < 3; ++i) {
    EXPECT_GT(signed_volume(mesh, i), 0.0);
    volume += signed_volume(mesh, i);
  }
  EXPECT_DOUBLE_EQ(volume, 1.0 / 3.0);
}

}  // namespace
}  // namespace limber
