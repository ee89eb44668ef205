#include "limber/precompute/fem.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>

#include "fem/element_rules.h"
#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"
#include "limber/model/tet_element.h"

namespace limber {
namespace {

constexpr std::size_t kGrain = 512;  // tets or nodes per task: tens of microseconds

/// Gradients of a tet's shape functions at one point, where a rule of integration has this part of the volume.
template <std::size_t n>
using Gradients = std::array<Vec3, n>;

/// Points at which products of gradients are summed up: linear functions integrate exactly at the centroid, products of
/// two linear functions at four points.
template <std::size_t n>
inline constexpr std::size_t kPoints = n == 4 ? 1 : 4;

using SlopesAtPoints = std::array<std::array<std::array<double, 4>, 10>, 4>;

const SlopesAtPoints& slopes_at_points() {
  static const SlopesAtPoints kSlopes = [] {
    SlopesAtPoints slopes{};
    for (std::size_t q = 0; q < 4; ++q) slopes[q] = quadratic_shape_slopes(internal::rule_points(10)[q]);
    return slopes;
  }();
  return kSlopes;
}

/// At every point of the rule.
template <std::size_t n>
std::array<Gradients<n>, kPoints<n>> shape_gradients(const TetElement& e) {
  if constexpr (n == 4) {
    return {e.gradient};
  } else {
    const SlopesAtPoints& slopes = slopes_at_points();
    std::array<Gradients<n>, kPoints<n>> at;
    for (std::size_t q = 0; q < at.size(); ++q)
      for (std::size_t a = 0; a < n; ++a) {
        at[q][a] = Vec3::Zero();
        for (std::size_t c = 0; c < 4; ++c) at[q][a] += slopes[q][a][c] * e.gradient[c];
      }
    return at;
  }
}

std::array<Vec3, 4> corners(const TetMesh& mesh, const Tet& t) {
  return {mesh.nodes[t[0]], mesh.nodes[t[1]], mesh.nodes[t[2]], mesh.nodes[t[3]]};
}

/// K_ab summed up over the points. The order of the sums keeps K_baᵀ = K_ab to the bit.
template <std::size_t n>
Mat3 stiffness_block(const TetElement& e, const std::array<Gradients<n>, kPoints<n>>& at, std::size_t a,
                     std::size_t b) {
  if constexpr (n == 4) return stiffness_block(e, at[0][a], at[0][b]);
  Mat3 block = Mat3::Zero();
  for (const Gradients<n>& g : at) block += stiffness_block(e, g[a], g[b]);
  return block / static_cast<double>(kPoints<n>);
}

template <std::size_t n>
std::array<double, 9 * n * n> element_stiffness(const std::array<Vec3, 4>& x, const Material& material) {
  const TetElement e = make_tet_element(x, material);
  const auto at = shape_gradients<n>(e);
  std::array<double, 9 * n * n> K{};
  for (std::size_t a = 0; a < n; ++a)
    for (std::size_t b = 0; b < n; ++b) {
      const Mat3 block = stiffness_block<n>(e, at, a, b);
      for (std::size_t p = 0; p < 3; ++p)
        for (std::size_t q = 0; q < 3; ++q)
          K[3 * n * (3 * a + p) + 3 * b + q] = block(static_cast<int>(p), static_cast<int>(q));
    }
  return K;
}

/// The tets around each node and its neighbours, itself among them, both ascending.
struct NodeGraph {
  std::vector<Index> tet_start, tet;              // compressed: node → tets
  std::vector<Index> neighbour_start, neighbour;  // compressed: node → nodes

