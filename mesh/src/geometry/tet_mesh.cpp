#include "limber/mesh/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <tuple>
#include <utility>

#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/mesh/ten_node_tet.h"

namespace limber {
namespace {

std::array<Vec3, 4> corners(const TetMesh& mesh, const Tet& t) {
  return {mesh.nodes[t[0]], mesh.nodes[t[1]], mesh.nodes[t[2]], mesh.nodes[t[3]]};
}

double signed_volume(const std::array<Vec3, 4>& x) { return (x[1] - x[0]).cross(x[2] - x[0]).dot(x[3] - x[0]) / 6.0; }

double longest_edge(const std::array<Vec3, 4>& x) {
  double longest = 0.0;
  for (int a = 0; a < 4; ++a)
    for (int b = a + 1; b < 4; ++b) longest = std::max(longest, (x[a] - x[b]).norm());
  return longest;
}

std::string described(const std::string& name, std::size_t tet, const Tet& t) {
  return name + ": tetrahedron " + std::to_string(tet) + " (nodes " + std::to_string(t[0]) + " " +
         std::to_string(t[1]) + " " + std::to_string(t[2]) + " " + std::to_string(t[3]) + ", counted from 0)";
}

void check_nodes(const TetMesh& mesh, const std::string& name) {
  for (std::size_t i = 0; i < mesh.nodes.size(); ++i)
    if (!mesh.nodes[i].allFinite())
      throw InputError(name + ": node " + std::to_string(i) + " (counted from 0) has a coordinate that is not finite");
}

void check_indices(const TetMesh& mesh, const std::string& name, std::size_t tet) {
  const Tet& t = mesh.tets[tet];
  for (int a = 0; a < 4; ++a) {
    if (t[a] < 0 || static_cast<std::size_t>(t[a]) >= mesh.nodes.size())
      throw InputError(described(name, tet, t) + " names node " + std::to_string(t[a]) + ", expected 0 to " +
                       std::to_string(static_cast<std::int64_t>(mesh.nodes.size()) - 1));
    for (int b = 0; b < a; ++b)
      if (t[a] == t[b]) throw InputError(described(name, tet, t) + " names node " + std::to_string(t[a]) + " twice");
  }
}

void check_regions_and_groups(const TetMesh& mesh, const std::string& name) {
  if (mesh.tet_region.size() != mesh.tets.size())
    throw InputError(name + ": " + std::to_string(mesh.tet_region.size()) + " region indices for " +
                     std::to_string(mesh.tets.size()) + " tetrahedra");
  for (const Index r : mesh.tet_region)
    if (r < 0 || static_cast<std::size_t>(r) >= mesh.regions.size())
      throw InputError(name + ": region index " + std::to_string(r) + " of " + std::to_string(mesh.regions.size()));
  for (const NodeGroup& g : mesh.node_groups)
    for (const Index i : g.nodes)
      if (i < 0 || static_cast<std::size_t>(i) >= mesh.nodes.size())
        throw InputError(name + ": node group \"" + g.name + "\" names node " + std::to_string(i) + " of " +
                         std::to_string(mesh.nodes.size()));
}

/// std::to_string would show a volume of 1e-20 as 0.
std::string in_short(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

void check_doubles(const TetMesh& mesh, const std::string& name) {
  std::vector<std::pair<Tet, std::size_t>> sorted;
  sorted.reserve(mesh.tets.size());
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    sorted.emplace_back(mesh.tets[i], i);
    std::sort(sorted.back().first.begin(), sorted.back().first.end());
  }
  std::sort(sorted.begin(), sorted.end());
  const auto twin =
      std::adjacent_find(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first == b.first; });
  if (twin != sorted.end())
    throw InputError(described(name, std::next(twin)->second, mesh.tets[std::next(twin)->second]) +
                     " has the nodes of tetrahedron " + std::to_string(twin->second) +
                     " again, expected each once; remove one");
}

// Mid-edge nodes ----------------------------------------------------------------------------------------------------

constexpr double kInTheMiddle = 1e-6;  // of an edge's length

void check_mid_edge_nodes(const TetMesh& mesh, const std::string& name, std::size_t tet) {
  const auto nodes = static_cast<Index>(mesh.nodes.size());
  for (const Index n : mesh.mid_edge_nodes[tet])
    if (n < 0 || n >= nodes)
      throw InputError(described(name, tet, mesh.tets[tet]) + " names mid-edge node " + std::to_string(n) +
                       ", expected 0 to " + std::to_string(nodes - 1));
}

/// The edges of the same corners have the same mid-edge node, and no other edge or corner has it.
void check_sharing(const TetMesh& mesh, const std::string& name) {
  struct Middle {
    std::pair<Index, Index> edge;
    Index node;
    bool operator==(const Middle&) const = default;
    bool operator<(const Middle& other) const { return std::tie(edge, node) < std::tie(other.edge, other.node); }
  };
  std::vector<Middle> middles;
  std::vector<char> is_corner(mesh.nodes.size(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) {
    for (const Index n : mesh.tets[t]) is_corner[n] = 1;
    for (std::size_t e = 0; e < kTetEdges.size(); ++e)
      middles.push_back(
          {std::minmax({mesh.tets[t][kTetEdges[e][0]], mesh.tets[t][kTetEdges[e][1]]}), mesh.mid_edge_nodes[t][e]});
  }
  std::sort(middles.begin(), middles.end());
  middles.erase(std::unique(middles.begin(), middles.end()), middles.end());
  std::vector<std::size_t> edge_of(mesh.nodes.size(), middles.size());
  for (std::size_t m = 0; m < middles.size(); ++m) {
    const auto& [edge, node] = middles[m];
    const std::string at = name + ": the edge of nodes " + std::to_string(edge.first) + " and " +
                           std::to_string(edge.second) + " (counted from 0) has mid-edge node " + std::to_string(node);
    if (m > 0 && middles[m - 1].edge == edge)
      throw InputError(at + " in one tetrahedron and " + std::to_string(middles[m - 1].node) +
                       " in another, expected one");
    if (is_corner[node]) throw InputError(at + ", which is a corner elsewhere, expected a node of its own");
    if (edge_of[node] < middles.size())
      throw InputError(at + ", which the edge of nodes " + std::to_string(middles[edge_of[node]].edge.first) + " and " +
                       std::to_string(middles[edge_of[node]].edge.second) + " has too, expected one of its own");
    edge_of[node] = m;
  }
}

/// The quadratic map from the straight tet keeps its orientation at each of its ten nodes.
void refuse_folded(const TetMesh& mesh, const std::string& name, std::size_t tet) {
  const TetNodes nodes(mesh, tet);
  const double straight = 6.0 * signed_volume(corners(mesh, mesh.tets[tet]));
  for (std::size_t at = 0; at < 10; ++at) {
    Barycentric L{};
    if (at < 4)
      L[at] = 1.0;
    else
      L[kTetEdges[at - 4][0]] = L[kTetEdges[at - 4][1]] = 0.5;
    const auto slopes = quadratic_shape_slopes(L);
    Mat3 J = Mat3::Zero();
    for (std::size_t a = 0; a < 10; ++a)
      for (std::size_t c = 0; c < 3; ++c) J.col(c) += (slopes[a][c + 1] - slopes[a][0]) * mesh.nodes[nodes[a]];
    if (!(J.determinant() > 0.0))
      throw InputError(described(name, tet, mesh.tets[tet]) + " is folded: at its node " + std::to_string(nodes[at]) +
                       " its Jacobian is " + in_short(J.determinant() / straight) +
                       " of that with straight edges, expected above 0; move its mid-edge nodes to the middles");
  }
}

/// Moves mid-edge nodes to the middles. @return the farthest that one was off, in lengths of its edge
double straighten(TetMesh& mesh, std::size_t& moved) {
  double farthest = 0.0;
  std::vector<char> done(mesh.nodes.size(), 0);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (std::size_t e = 0; e < kTetEdges.size(); ++e) {
      const Index n = mesh.mid_edge_nodes[t][e];
      if (std::exchange(done[n], 1)) continue;
      const Vec3 &a = mesh.nodes[mesh.tets[t][kTetEdges[e][0]]], &b = mesh.nodes[mesh.tets[t][kTetEdges[e][1]]];
      const Vec3 middle = 0.5 * (a + b);
      const double off = (mesh.nodes[n] - middle).norm() / (b - a).norm();
      farthest = std::max(farthest, off);
      moved += off > kInTheMiddle ? 1 : 0;
      mesh.nodes[n] = middle;
    }
  return farthest;
}

void validate_mid_edge_nodes(TetMesh& mesh, const std::string& name, Warnings& warnings) {
  for (std::size_t t = 0; t < mesh.tets.size(); ++t) refuse_folded(mesh, name, t);
  check_sharing(mesh, name);
  std::size_t moved = 0;
  const double farthest = straighten(mesh, moved);
  if (moved > 0)
    warnings.push_back(name + ": " + std::to_string(moved) + " mid-edge nodes lie off the middles of their edges, by " +
                       "up to " + in_short(farthest) + " of an edge, and have been moved there: sides are straight");
}

// Renumbering -------------------------------------------------------------------------------------------------------

/// Turns marks (negative: unused) into new indices in the old order. @return the old index of each new one
std::vector<Index> number_used(std::vector<Index>& mark) {
  std::vector<Index> old_index;
  for (std::size_t n = 0; n < mark.size(); ++n) {
    if (mark[n] < 0) continue;
    mark[n] = static_cast<Index>(old_index.size());
    old_index.push_back(static_cast<Index>(n));
  }
  return old_index;
}

std::vector<NodeGroup> renumbered(const std::vector<NodeGroup>& groups, const std::vector<Index>& new_index) {
  std::vector<NodeGroup> out;
  for (const NodeGroup& g : groups) {
    NodeGroup part{g.name, {}};
    for (const Index n : g.nodes)
      if (new_index[n] >= 0) part.nodes.push_back(new_index[n]);
    if (!part.nodes.empty()) out.push_back(std::move(part));
  }
  return out;
}

std::vector<Vec3> picked(const std::vector<Vec3>& points, const std::vector<Index>& which) {
  std::vector<Vec3> out;
  out.reserve(which.size());
  for (const Index n : which) out.push_back(points[n]);
  return out;
}

/// Numbers nodes anew in all tets.
void renumber_tets(TetMesh& mesh, const std::vector<Index>& new_index) {
  for (Tet& t : mesh.tets)
    for (Index& n : t) n = new_index[n];
  for (MidEdgeNodes& m : mesh.mid_edge_nodes)
    for (Index& n : m) n = new_index[n];
}

/// Left-handed to right-handed: the last two corners change places, and with them edges 12, 13 and edges 02, 03.
void turn(TetMesh& mesh, std::size_t tet) {
  std::swap(mesh.tets[tet][2], mesh.tets[tet][3]);
  if (!mesh.has_mid_edge_nodes()) return;
  MidEdgeNodes& m = mesh.mid_edge_nodes[tet];
  std::swap(m[1], m[4]);
  std::swap(m[2], m[3]);
}

}  // namespace

TetNodes::TetNodes(const TetMesh& mesh, std::size_t tet) {
  std::copy(mesh.tets[tet].begin(), mesh.tets[tet].end(), nodes_.begin());
  if (!mesh.has_mid_edge_nodes()) return;
  std::copy(mesh.mid_edge_nodes[tet].begin(), mesh.mid_edge_nodes[tet].end(), nodes_.begin() + 4);
  size_ = 10;
}

double signed_volume(const TetMesh& mesh, Index tet) { return signed_volume(corners(mesh, mesh.tets[tet])); }

void validate(TetMesh& mesh, const std::string& name, Warnings& warnings) {
  if (mesh.tets.empty()) throw InputError(name + ": holds no tetrahedra");
  if (mesh.has_mid_edge_nodes() && mesh.mid_edge_nodes.size() != mesh.tets.size())
    throw InputError(name + ": mid-edge nodes of " + std::to_string(mesh.mid_edge_nodes.size()) + " of " +
                     std::to_string(mesh.tets.size()) + " tetrahedra, expected of all or of none");
  check_nodes(mesh, name);
  check_regions_and_groups(mesh, name);
  std::size_t turned = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    check_indices(mesh, name, i);
    if (mesh.has_mid_edge_nodes()) check_mid_edge_nodes(mesh, name, i);
    const Tet& t = mesh.tets[i];
    const auto x = corners(mesh, t);
    const double volume = signed_volume(x);
    const double longest = longest_edge(x);
    // Written so that an overflow to inf or NaN fails too.
    if (!(6.0 * std::abs(volume) > 1e-12 * longest * longest * longest))
      throw InputError(described(name, i, t) + " is flat: volume " + in_short(volume) + " m^3 with a longest edge of " +
                       in_short(longest) + " m, expected more; remove it or remesh");
    if (volume < 0.0) {
      turn(mesh, i);
      ++turned;
    }
  }
  check_doubles(mesh, name);
  if (mesh.has_mid_edge_nodes()) validate_mid_edge_nodes(mesh, name, warnings);
  if (turned > 0)
    warnings.push_back(name + ": " + std::to_string(turned) + " of " + std::to_string(mesh.tets.size()) +
                       " tetrahedra were left-handed and have been re-oriented");
}

