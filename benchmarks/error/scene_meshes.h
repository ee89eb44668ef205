/// @file scene_meshes.h
/// Meshes of the bodies of error_scenes.h, and which of their nodes are compared.
#pragma once

#include "error_scenes.h"

namespace limber::testing {

/// @param times as many cells along each axis as the coarsest
TetMesh body_mesh(const ErrorBody& body, int times);
/// The node at a place. @throws InvalidArgument if none is
Index node_at(const TetMesh& mesh, const Vec3& at);
/// Places of the coarsest mesh's nodes on the boundary, in its order.
std::vector<Vec3> compared_places(const ErrorBody& body);
std::vector<Index> clamped_nodes(const ErrorBody& body, const TetMesh& mesh);

}  // namespace limber::testing