  std::span<const Index> tets_of(Index node) const {
    return {tet.data() + tet_start[node], tet.data() + tet_start[node + 1]};
  }
  std::span<const Index> neighbours_of(Index node) const {
    return {neighbour.data() + neighbour_start[node], neighbour.data() + neighbour_start[node + 1]};
  }
};

// Turns counts, stored one place late, into starts.
void accumulate(std::vector<Index>& start, const char* what) {
  std::int64_t sum = 0;
  for (Index& s : start) {
    sum += s;
    if (sum > std::numeric_limits<Index>::max())
      throw ComputationError(std::string("assembly: more than 2^31 ") + what + "; the mesh is too large");
    s = static_cast<Index>(sum);
  }
}

void list_tets_of_nodes(const TetMesh& mesh, NodeGraph& graph) {
  graph.tet_start.assign(mesh.nodes.size() + 1, 0);
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : TetNodes(mesh, e)) ++graph.tet_start[node + 1];
  accumulate(graph.tet_start, "nodes of tetrahedra");
  graph.tet.resize(graph.tet_start.back());
  std::vector<Index> next(graph.tet_start.begin(), graph.tet_start.end() - 1);
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : TetNodes(mesh, e)) graph.tet[next[node]++] = static_cast<Index>(e);
}

void find_neighbours(const TetMesh& mesh, const NodeGraph& graph, Index node, std::vector<Index>& found) {
  found.clear();
  for (const Index e : graph.tets_of(node)) {
    const TetNodes t(mesh, static_cast<std::size_t>(e));
    found.insert(found.end(), t.begin(), t.end());
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
}

NodeGraph make_node_graph(const TetMesh& mesh, Jobs& jobs) {
  NodeGraph graph;
  list_tets_of_nodes(mesh, graph);
  graph.neighbour_start.assign(mesh.nodes.size() + 1, 0);
  jobs.parallel_for(mesh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Index> found;
    for (std::size_t i = begin; i < end; ++i) {
      find_neighbours(mesh, graph, static_cast<Index>(i), found);
      graph.neighbour_start[i + 1] = static_cast<Index>(found.size());
    }
  });
  accumulate(graph.neighbour_start, "pairs of neighbouring nodes");
  graph.neighbour.resize(graph.neighbour_start.back());
  jobs.parallel_for(mesh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Index> found;
    for (std::size_t i = begin; i < end; ++i) {
      find_neighbours(mesh, graph, static_cast<Index>(i), found);
      std::copy(found.begin(), found.end(), graph.neighbour.begin() + graph.neighbour_start[i]);
    }
  });
  return graph;
}

void check(const TetMesh& mesh, std::span<const Material> materials, const char* where) {
  if (materials.size() != mesh.regions.size())
    throw InvalidArgument(std::string(where) + ": " + std::to_string(materials.size()) + " materials for " +
                          std::to_string(mesh.regions.size()) + " regions, expected one each");
  std::vector<bool> used(materials.size(),
                         false);  // a body cut out of a larger mesh may name regions it has no part of
  for (const Index r : mesh.tet_region) used[r] = true;
  for (std::size_t r = 0; r < materials.size(); ++r)
    if (used[r]) materials[r].validate(std::string(where) + ": region \"" + mesh.regions[r].name + "\"");
}

/// Place of another node in the list of a node's neighbours.
std::size_t place_of(Index node, std::span<const Index> neighbours) {
  return static_cast<std::size_t>(std::lower_bound(neighbours.begin(), neighbours.end(), node) - neighbours.begin());
}

/// Adds what one node's tets give to its three columns. @param blocks one per neighbour, zero on entry
template <std::size_t n>
void add_stiffness(const TetMesh& mesh, std::span<const TetElement> elements, const NodeGraph& graph, Index node,
                   std::vector<Mat3>& blocks) {
  for (const Index e : graph.tets_of(node)) {
    const TetNodes t(mesh, static_cast<std::size_t>(e));
    const auto at = shape_gradients<n>(elements[e]);
    const auto own = static_cast<std::size_t>(std::find(t.begin(), t.end(), node) - t.begin());
    for (std::size_t a = 0; a < n; ++a)
      blocks[place_of(t[a], graph.neighbours_of(node))] += stiffness_block<n>(elements[e], at, a, own);
  }
}

