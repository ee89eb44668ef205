#include "limber/precompute/fem.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>

#include "limber/core/error.h"

namespace limber {
namespace {

constexpr std::size_t kGrain = 512;  // tets or nodes per task: tens of microseconds

/// Ingredients of a tet's 3 × 3 blocks. Displacement u = Σ_a φ_a u_a with constant gradients g_a = ∇φ_a.
struct Element {
  std::array<Vec3, 4> gradient;  // 1/m, summing to zero
  double lambda_volume = 0.0;    // λV, N·m
  double mu_volume = 0.0;        // μV, N·m
};

Element make_element(const std::array<Vec3, 4>& x, const Material& material) {
  const Vec3 e1 = x[1] - x[0], e2 = x[2] - x[0], e3 = x[3] - x[0];
  const double six_volumes = e1.cross(e2).dot(e3);
  Element e;
  e.gradient[1] = e2.cross(e3) / six_volumes;
  e.gradient[2] = e3.cross(e1) / six_volumes;
  e.gradient[3] = e1.cross(e2) / six_volumes;
  e.gradient[0] = -(e.gradient[1] + e.gradient[2] + e.gradient[3]);
  e.lambda_volume = material.lame_lambda() * six_volumes / 6.0;
  e.mu_volume = material.shear_modulus() * six_volumes / 6.0;
  return e;
}

// K_ab = V (λ g_a g_bᵀ + μ g_b g_aᵀ + μ (g_a·g_b) I). Each product has the same factors in K_ba, so K_baᵀ = K_ab to the
// bit; the order of the sums below keeps that.
Mat3 stiffness_block(const Element& e, int a, int b) {
  const Vec3 &ga = e.gradient[a], &gb = e.gradient[b];
  const double isotropic = e.mu_volume * (ga[0] * gb[0] + ga[1] * gb[1] + ga[2] * gb[2]);
  Mat3 block;
  for (int p = 0; p < 3; ++p)
    for (int q = 0; q < 3; ++q)
      block(p, q) = (e.lambda_volume * (ga[p] * gb[q]) + e.mu_volume * (gb[p] * ga[q])) + (p == q ? isotropic : 0.0);
  return block;
}

std::array<Vec3, 4> corners(const TetMesh& mesh, const Tet& t) {
  return {mesh.nodes[t[0]], mesh.nodes[t[1]], mesh.nodes[t[2]], mesh.nodes[t[3]]};
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
  for (const Tet& t : mesh.tets)
    for (const Index node : t) ++graph.tet_start[node + 1];
  accumulate(graph.tet_start, "corners of tetrahedra");
  graph.tet.resize(4 * mesh.tets.size());
  std::vector<Index> next(graph.tet_start.begin(), graph.tet_start.end() - 1);
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : mesh.tets[e]) graph.tet[next[node]++] = static_cast<Index>(e);
}

void find_neighbours(const TetMesh& mesh, const NodeGraph& graph, Index node, std::vector<Index>& found) {
  found.clear();
  for (const Index e : graph.tets_of(node)) found.insert(found.end(), mesh.tets[e].begin(), mesh.tets[e].end());
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

/// Places of the corners of one tet in the list of a node's neighbours.
std::array<std::size_t, 4> places(std::span<const Index> neighbours, const Tet& t) {
  std::array<std::size_t, 4> place{};
  for (int a = 0; a < 4; ++a)
    place[a] = std::lower_bound(neighbours.begin(), neighbours.end(), t[a]) - neighbours.begin();
  return place;
}

/// Adds what one node's tets give to its three columns. @param blocks one per neighbour, zero on entry
void add_stiffness(const TetMesh& mesh, std::span<const Element> elements, const NodeGraph& graph, Index node,
                   std::vector<Mat3>& blocks) {
  for (const Index e : graph.tets_of(node)) {
    const Tet& t = mesh.tets[e];
    const auto place = places(graph.neighbours_of(node), t);
    const int own = static_cast<int>(std::find(t.begin(), t.end(), node) - t.begin());
    for (int a = 0; a < 4; ++a) blocks[place[a]] += stiffness_block(elements[e], a, own);
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

/// ρV/20 or ρV/4 of each tet, kg: the unit its mass block is written in.
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
  const auto quarter = mass_units(mesh, materials, 1.0 / 4.0);
  for (std::size_t e = 0; e < mesh.tets.size(); ++e)
    for (const Index node : mesh.tets[e]) M.value[node] += quarter[e];
  for (Index i = 0; i <= M.size; ++i) M.column_start.push_back(i);
  M.row.assign(M.column_start.begin(), M.column_start.end() - 1);
  return M;
}

SparseMatrix consistent_mass(const TetMesh& mesh, std::span<const Material> materials, Jobs& jobs) {
  NodeGraph graph = make_node_graph(mesh, jobs);
  SparseMatrix M;
  M.size = static_cast<Index>(mesh.nodes.size());
  M.value.assign(graph.neighbour.size(), 0.0);
  const auto twentieth = mass_units(mesh, materials, 1.0 / 20.0);
  jobs.parallel_for(mesh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (Index node = static_cast<Index>(begin); node < static_cast<Index>(end); ++node) {
      double* column = M.value.data() + graph.neighbour_start[node];
      for (const Index e : graph.tets_of(node)) {
        const Tet& t = mesh.tets[e];
        const auto place = places(graph.neighbours_of(node), t);
        for (int a = 0; a < 4; ++a) column[place[a]] += t[a] == node ? 2.0 * twentieth[e] : twentieth[e];
      }
    }
  });
  M.column_start = std::move(graph.neighbour_start);
  M.row = std::move(graph.neighbour);
  return M;
}

}  // namespace

std::array<double, 144> tet_stiffness(const std::array<Vec3, 4>& x, const Material& material) {
  material.validate("tet_stiffness");
  const Element e = make_element(x, material);
  std::array<double, 144> K{};
  for (int a = 0; a < 4; ++a)
    for (int b = 0; b < 4; ++b) {
      const Mat3 block = stiffness_block(e, a, b);
      for (int p = 0; p < 3; ++p)
        for (int q = 0; q < 3; ++q) K[12 * (3 * a + p) + 3 * b + q] = block(p, q);
    }
  return K;
}

SparseMatrix assemble_stiffness(const TetMesh& mesh, std::span<const Material> materials, Jobs& jobs) {
  check(mesh, materials, "assemble_stiffness");
  std::vector<Element> elements(mesh.tets.size());
  jobs.parallel_for(elements.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t e = begin; e < end; ++e)
      elements[e] = make_element(corners(mesh, mesh.tets[e]), materials[mesh.tet_region[e]]);
  });
  const NodeGraph graph = make_node_graph(mesh, jobs);
  SparseMatrix K = stiffness_pattern(graph);
  jobs.parallel_for(mesh.nodes.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    std::vector<Mat3> blocks;
    for (Index node = static_cast<Index>(begin); node < static_cast<Index>(end); ++node) {
      const auto neighbours = graph.neighbours_of(node);
      blocks.assign(neighbours.size(), Mat3::Zero());
      add_stiffness(mesh, elements, graph, node, blocks);
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
  const auto u = [&](Index node) { return Eigen::Map<const Vec3>(displacements.data() + 3 * node); };
  const auto f = [&](Index node) { return Eigen::Map<Vec3>(forces.data() + 3 * node); };
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    const Tet& t = mesh.tets[i];
    const Element e = make_element(corners(mesh, t), materials[mesh.tet_region[i]]);
    Mat3 gradient = Mat3::Zero();
    for (int a = 1; a < 4; ++a) gradient += (u(t[a]) - u(t[0])) * e.gradient[a].transpose();
    const Mat3 stress_volume =
        e.lambda_volume * gradient.trace() * Mat3::Identity() + e.mu_volume * (gradient + gradient.transpose());
    for (int a = 1; a < 4; ++a) {
      const Vec3 force = stress_volume * e.gradient[a];
      f(t[a]) += force;
      f(t[0]) -= force;
    }
  }
}

SparseMatrix assemble_mass(const TetMesh& mesh, std::span<const Material> materials, MassKind kind, Jobs& jobs) {
  check(mesh, materials, "assemble_mass");
  return kind == MassKind::kLumped ? lumped_mass(mesh, materials) : consistent_mass(mesh, materials, jobs);
}

}  // namespace limber
