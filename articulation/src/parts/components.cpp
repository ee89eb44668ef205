#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <unordered_map>
#include <unordered_set>

#include "limber/articulation/assembly.h"
#include "limber/core/disjoint_sets.h"
#include "limber/core/error.h"
#include "limber/mesh/mend_surface.h"
#include "parts/hole_caps.h"
#include "parts/soup.h"

namespace limber {
namespace {

/// Triangle sets under way: a label per triangle, and a name per label.
struct Partition {
  std::vector<Index> label;  ///< per triangle
  std::vector<std::string> name;
};

void require(bool holds, const std::string& message) {
  if (!holds) throw InvalidArgument("find_components: " + message);
}

void check_input(const GroupedSurface& input) {
  const auto triangles = static_cast<std::int64_t>(input.surface.triangles.size());
  require(triangles > 0, "the surface has no triangles");
  require(static_cast<std::int64_t>(input.face_of.size()) == triangles,
          "face_of has " + std::to_string(input.face_of.size()) + " entries for " + std::to_string(triangles) +
              " triangles");
  std::int64_t next = 0;
  for (const SurfaceGroup& group : input.groups) {
    require(group.first == next && group.count >= 0, "groups do not follow one another");
    next += group.count;
  }
  require(next == triangles,
          "groups cover " + std::to_string(next) + " of " + std::to_string(triangles) + " triangles");
  const auto vertices = static_cast<std::int64_t>(input.surface.vertices.size());
  for (const Triangle& t : input.surface.triangles)
    for (const Index v : t)
      require(v >= 0 && v < vertices,
              "a triangle names vertex " + std::to_string(v) + " of " + std::to_string(vertices));
}

double box_diagonal(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

/// Per triangle the number of its group.
std::vector<Index> group_of_triangles(const GroupedSurface& input) {
  std::vector<Index> of(input.surface.triangles.size(), 0);
  for (std::size_t g = 0; g < input.groups.size(); ++g)
    std::fill_n(of.begin() + input.groups[g].first, input.groups[g].count, static_cast<Index>(g));
  return of;
}

/// Whether no two faces share a vertex.
bool is_soup(const GroupedSurface& input) {
  std::vector<Index> face_at(input.surface.vertices.size(), -1);
  for (std::size_t i = 0; i < input.surface.triangles.size(); ++i)
    for (const Index v : input.surface.triangles[i]) {
      Index& face = face_at[static_cast<std::size_t>(v)];
      if (face >= 0 && face != input.face_of[i]) return false;
      face = input.face_of[i];
    }
  return input.face_of.front() != input.face_of.back();
}

std::vector<Index> shells_by_index(const SurfaceMesh& surface) {
  DisjointSets sets(surface.vertices.size());
  for (const Triangle& t : surface.triangles) {
    sets.join(t[1], t[0]);
    sets.join(t[2], t[0]);
  }
  // Numbered by first triangle.
  std::vector<Index> number(surface.vertices.size(), -1), label;
  Index count = 0;
  for (const Triangle& t : surface.triangles) {
    Index& n = number[static_cast<std::size_t>(sets.root(t[0]))];
    if (n < 0) n = count++;
    label.push_back(n);
  }
  return label;
}

/// What the file calls the group of each shell's first triangle: its name, or else material. A name that all shells
/// share tells none from another, so it is left out.
std::vector<std::string> drawn_names(const GroupedSurface& input, const std::vector<Index>& label) {
  const auto group_of = group_of_triangles(input);
  std::vector<std::string> names;
  for (const auto which : {&SurfaceGroup::name, &SurfaceGroup::material}) {
    names.clear();
    for (std::size_t t = 0; t < label.size(); ++t)
      if (label[t] == static_cast<Index>(names.size()))
        names.push_back(input.groups[static_cast<std::size_t>(group_of[t])].*which);
    if (names.size() == 1 || std::adjacent_find(names.begin(), names.end(), std::not_equal_to<>()) != names.end())
      return names;
  }
  return std::vector<std::string>(names.size());
}

/// Names of shells, numbered where several share one.
std::vector<std::string> shell_names(const GroupedSurface& input, const std::vector<Index>& label) {
  std::vector<std::string> names = drawn_names(input, label);
  std::unordered_map<std::string, int> shared, seen;
  std::unordered_set<std::string> taken;
  for (const auto& name : names) ++shared[name];
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string base = names[i].empty() ? "part" : names[i];
    const bool alone = !names[i].empty() && shared[names[i]] == 1;
    int& count = seen[base];
    std::string unique;
    do {
      ++count;
      unique = alone || (count == 1 && !names[i].empty()) ? base : base + " " + std::to_string(count);
    } while (!taken.insert(unique).second);
    names[i] = unique;
  }
  return names;
}

/// @param tolerance of vertices of a soup
Partition by_connectivity(const GroupedSurface& input, bool soup, double tolerance) {
  Partition out;
  out.label = soup ? internal::shells_of_soup(input.surface, tolerance) : shells_by_index(input.surface);
  out.name = shell_names(input, out.label);
  return out;
}

Partition by_name(const GroupedSurface& input, std::string SurfaceGroup::*which) {
  Partition out;
  std::unordered_map<std::string, Index> number;
  for (const SurfaceGroup& group : input.groups) {
    if (group.count == 0) continue;
    const std::string& name = (group.*which).empty() ? "unnamed" : group.*which;
    const auto [place, is_new] = number.try_emplace(name, static_cast<Index>(out.name.size()));
    if (is_new) out.name.push_back(name);
    out.label.insert(out.label.end(), static_cast<std::size_t>(group.count), place->second);
  }
  return out;
}

Index find_name(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  require(found != names.end(), "there is no component \"" + name + "\"");
  return static_cast<Index>(found - names.begin());
}

/// Applies the user's merging and renaming; labels stay numbered by first triangle.
void apply_wishes(const ComponentOptions& options, Partition& partition) {
  DisjointSets sets(partition.name.size());
  std::map<Index, std::string> chosen;  // by a member of the set
  for (const auto& list : options.merge) {
    require(list.size() >= 2, "a list to merge names fewer than two components");
    const Index first = find_name(partition.name, list.front());
    for (const auto& name : list) sets.join(find_name(partition.name, name), first);
    chosen.try_emplace(first, list.front());
  }
  std::vector<std::string> names(partition.name.size());
  for (std::size_t i = 0; i < names.size(); ++i)
    if (sets.root(static_cast<Index>(i)) == static_cast<Index>(i)) names[i] = partition.name[i];
  for (const auto& [member, name] : chosen) names[static_cast<std::size_t>(sets.root(member))] = name;
  const auto new_label = sets.labels();
  Partition out;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (sets.root(static_cast<Index>(i)) == static_cast<Index>(i)) out.name.push_back(names[i]);
  for (const Index l : partition.label) out.label.push_back(new_label[static_cast<std::size_t>(l)]);
  for (const auto& [from, to] : options.rename) {
    require(!to.empty(), "the new name of \"" + from + "\" is empty");
    out.name[static_cast<std::size_t>(find_name(out.name, from))] = to;
  }
  std::unordered_set<std::string> taken;
  for (const auto& name : out.name) require(taken.insert(name).second, "two components are called \"" + name + "\"");
  partition = std::move(out);
}

std::vector<FaceRange> face_ranges(const std::vector<Index>& triangles, const std::vector<Index>& face_of) {
  std::vector<FaceRange> ranges;
  for (const Index t : triangles) {
    const Index face = face_of[static_cast<std::size_t>(t)];
    if (!ranges.empty() && face < ranges.back().first + ranges.back().count) continue;
    if (!ranges.empty() && face == ranges.back().first + ranges.back().count)
      ++ranges.back().count;
    else
      ranges.push_back({face, 1});
  }
  return ranges;
}

/// @param triangles of the source; those that name a vertex twice once it is welded go
SurfaceMesh own_surface(const SurfaceMesh& source, double tolerance, std::vector<Index>& triangles,
                        std::vector<Index>& scratch) {
  SurfaceMesh out;
  std::vector<Index> used;
  for (const Index index : triangles) {
    Triangle t = source.triangles[static_cast<std::size_t>(index)];
    for (Index& v : t) {
      Index& local = scratch[static_cast<std::size_t>(v)];
      if (local < 0) {
        local = static_cast<Index>(out.vertices.size());
        used.push_back(v);
        out.vertices.push_back(source.vertices[static_cast<std::size_t>(v)]);
      }
      v = local;
    }
    out.triangles.push_back(t);
  }
  for (const Index v : used) scratch[static_cast<std::size_t>(v)] = -1;
  weld_within(out, tolerance);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = out.triangles[i];
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    triangles[kept] = triangles[i];
    out.triangles[kept++] = t;
  }
  triangles.resize(kept);
  out.triangles.resize(kept);
  return out;
}

/// Shells that the file draws under one name, where the file has several names: a bolt drawn as head, shaft and nut.
void propose_by_name(const GroupedSurface& input, Assembly& assembly) {
  const auto group_of = group_of_triangles(input);
  std::map<std::string, std::vector<Index>> members;
  for (std::size_t c = 0; c < assembly.components.size(); ++c) {
    const auto first = static_cast<std::size_t>(assembly.components[c].triangles.front());
    const auto& name = input.groups[static_cast<std::size_t>(group_of[first])].name;
    if (!name.empty()) members[name].push_back(static_cast<Index>(c));
  }
  if (members.size() < 2) return;
  for (auto& [name, list] : members)
    if (list.size() > 1)
      assembly.proposals.push_back({list, "the file draws these " + std::to_string(list.size()) +
                                              " shells under the one name \"" + name + "\""});
}

}  // namespace