/// The pattern of K: every neighbour a 3 × 3 block.
SparseMatrix stiffness_pattern(const NodeGraph& graph) {
  const std::size_t nodes = graph.neighbour_start.size() - 1;
  SparseMatrix K;
  K.size = static_cast<Index>(3 * nodes);
  K.column_start.assign(3 * nodes + 1, 0);
  for (std::size_t i = 0; i < nodes; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      K.column_start[3 * i + axis + 1] = 3 * (graph.neighbour_start[i + 1] - graph.neighbour_start[i]);
  accumulate(K.column_start, "entries of the stiffness matrix");
  K.row.resize(K.column_start.back());
  K.value.resize(K.column_start.back());
  return K;
}

/// A part of each tet's mass, kg: the unit its mass block is written in.
std::vector<double> mass_units(const TetMesh& mesh, std::span<const Material> materials, double share) {
  std::vector<double> unit(mesh.tets.size());
  for (std::size_t e = 0; e < unit.size(); ++e)
    unit[e] = materials[mesh.tet_region[e]].density * signed_volume(mesh, static_cast<Index>(e)) * share;
  return unit;
}

SparseMatrix lumped_mass(const TetMesh& mesh, std::span<const Material> materials) {
  SparseMatrix M;
  M.size = static_cast<Index>(mesh.nodes.size());
  M.value.assign(mesh.nodes.size(), 0.0);
  const bool ten = mesh.has_mid_edge_nodes();
  const auto at_corner = mass_units(mesh, materials, ten ? 1.0 / 36.0 : 1.0 / 4.0);
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : mesh.tets[e]) M.value[node] += at_corner[e];
  for (std::size_t e = 0; e < mesh.mid_edge_nodes.size(); ++e)
    for (const Index node : mesh.mid_edge_nodes[e]) M.value[node] += 16.0 / 3.0 * at_corner[e];
  for (Index i = 0; i <= M.size; ++i) M.column_start.push_back(i);
  M.row.assign(M.column_start.begin(), M.column_start.end() - 1);
  return M;
}

SparseMatrix consistent_mass(const TetMesh& mesh, std::span<const Material> materials, Jobs& jobs) {
  NodeGraph graph = make_node_graph(mesh, jobs);
  SparseMatrix M;
  M.size = static_cast<Index>(mesh.nodes.size());
  M.value.assign(graph.neighbour.size(), 0.0);
  const std::size_t per_tet = mesh.has_mid_edge_nodes() ? 10 : 4;
  const auto mass = mass_units(mesh, materials, 1.0);
  std::array<std::array<double, 10>, 10> share{};
  for (std::size_t a = 0; a < per_tet; ++a)
    for (std::size_t b = 0; b < per_tet; ++b) share[a][b] = internal::mass_share(a, b, per_tet);
  jobs.parallel_for(mesh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (Index node = static_cast<Index>(begin); node < static_cast<Index>(end); ++node) {
      double* column = M.value.data() + graph.neighbour_start[node];
      for (const Index e : graph.tets_of(node)) {
        const TetNodes t(mesh, static_cast<std::size_t>(e));
        const auto own = static_cast<std::size_t>(std::find(t.begin(), t.end(), node) - t.begin());
        for (std::size_t a = 0; a < per_tet; ++a)
          column[place_of(t[a], graph.neighbours_of(node))] += share[a][own] * mass[e];
      }
    }
  });
  M.column_start = std::move(graph.neighbour_start);
  M.row = std::move(graph.neighbour);
  return M;
}

