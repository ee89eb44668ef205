/// @file mesh_files.h
/// Meshes from and to files, and cut down, as tests want them.
#pragma once

#include <algorithm>
#include <filesystem>
#include <utility>
#include <variant>
#include <vector>

#include "limber/core/file.h"
#include "limber/mesh/read_mesh.h"
#include "limber/mesh/write_mesh.h"

namespace limber::testing {

/// @throws std::bad_variant_access if the file holds a surface
inline TetMesh read_tets(const std::filesystem::path& path, Warnings& warnings) {
  return std::get<TetMesh>(read_mesh(path, warnings));
}

inline void write_obj(const std::filesystem::path& path, const SurfaceMesh& surface) {
  write_file(path, obj_text(surface));
}

/// Without the nodes that no tet uses; the order of the others stays.
inline void drop_unused_nodes(TetMesh& mesh) {
  std::vector<Index> now(mesh.nodes.size(), -1);
  for (const Tet& t : mesh.tets)
    for (const Index n : t) now[n] = 0;
  std::vector<Vec3> used;
  for (std::size_t n = 0; n < now.size(); ++n)
    if (now[n] == 0) now[n] = static_cast<Index>(used.size()), used.push_back(mesh.nodes[n]);
  mesh.nodes = std::move(used);
  for (Tet& t : mesh.tets)
    for (Index& n : t) n = now[n];
  for (NodeGroup& g : mesh.node_groups) {
    for (Index& n : g.nodes) n = now[n];
    std::erase(g.nodes, -1);
  }
  std::erase_if(mesh.node_groups, [](const NodeGroup& g) { return g.nodes.empty(); });
}

}  // namespace limber::testing
