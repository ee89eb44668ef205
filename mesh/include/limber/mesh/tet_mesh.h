/// @file limber/mesh/tet_mesh.h
/// A tetrahedral mesh with named regions and node groups, and what can be asked of its geometry alone. Tets have four
/// nodes or, where the mesh has mid-edge nodes, ten (limber/mesh/ten_node_tet.h).
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// A part of the body that may have a material of its own.
struct Region {
  std::string name{};  ///< physical name, or the integer tag or reference as text where the file gives no name
  int tag = 0;         ///< the file's number for it; 0 where it has none
};

/// A named set of nodes, such as a clamped face.
struct NodeGroup {
  std::string name{};        ///< physical name, or its tag as text
  std::vector<Index> nodes;  ///< ascending, no repeats
};

/// Nodes in the middles of a tet's edges, in the order of kTetEdges.
using MidEdgeNodes = std::array<Index, 6>;

/// The edges of a tet by its corners, in the order of VTK's ten-node tet.
inline constexpr std::array<std::array<int, 2>, 6> kTetEdges{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};

/// Tetrahedra with straight sides. Lengths in metres.
/// Invariant after a reader of limber or after validate(): all coordinates finite, all indices in range, every tet
/// positive (right-handed, see `Tet`), nodes in the order of the file with unused ones still present; where there are
/// mid-edge nodes, each edge has one, which lies in its middle and is no other edge's and no corner.
struct TetMesh {
  std::vector<Vec3> nodes{};
  std::vector<Tet> tets{};
  std::vector<Index> tet_region{};             ///< per tet, index into `regions`
  std::vector<Region> regions{};               ///< at least one if there are tets
  std::vector<NodeGroup> node_groups{};        ///< indices into `nodes`; from a reader sorted by name
  std::vector<MidEdgeNodes> mid_edge_nodes{};  ///< per tet; none in a mesh of four-node tets

  bool has_mid_edge_nodes() const { return !mid_edge_nodes.empty(); }
};

/// All nodes of one tet: its corners, then its mid-edge nodes if it has any.
class TetNodes {
 public:
  TetNodes(const TetMesh& mesh, std::size_t tet);
  std::size_t size() const { return size_; }
  Index operator[](std::size_t i) const { return nodes_[i]; }
  const Index* begin() const { return nodes_.data(); }
  const Index* end() const { return nodes_.data() + size_; }

 private:
  std::array<Index, 10> nodes_{};
  std::size_t size_ = 4;
};

/// Volume of a tetrahedron, positive if right-handed: (x1−x0)×(x2−x0)·(x3−x0)/6, m³.
double signed_volume(const TetMesh& mesh, Index tet);

/// Checks the invariant and repairs what may be repaired: negative tets are re-oriented, with one warning that counts
/// them; mid-edge nodes off the middles of their edges are moved there, with one warning where any is off by more than
/// 1e-6 of its edge. @param name shown in messages, such as `"spoon.msh"`.
/// @throws InputError naming the first wrong element: coordinate not finite, index out of range, a node twice in a tet,
/// a flat tet (|6V| ≤ 1e-12 · (longest edge)³: below that its stiffness is round-off), a tet that stands twice, a
/// ten-node tet that is folded (its Jacobian is not positive at each of its nodes) or an edge with two mid-edge nodes.
void validate(TetMesh& mesh, const std::string& name, Warnings& warnings);

/// Drops the nodes that no tet uses, from the groups too; groups left empty go. The order of the others stays.
/// @return per node that stayed, its index before. @pre mesh is valid
std::vector<Index> drop_unused_nodes(TetMesh& mesh);

/// Geometry of a solid of density 1.
struct VolumeProperties {
  double volume = 0.0;                ///< m³
  Vec3 centroid = Vec3::Zero();       ///< m
  Mat3 second_moment = Mat3::Zero();  ///< ∫ (x − c)(x − c)ᵀ dV about the centroid c, m⁵
};
VolumeProperties volume_properties(const TetMesh& mesh);

/// Labels tets by body: tets that share a node are in one body. Numbers bodies by their first tet.
/// @return per tet, the body's index; the number of bodies is 1 + the largest.
std::vector<Index> connected_components(const TetMesh& mesh);

/// Labels tets by part: tets that share a face are in one part, those that share a node or an edge need not be. Numbers
/// parts by their first tet.
std::vector<Index> face_connected_parts(const TetMesh& mesh);

/// The tets of one body with its nodes in the order of the whole; unused nodes and groups without a node are left out.
struct SubMesh {
  TetMesh mesh;
  std::vector<Index> node_of;  ///< per node of `mesh`, its index in the whole
  std::vector<Index> tet_of;   ///< per tet of `mesh`, its index in the whole
};
/// @param component per tet, from connected_components(). @param which the body wanted.
SubMesh extract_component(const TetMesh& mesh, std::span<const Index> component, Index which);

}  // namespace limber
