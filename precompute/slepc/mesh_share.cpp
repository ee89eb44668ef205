#include "mesh_share.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include "limber/precompute/fem.h"
#include "petsc_objects.h"

namespace limber::internal {
namespace {

/// In the order of the file, ranges of equal length.
NodeShare first_share(const std::filesystem::path& path, const StoredBody& body) {
  NodeShare share;
  share.place.assign(static_cast<std::size_t>(body.nodes), 0);
  for_each_record<Index>(path, body.begin, body.fixed, 1, [&](Index, const Index* node) { share.place[*node] = -1; });
  Index places = 0;
  for (Index& place : share.place)
    if (place == 0) place = places++;
  const auto cut = [&](std::int64_t k) { return static_cast<Index>(places * k / processes()); };
  share.first = cut(process());
  share.end = cut(process() + 1);
  return share;
}

/// The neighbours of this process's nodes, each but itself.
OwnedMat node_graph(const std::filesystem::path& path, const StoredBody& body, const NodeShare& share) {
  const MeshShare mine = read_share(path, body, share);
  const SparseMatrix pattern = assemble_mass(mine.mesh, body.materials, MassKind::kConsistent);
  PetscInt *start = nullptr, *neighbour = nullptr;  // which the graph takes over
  check(PetscMalloc(sizeof(PetscInt) * (static_cast<std::size_t>(share.end - share.first) + 1), &start));
  check(PetscMalloc(sizeof(PetscInt) * pattern.row.size(), &neighbour));
  start[0] = 0;
  PetscInt row = 0, edges = 0;
  for (std::size_t i = 0; i < mine.node_of.size(); ++i) {
    if (!share.has(mine.node_of[i])) continue;
    for (Index e = pattern.column_start[i]; e < pattern.column_start[i + 1]; ++e) {
      const Index place = share.place[mine.node_of[pattern.row[e]]];
      if (place >= 0 && pattern.row[e] != static_cast<Index>(i)) neighbour[edges++] = place;
    }
    start[++row] = edges;
  }
  OwnedMat graph;
  check(MatCreateMPIAdj(PETSC_COMM_WORLD, row, body.free_nodes(), start, neighbour, nullptr, graph.out()));
  return graph;
}

}  // namespace

NodeShare share_nodes(const std::filesystem::path& path, const StoredBody& body) {
  NodeShare share = first_share(path, body);
  if (processes() == 1) return share;
  const OwnedMat graph = node_graph(path, body, share);
  OwnedPartitioning partitioning;
  check(MatPartitioningCreate(PETSC_COMM_WORLD, partitioning.out()));
  check(MatPartitioningSetAdjacency(partitioning, graph));
  check(MatPartitioningSetType(partitioning, MATPARTITIONINGPTSCOTCH));
  OwnedIndices owner, place, places;
  check(MatPartitioningApply(partitioning, owner.out()));
  std::vector<PetscInt> sizes(static_cast<std::size_t>(processes()));
  check(ISPartitioningCount(owner, processes(), sizes.data()));
  check(ISPartitioningToNumbering(owner, place.out()));
  check(ISAllGather(place, places.out()));
  const PetscInt* new_place = nullptr;
  check(ISGetIndices(places, &new_place));
  for (Index& p : share.place)
    if (p >= 0) p = new_place[p];
  check(ISRestoreIndices(places, &new_place));
  share.first = 0;
  for (int k = 0; k < process(); ++k) share.first += sizes[k];
  share.end = share.first + sizes[process()];
  return share;
}

MeshShare read_share(const std::filesystem::path& path, const StoredBody& body, const NodeShare& share) {
  MeshShare mine;
  TetMesh& mesh = mine.mesh;
  const int n = body.nodes_per_tet;
  std::vector<Index> local(static_cast<std::size_t>(body.nodes), -1);
  for_each_record<Index>(path, body.tets_begin(), body.tets, n + 1, [&](Index, const Index* t) {
    if (std::none_of(t, t + n, [&](Index node) { return share.has(node); })) return;
    std::copy_n(t, 4, mesh.tets.emplace_back().begin());
    if (n == 10) std::copy_n(t + 4, 6, mesh.mid_edge_nodes.emplace_back().begin());
    mesh.tet_region.push_back(t[n]);
    for (int i = 0; i < n; ++i) local[t[i]] = 0;
  });
  for_each_record<double>(path, body.coordinates_begin(), body.nodes, 3, [&](Index node, const double* x) {
    if (local[node] < 0) return;
    local[node] = static_cast<Index>(mine.node_of.size());
    mine.node_of.push_back(node);
    mesh.nodes.emplace_back(x[0], x[1], x[2]);
  });
  for (auto& tet : mesh.tets)
    for (Index& node : tet) node = local[node];
  for (auto& tet : mesh.mid_edge_nodes)
    for (Index& node : tet) node = local[node];
  for (std::size_t r = 0; r < body.materials.size(); ++r) mesh.regions.push_back({std::to_string(r)});
  return mine;
}

}  // namespace limber::internal