std::vector<Index> drop_unused_nodes(TetMesh& mesh) {
  std::vector<Index> new_index(mesh.nodes.size(), -1);
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (const Index n : TetNodes(mesh, t)) new_index[n] = 0;
  auto node_of = number_used(new_index);
  mesh.nodes = picked(mesh.nodes, node_of);
  mesh.node_groups = renumbered(mesh.node_groups, new_index);
  renumber_tets(mesh, new_index);
  return node_of;
}

VolumeProperties volume_properties(const TetMesh& mesh) {
  VolumeProperties p;
  if (mesh.tets.empty()) return p;
  // Moments about a point of the mesh: about a far origin they would cancel.
  const Vec3 base = mesh.nodes[mesh.tets[0][0]];
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const Tet& t : mesh.tets) {
    auto x = corners(mesh, t);
    for (Vec3& c : x) c -= base;
    const double v = signed_volume(x);
    const Vec3 sum = x[0] + x[1] + x[2] + x[3];
    p.volume += v;
    first += v / 4.0 * sum;
    // ∫ x xᵀ dV of a linear tet: V/20 (Σ xₐxₐᵀ + (Σxₐ)(Σxₐ)ᵀ)
    second += v / 20.0 * (sum * sum.transpose());
    for (const Vec3& c : x) second += v / 20.0 * (c * c.transpose());
  }
  const Vec3 c = first / p.volume;
  p.centroid = base + c;
  p.second_moment = second - p.volume * (c * c.transpose());
  return p;
}

