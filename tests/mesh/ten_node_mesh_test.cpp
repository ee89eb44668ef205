// Ten-node tets: shape functions, what files of each format give, and what is refused.
#include <gtest/gtest.h>

#include <numeric>
#include <sstream>

#include "limber/mesh/read_mesh.h"
#include "limber/mesh/ten_node_tet.h"
#include "limber/mesh/write_mesh.h"
#include "mesh_files.h"
#include "same_mesh.h"
#include "sample_meshes.h"

namespace limber {
namespace {

using samples::Folder;

/// Edges by corners in the order in which a format has their middles, as its manual draws them.
using EdgeOrder = std::array<std::array<int, 2>, 6>;
constexpr EdgeOrder kGmsh{{{0, 1}, {1, 2}, {2, 0}, {3, 0}, {3, 2}, {3, 1}}};
constexpr EdgeOrder kVtkAndMedit{{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};
constexpr EdgeOrder kTetgen{{{2, 3}, {0, 3}, {0, 1}, {1, 2}, {1, 3}, {0, 2}}};

TetMesh ten_node_cubes() {
  TetMesh mesh = samples::block(1, 1, 2, 0.1);
  add_mid_edge_nodes(mesh);
  return mesh;
}

/// The ten nodes of a tet, counted from `first`.
std::string ten_nodes(const TetMesh& mesh, std::size_t tet, const EdgeOrder& order, Index first) {
  std::ostringstream out;
  for (const Index n : mesh.tets[tet]) out << " " << n + first;
  for (const auto& [a, b] : order)
    for (std::size_t e = 0; e < 6; ++e)
      if (std::minmax(kTetEdges[e][0], kTetEdges[e][1]) == std::minmax(a, b))
        out << " " << mesh.mid_edge_nodes[tet][e] + first;
  return out.str();
}

std::string coordinates(const Vec3& x) {
  std::ostringstream out;
  out.precision(17);
  out << x[0] << " " << x[1] << " " << x[2];
  return out.str();
}

std::string gmsh_text(const TetMesh& m) {
  std::ostringstream out;
  out << "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n" << m.nodes.size() << "\n";
  for (std::size_t i = 0; i < m.nodes.size(); ++i) out << i + 1 << " " << coordinates(m.nodes[i]) << "\n";
  out << "$EndNodes\n$Elements\n" << m.tets.size() << "\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i) out << i + 1 << " 11 2 7 7" << ten_nodes(m, i, kGmsh, 1) << "\n";
  return out.str() + "$EndElements\n";
}

std::string vtk_text(const TetMesh& m) {
  std::ostringstream out;
  out << "# vtk DataFile Version 3.0\nten\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS " << m.nodes.size() << " double\n";
  for (const Vec3& x : m.nodes) out << coordinates(x) << "\n";
  out << "CELLS " << m.tets.size() << " " << 11 * m.tets.size() << "\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i) out << "10" << ten_nodes(m, i, kVtkAndMedit, 0) << "\n";
  out << "CELL_TYPES " << m.tets.size() << "\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i) out << "24\n";
  return out.str();
}

std::string medit_text(const TetMesh& m) {
  std::ostringstream out;
  out << "MeshVersionFormatted 2\nDimension\n3\nVertices\n" << m.nodes.size() << "\n";
  for (const Vec3& x : m.nodes) out << coordinates(x) << " 0\n";
  out << "TetrahedraP2\n" << m.tets.size() << "\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i) out << ten_nodes(m, i, kVtkAndMedit, 1) << " 7\n";
  return out.str() + "End\n";
}

void write_tetgen(const Folder& folder, const TetMesh& m) {
  std::ostringstream node, ele;
  node << m.nodes.size() << " 3 0 0\n";
  for (std::size_t i = 0; i < m.nodes.size(); ++i) node << i + 1 << " " << coordinates(m.nodes[i]) << "\n";
  ele << m.tets.size() << " 10 0\n";
  for (std::size_t i = 0; i < m.tets.size(); ++i) ele << i + 1 << ten_nodes(m, i, kTetgen, 1) << "\n";
  folder.write("ten.node", node.str());
  folder.write("ten.ele", ele.str());
}

void expect_same_tets(const TetMesh& seen, const TetMesh& expected) {
  EXPECT_EQ(seen.nodes, expected.nodes);
  EXPECT_EQ(seen.tets, expected.tets);
  EXPECT_EQ(seen.mid_edge_nodes, expected.mid_edge_nodes);
}

std::string refusal(TetMesh mesh) {
  Warnings warnings;
  try {
    validate(mesh, "\"ten\"", warnings);
  } catch (const InputError& e) {
    return e.what();
  }
  return "accepted";
}

TEST(QuadraticShape, is_one_at_its_node_and_reproduces_quadratics) {
  for (std::size_t node = 0; node < 10; ++node) {
    Barycentric L{};
    if (node < 4)
      L[node] = 1.0;
    else
      for (const int end : kTetEdges[node - 4]) L[static_cast<std::size_t>(end)] = 0.5;
    const auto N = quadratic_shape(L);
    for (std::size_t a = 0; a < 10; ++a) EXPECT_EQ(N[a], a == node ? 1.0 : 0.0);
  }
  const Barycentric L{0.1, 0.2, 0.3, 0.4};
  const auto N = quadratic_shape(L);
  EXPECT_NEAR(std::accumulate(N.begin(), N.end(), 0.0), 1.0, 1e-15);
  double square = 0.0;  // of L₃ at the nodes: 1 at corner 3, ¼ in the middles of its edges
  for (std::size_t a = 0; a < 10; ++a) square += N[a] * (a == 3 ? 1.0 : a == 7 || a == 8 || a == 9 ? 0.25 : 0.0);
  EXPECT_NEAR(square, 0.16, 1e-15);
  const auto slopes = quadratic_shape_slopes(L);
  for (std::size_t c = 0; c < 4; ++c) {
    Barycentric more = L, less = L;
    more[c] += 1e-5, less[c] -= 1e-5;
    for (std::size_t a = 0; a < 10; ++a)
      EXPECT_NEAR(slopes[a][c], (quadratic_shape(more)[a] - quadratic_shape(less)[a]) / 2e-5, 1e-9);
  }
}

TEST(TenNodeMesh, has_one_node_in_the_middle_of_each_edge) {
  TetMesh mesh = samples::two_cubes();
  const TetMesh linear = mesh;
  add_mid_edge_nodes(mesh);
  // Euler's formula for a ball; one node is in no tet.
  const std::size_t corners = linear.nodes.size(), edges = mesh.nodes.size() - corners;
  const auto faces = (4 * mesh.tets.size() + boundary_surface(linear).surface.triangles.size()) / 2;
  EXPECT_EQ(static_cast<int>(corners - 1) - static_cast<int>(edges) + static_cast<int>(faces) -
                static_cast<int>(mesh.tets.size()),
            1);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (std::size_t e = 0; e < 6; ++e)
      EXPECT_EQ(mesh.nodes[mesh.mid_edge_nodes[t][e]],
                0.5 * (mesh.nodes[mesh.tets[t][kTetEdges[e][0]]] + mesh.nodes[mesh.tets[t][kTetEdges[e][1]]]));
  // The floor: four corners, and the middles of its four sides and its diagonal.
  const auto floor =
      std::find_if(mesh.node_groups.begin(), mesh.node_groups.end(), [](const NodeGroup& g) { return g.name == "5"; });
  EXPECT_EQ(floor->nodes.size(), 9u);
  for (const Index n : floor->nodes) EXPECT_EQ(mesh.nodes[n][2], 0.0);
  Warnings warnings;
  TetMesh valid = mesh;
  validate(valid, "cubes", warnings);
  EXPECT_TRUE(warnings.empty());
  expect_same(valid, mesh);
  drop_mid_edge_nodes(mesh);
  EXPECT_EQ(mesh.tets, linear.tets);
  EXPECT_EQ(mesh.nodes.size() + 1, linear.nodes.size()) << "the node that no tet uses goes, too";
}

TEST(TenNodeMesh, splits_into_eighths_of_the_same_volume) {
  const TetMesh mesh = ten_node_cubes();
  const TetMesh split = split_into_eight(mesh);
  for (std::size_t i = 0; i < split.tets.size(); ++i)
    EXPECT_NEAR(signed_volume(split, static_cast<Index>(i)), signed_volume(mesh, static_cast<Index>(i / 8)) / 8.0,
                1e-18);
  const BoundarySurface boundary = boundary_surface(mesh);
  EXPECT_EQ(boundary.surface.triangles.size(), 4u * 20u);
  EXPECT_EQ(surface_quality(boundary.surface).boundary_edges, 0u);
  EXPECT_NEAR(enclosed_volume(boundary.surface), 2e-3, 1e-15);
}

TEST(TenNodeMesh, finds_the_eighth_that_holds_a_point) {
  const TetMesh mesh = ten_node_cubes();
  const TetMesh split = split_into_eight(mesh);
  for (const Barycentric& L :
       {Barycentric{0.7, 0.1, 0.1, 0.1}, Barycentric{0.1, 0.1, 0.1, 0.7}, Barycentric{0.3, 0.2, 0.4, 0.1},
        Barycentric{0.1, 0.4, 0.2, 0.3}, Barycentric{0.25, 0.25, 0.25, 0.25}, Barycentric{1.2, -0.1, -0.1, 0.0}}) {
    const PointInEighth at = point_in_eighth(L);
    Vec3 in_tet = Vec3::Zero(), in_eighth = Vec3::Zero();
    for (std::size_t a = 0; a < 4; ++a) {
      in_tet += L[a] * mesh.nodes[mesh.tets[3][a]];
      in_eighth += at.L[a] * split.nodes[split.tets[static_cast<std::size_t>(24 + at.eighth)][a]];
      EXPECT_EQ(TetNodes(mesh, 3)[at.corner[a]], split.tets[static_cast<std::size_t>(24 + at.eighth)][a]);
      if (L[1] >= 0.0) {
        EXPECT_GE(at.L[a], -1e-15);
      }
    }
    EXPECT_LT((in_tet - in_eighth).norm(), 1e-16);
  }
}

TEST(TenNodeMesh, reads_alike_from_every_format) {
  const Folder folder;
  const TetMesh mesh = ten_node_cubes();
  write_tetgen(folder, mesh);
  write_gmsh(folder / "written.msh", mesh);
  for (const auto& path : {folder.write("ten.msh", gmsh_text(mesh)), folder.write("ten.vtk", vtk_text(mesh)),
                           folder.write("ten.mesh", medit_text(mesh)), folder / "ten.ele", folder / "written.msh"}) {
    Warnings warnings;
    const TetMesh read = testing::read_tets(path, warnings);
    EXPECT_TRUE(warnings.empty()) << path << ": " << (warnings.empty() ? "" : warnings[0]);
    expect_same_tets(read, mesh);
  }
}

// The output of TetGen 1.5.0 with -po2 for one tet.
TEST(TenNodeMesh, reads_what_tetgen_writes) {
  const Folder folder;
  folder.write("b.1.node",
               "10  3  0  0\n   1    0  0  0\n   2    1  0  0\n   3    0  1  0\n   4    0  0  1\n   5    0.5  0  0.5\n"
               "   6    0.5  0  0\n   7    0  0.5  0\n   8    0  0.5  0.5\n   9    0.5  0.5  0\n  10    0  0  0.5\n");
  folder.write("b.1.ele", "1  10  0\n    1       1     3     4     2      5     6     7     8     9    10\n");
  Warnings warnings;
  const TetMesh mesh = testing::read_tets(folder / "b.1.ele", warnings);
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(mesh.mid_edge_nodes, (std::vector<MidEdgeNodes>{{6, 7, 9, 5, 8, 4}}));
}

TEST(TenNodeMesh, turns_left_handed_tets_with_their_middles) {
  TetMesh mesh = ten_node_cubes();
  const TetMesh right = mesh;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    std::swap(mesh.tets[t][2], mesh.tets[t][3]);
    std::swap(mesh.mid_edge_nodes[t][1], mesh.mid_edge_nodes[t][4]);
    std::swap(mesh.mid_edge_nodes[t][2], mesh.mid_edge_nodes[t][3]);
  }
  Warnings warnings;
  validate(mesh, "cubes", warnings);
  EXPECT_EQ(warnings.size(), 1u);
  expect_same_tets(mesh, right);
}

TEST(TenNodeMesh, straightens_bent_edges_and_says_so) {
  TetMesh mesh = ten_node_cubes();
  const TetMesh straight = mesh;
  mesh.nodes.back() += Vec3(0.0, 0.0, 0.005);
  Warnings warnings;
  validate(mesh, "cubes", warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("1 mid-edge nodes lie off the middles"), std::string::npos) << warnings[0];
  expect_same_tets(mesh, straight);
}

TEST(TenNodeMesh, refuses_what_is_no_mesh_in_one_line_each) {
  const TetMesh good = ten_node_cubes();
  TetMesh folded = good;
  folded.nodes.back() += Vec3(0.04, 0.0, 0.0);
  TetMesh apart = good;
  apart.nodes.push_back(good.nodes[good.mid_edge_nodes[0][0]]);
  apart.mid_edge_nodes[0][0] = static_cast<Index>(good.nodes.size());
  TetMesh shared = good;
  shared.mid_edge_nodes[0][0] = shared.mid_edge_nodes[0][1];
  TetMesh out = good;
  out.mid_edge_nodes[2][5] = 1000;
  TetMesh some = good;
  some.mid_edge_nodes.pop_back();
  const std::pair<TetMesh, std::string> wrong[] = {{folded, "is folded: at its node"},
                                                   {apart, "in another, expected one"},
                                                   {shared, "folded"},
                                                   {out, "names mid-edge node 1000"},
                                                   {some, "mid-edge nodes of 11 of 12 tetrahedra"}};
  for (const auto& [mesh, message] : wrong) {
    const std::string seen = refusal(mesh);
    EXPECT_NE(seen.find(message), std::string::npos) << seen;
    EXPECT_EQ(seen.find('\n'), std::string::npos);
  }
}

TEST(TenNodeMesh, refuses_a_file_with_tets_of_both_kinds) {
  const Folder folder;
  std::string text = gmsh_text(ten_node_cubes());
  const auto first = text.find("\n1 11 2 7 7 "), end = text.find('\n', first + 1);
  text.replace(first, end - first, "\n1 4 2 7 7 1 2 4 8");
  Warnings warnings;
  EXPECT_THROW(testing::read_tets(folder.write("both.msh", text), warnings), InputError);
}

}  // namespace
}  // namespace limber
