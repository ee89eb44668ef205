#include "limber/mesh/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"

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

}  // namespace

double signed_volume(const TetMesh& mesh, Index tet) { return signed_volume(corners(mesh, mesh.tets[tet])); }

void validate(TetMesh& mesh, const std::string& name, Warnings& warnings) {
  if (mesh.tets.empty()) throw InputError(name + ": holds no tetrahedra");
  check_nodes(mesh, name);
  check_regions_and_groups(mesh, name);
  std::size_t turned = 0;
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    check_indices(mesh, name, i);
    Tet& t = mesh.tets[i];
    const auto x = corners(mesh, t);
    const double volume = signed_volume(x);
    const double longest = longest_edge(x);
    // Written so that an overflow to inf or NaN fails too.
    if (!(6.0 * std::abs(volume) > 1e-12 * longest * longest * longest))
      throw InputError(described(name, i, t) + " is flat: volume " + in_short(volume) + " m^3 with a longest edge of " +
                       in_short(longest) + " m, expected more; remove it or remesh");
    if (volume < 0.0) {
      std::swap(t[2], t[3]);
      ++turned;
    }
  }
  check_doubles(mesh, name);
  if (turned > 0)
    warnings.push_back(name + ": " + std::to_string(turned) + " of " + std::to_string(mesh.tets.size()) +
                       " tetrahedra were left-handed and have been re-oriented");
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
      for (const Index n : mesh.tets[i]) new_index[n] = 0;
  sub.node_of = number_used(new_index);
  sub.mesh.nodes = picked(mesh.nodes, sub.node_of);
  for (std::size_t i = 0; i < mesh.tets.size(); ++i) {
    if (component[i] != which) continue;
    const Tet& t = mesh.tets[i];
    sub.mesh.tets.push_back({new_index[t[0]], new_index[t[1]], new_index[t[2]], new_index[t[3]]});
    sub.mesh.tet_region.push_back(mesh.tet_region[i]);
    sub.tet_of.push_back(static_cast<Index>(i));
  }
  sub.mesh.node_groups = renumbered(mesh.node_groups, new_index);
  return sub;
}

}  // namespace limber