/// One tet's part of K u, from differences to its first node.
template <std::size_t n>
void add_forces(const TetNodes& t, const TetElement& e, std::span<const double> displacements,
                std::span<double> forces) {
  const auto u = [&](Index node) { return Eigen::Map<const Vec3>(displacements.data() + 3 * node); };
  const auto f = [&](Index node) { return Eigen::Map<Vec3>(forces.data() + 3 * node); };
  for (const Gradients<n>& g : shape_gradients<n>(e)) {
    Mat3 gradient = Mat3::Zero();
    for (std::size_t a = 1; a < n; ++a) gradient += (u(t[a]) - u(t[0])) * g[a].transpose();
    const Mat3 stress_volume =
        (e.lambda_volume * gradient.trace() * Mat3::Identity() + e.mu_volume * (gradient + gradient.transpose())) /
        static_cast<double>(kPoints<n>);
    for (std::size_t a = 1; a < n; ++a) {
      const Vec3 force = stress_volume * g[a];
      f(t[a]) += force;
      f(t[0]) -= force;
    }
  }
}

}  // namespace

std::array<double, 144> tet_stiffness(const std::array<Vec3, 4>& x, const Material& material) {
  material.validate("tet_stiffness");
  return element_stiffness<4>(x, material);
}

std::array<double, 900> ten_node_stiffness(const std::array<Vec3, 4>& x, const Material& material) {
  material.validate("ten_node_stiffness");
  return element_stiffness<10>(x, material);
}

SparseMatrix assemble_stiffness(const TetMesh& mesh, std::span<const Material> materials, Jobs& jobs) {
  check(mesh, materials, "assemble_stiffness");
  std::vector<TetElement> elements(mesh.tets.size());
  jobs.parallel_for(elements.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e)
      elements[e] = make_tet_element(corners(mesh, mesh.tets[e]), materials[mesh.tet_region[e]]);
  });
  const NodeGraph graph = make_node_graph(mesh, jobs);
  SparseMatrix K = stiffness_pattern(graph);
  jobs.parallel_for(mesh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Mat3> blocks;
    for (Index node = static_cast<Index>(begin); node < static_cast<Index>(end); ++node) {
      const auto neighbours = graph.neighbours_of(node);
      blocks.assign(neighbours.size(), Mat3::Zero());
      if (mesh.has_mid_edge_nodes())
        add_stiffness<10>(mesh, elements, graph, node, blocks);
      else
        add_stiffness<4>(mesh, elements, graph, node, blocks);
      for (int axis = 0; axis < 3; ++axis) {
        Index entry = K.column_start[3 * node + axis];
        for (std::size_t i = 0; i < neighbours.size(); ++i)
          for (int p = 0; p < 3; ++p, ++entry) {
            K.row[entry] = 3 * neighbours[i] + p;
            K.value[entry] = blocks[i](p, axis);
          }
      }
    }
  });
  return K;
}

void elastic_forces(const TetMesh& mesh, std::span<const Material> materials, std::span<const double> displacements,
                    std::span<double> forces) {
  check(mesh, materials, "elastic_forces");
  if (displacements.size() != 3 * mesh.nodes.size() || forces.size() != displacements.size())
    throw InvalidArgument("elastic_forces: " + std::to_string(displacements.size()) + " displacements and " +
                          std::to_string(forces.size()) + " forces, expected three each for " +
                          std::to_string(mesh.nodes.size()) + " nodes");
  std::fill(forces.begin(), forces.end(), 0.0);
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const TetElement e = make_tet_element(corners(mesh, mesh.tets[i]), materials[mesh.tet_region[i]]);
    if (mesh.has_mid_edge_nodes())
      add_forces<10>(TetNodes(mesh, i), e, displacements, forces);
    else
      add_forces<4>(TetNodes(mesh, i), e, displacements, forces);
  }
}

SparseMatrix assemble_mass(const TetMesh& mesh, std::span<const Material> materials, MassKind kind, Jobs& jobs) {
  check(mesh, materials, "assemble_mass");
  return kind == MassKind::kLumped ? lumped_mass(mesh, materials) : consistent_mass(mesh, materials, jobs);
}

}  // namespace limber