Assembly find_components(const GroupedSurface& input, const ComponentOptions& options) {
  check_input(input);
  require(options.weld_tolerance >= 0.0 && options.weld_tolerance < 1.0,
          "weld_tolerance is " + std::to_string(options.weld_tolerance) + ", expected 0 or more and below 1");
  Assembly out;
  out.source = input.surface;
  out.diagonal = box_diagonal(input.surface.vertices);

  const bool soup = is_soup(input);
  const double tolerance = soup ? options.weld_tolerance * out.diagonal : 0.0;
  Partition partition =
      options.rule == ComponentRule::kConnectivity
          ? by_connectivity(input, soup, tolerance)
          : by_name(input, options.rule == ComponentRule::kGroups ? &SurfaceGroup::name : &SurfaceGroup::material);
  apply_wishes(options, partition);

  out.components.resize(partition.name.size());
  for (std::size_t t = 0; t < partition.label.size(); ++t)
    out.components[static_cast<std::size_t>(partition.label[t])].triangles.push_back(static_cast<Index>(t));
  std::vector<Index> scratch(input.surface.vertices.size(), -1);
  for (std::size_t c = 0; c < out.components.size(); ++c) {
    Component& component = out.components[c];
    component.name = std::move(partition.name[c]);
    component.faces = face_ranges(component.triangles, input.face_of);
    component.surface = own_surface(input.surface, tolerance, component.triangles, scratch);
    component.closed = surface_quality(component.surface).closed_manifold();
    if (auto caps = component.closed ? std::nullopt : internal::small_hole_caps(component.surface))
      component.closed = true, component.caps = std::move(*caps);
    component.diagonal = box_diagonal(component.surface.vertices);
  }
  std::erase_if(out.components, [](const Component& c) { return c.triangles.empty(); });
  if (options.rule == ComponentRule::kConnectivity) {
    propose_by_name(input, out);
    internal::propose_by_open_edges(out);
  }
  return out;
}

SurfaceMesh bounding_surface(const Component& component) {
  SurfaceMesh out = component.surface;
  out.triangles.insert(out.triangles.end(), component.caps.begin(), component.caps.end());
  return out;
}

Index component_named(const Assembly& assembly, const std::string& name) {
  for (std::size_t c = 0; c < assembly.components.size(); ++c)
    if (assembly.components[c].name == name) return static_cast<Index>(c);
  throw InvalidArgument("component_named: there is no component \"" + name + "\"");
}

}  // namespace limber
