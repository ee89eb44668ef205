/// @file limber/articulation/assembly.h
/// A CAD-like model taken apart: the rigid components that a pile of triangles consists of.
///
/// Components are found by what shares vertices (index connectivity), never by position: parts that touch exactly would
/// become one. Only a soup, in which no two faces share a vertex, is joined by position: across edges
/// whose two triangles continue each other, so that a pin that fills its hole still stays apart from it. Lengths are in
/// the file's own unit throughout; nothing depends on which it is. Source: [X09] 3.1.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "limber/core/types.h"
#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/surface_mesh.h"

namespace limber {

/// Faces `first` to `first + count − 1` of the input file, counted from 0 in file order.
struct FaceRange {
  Index first = 0, count = 0;
  friend bool operator==(const FaceRange&, const FaceRange&) = default;
};

/// One rigid part.
struct Component {
  std::string name;              ///< unique in its assembly, never empty
  std::vector<FaceRange> faces;  ///< ascending, neither empty nor adjacent
  std::vector<Index> triangles;  ///< the same as triangles of Assembly::source, ascending
  SurfaceMesh surface;           ///< its own triangles, in the order of `triangles`, over its own vertices, welded
  bool closed = false;           ///< whether the surface, with `caps`, bounds a solid
  /// Over the small holes of a surface that is meant to bound a solid (each of less than 1 % of its area, 5 %
  /// together), as triangles over its vertices, turned like it. They tell inside from outside and are no surface to
  /// touch.
  std::vector<Triangle> caps{};
  double diagonal = 0.0;  ///< of the bounding box along the axes
};

/// Several components that look like one part drawn in pieces.
struct MergeProposal {
  std::vector<Index> components;  ///< ascending, two or more
  std::string reason;             ///< one sentence
};

/// The surface with its caps. A point's winding number about it is a whole number; about the surface alone
/// [Jacobson et al., "Robust inside-outside segmentation using generalized winding numbers", 2013] it differs by the
/// caps' solid angle over 4π, so that both say the same side of ½ wherever the caps fill less than half the view.
SurfaceMesh bounding_surface(const Component& component);

struct Assembly {
  SurfaceMesh source;  ///< the whole input, as read
  std::vector<Component> components;
  std::vector<MergeProposal> proposals;  ///< not applied
  double diagonal = 0.0;                 ///< of the bounding box of all
};

enum class ComponentRule {
  kConnectivity,  ///< triangles that share vertices; names from the groups
  kGroups,        ///< one component per name of a group
  kMaterials,     ///< one component per material
};

struct ComponentOptions {
  ComponentRule rule = ComponentRule::kConnectivity;
  /// Of the whole's diagonal; vertices of a soup that are nearer count as one. ≥ 0; by default 32 last bits of a float.
  double weld_tolerance = 0x1p-18;
  /// Each list becomes one component under the first name, after the rule has been applied. Names as the rule gives
  /// them.
  std::vector<std::vector<std::string>> merge = {};
  std::vector<std::pair<std::string, std::string>> rename = {};  ///< old name, new name; after merging
};

/// Takes a surface apart. Components come in the order of their first triangle. Names: that of the file's group where
/// there is one (with ` 2`, ` 3` … where several components share it), else `part 1`, `part 2` …
/// Time and memory grow linearly with triangles but for a sort.
/// @throws InvalidArgument if a name to merge or rename does not exist or becomes double, or an option is out of range
Assembly find_components(const GroupedSurface& input, const ComponentOptions& options = {});

/// The component of this name. @throws InvalidArgument if there is none
Index component_named(const Assembly& assembly, const std::string& name);

}  // namespace limber