std::vector<Index> connected_components(const TetMesh& mesh) {
  DisjointSets sets(mesh.nodes.size());
  for (const Tet& t : mesh.tets)
    for (int a = 1; a < 4; ++a) sets.join(t[a], t[0]);
  std::vector<Index> label_of_root(mesh.nodes.size(), -1), component(mesh.tets.size());
  Index count = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    Index& label = label_of_root[sets.root(mesh.tets[i][0])];
    if (label < 0) label = count++;
    component[i] = label;
  }
  return component;
}

std::vector<Index> face_connected_parts(const TetMesh& mesh) {
  struct Face {
    Triangle nodes;  // sorted
    Index tet;
  };
  std::vector<Face> faces;
  faces.reserve(4 * mesh.tets.size());
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    for (int opposite = 0; opposite < 4; ++opposite) {
      Face f{.nodes = {}, .tet = static_cast<Index>(t)};
      for (int a = 0, b = 0; a < 4; ++a)
        if (a != opposite) f.nodes[b++] = mesh.tets[t][a];
      std::sort(f.nodes.begin(), f.nodes.end());
      faces.push_back(f);
    }
  std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.nodes < b.nodes; });
  DisjointSets sets(mesh.tets.size());
  for (std::size_t f = 1; f < faces.size(); ++f)
    if (faces[f].nodes == faces[f - 1].nodes) sets.join(faces[f].tet, faces[f - 1].tet);
  return sets.labels();
}

