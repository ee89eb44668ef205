/// @file mesh_share.h
/// Which nodes of a body each process has, and the tets around them.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "eigen/stored_body.h"
#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

/// An order of the free nodes that all processes know; each has a range of it.
struct NodeShare {
  std::vector<Index> place;  ///< of each node of the body in that order; −1 where it is fixed
  Index first = 0, end = 0;  ///< places of this process
  bool has(Index node) const { return place[node] >= first && place[node] < end; }
};

/// Cuts the body by PT-Scotch into parts of equal size with few nodes between them. Collective.
NodeShare share_nodes(const std::filesystem::path& path, const StoredBody& body);

/// The tets that touch this process's nodes. Tets and nodes keep the order of the body, so that what is summed up over
/// a node's tets has the same bits however many processes there are.
struct MeshShare {
  TetMesh mesh;
  std::vector<Index> node_of;  ///< per node of `mesh`, its index in the body
};
MeshShare read_share(const std::filesystem::path& path, const StoredBody& body, const NodeShare& share);

}  // namespace limber::internal