SubMesh extract_component(const TetMesh& mesh, std::span<const Index> component, Index which) {
  if (component.size() != mesh.tets.size())
    throw InvalidArgument("extract_component: " + std::to_string(component.size()) + " labels for " +
                          std::to_string(mesh.tets.size()) + " tetrahedra");
  SubMesh sub;
  sub.mesh.regions = mesh.regions;
  std::vector<Index> new_index(mesh.nodes.size(), -1);
  for (std::size_t i = 0; i < mesh.tets.size(); ++i)
    if (component[i] == which)
      for (const Index n : TetNodes(mesh, i)) new_index[n] = 0;
  sub.node_of = number_used(new_index);
  sub.mesh.nodes = picked(mesh.nodes, sub.node_of);
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    if (component[i] != which) continue;
    sub.mesh.tets.push_back(mesh.tets[i]);
    if (mesh.has_mid_edge_nodes()) sub.mesh.mid_edge_nodes.push_back(mesh.mid_edge_nodes[i]);
    sub.mesh.tet_region.push_back(mesh.tet_region[i]);
    sub.tet_of.push_back(static_cast<Index>(i));
  }
  renumber_tets(sub.mesh, new_index);
  sub.mesh.node_groups = renumbered(mesh.node_groups, new_index);
  return sub;
}

}  // namespace limber
