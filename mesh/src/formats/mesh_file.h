/// The common form of files that may hold tetrahedra, polygons, or both, and the readers, one source
/// file each. Private to the module.
#pragma once

#include <array>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "formats/polygons.h"
#include "limber/core/types.h"
#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/tet_mesh.h"

namespace limber::internal {

/// Polygons from `first` on carry these names, until the next group begins.
struct PolygonGroup {
  std::string name, material;
  std::size_t first = 0;
};

/// The content of one file, not yet validated. Without tets it is a surface.
struct MeshFile {
  TetMesh tets;
  Polygons polygons;                 ///< over tets.nodes
  std::vector<PolygonGroup> groups;  ///< ascending; polygons before the first have no names
};

/// A file in memory, its name quoted for messages.
struct FileBytes {
  std::string name;
  std::string_view bytes;
};

/// A format's ten-node tet: for each of kTetEdges the place of its middle among the six that follow the corners.
using MidEdgeOrder = std::array<std::size_t, 6>;
inline constexpr MidEdgeOrder kVtkMidEdges{0, 1, 2, 3, 4, 5};
inline constexpr MidEdgeOrder kMeditMidEdges{0, 1, 2, 3, 4, 5};
inline constexpr MidEdgeOrder kGmshMidEdges{0, 1, 2, 3, 5, 4};
inline constexpr MidEdgeOrder kTetgenMidEdges{2, 3, 5, 1, 4, 0};

/// Appends a tet of four or ten nodes as its format orders them. @param nodes 4 or 10
/// @return false, and nothing is appended, where tets of the other kind are there already
bool push_tet(TetMesh& mesh, std::span<const Index> nodes, const MidEdgeOrder& order);

MeshFile read_gmsh(const FileBytes& file, Warnings& warnings);
MeshFile read_medit(const FileBytes& file, Warnings& warnings);
MeshFile read_vtk(const FileBytes& file, Warnings& warnings);
MeshFile read_obj(const FileBytes& file);
MeshFile read_stl(const FileBytes& file);
MeshFile read_ply(const FileBytes& file);
MeshFile read_off(const FileBytes& file);
/// Whether a glTF file says to be of version 1, which is another format.
bool is_gltf_1(std::string_view bytes);
/// @param path beside which buffers lie
MeshFile read_gltf(const std::filesystem::path& path, const FileBytes& file, Warnings& warnings);
/// @param path of the .node or the .ele file; the other lies beside it
MeshFile read_tetgen(const std::filesystem::path& path);

/// Regions in order of the first tet that has each.
class RegionTable {
 public:
  explicit RegionTable(TetMesh& mesh) : mesh_(mesh) {}
  /// Gives the next tet the region (kind, tag), made on first sight with the name that name(tag) returns.
  template <class F>
  void push(int kind, int tag, F&& name) {
    if (!last_ || last_key_ != std::pair(kind, tag)) {
      last_key_ = {kind, tag};
      const auto [place, is_new] = index_.try_emplace(last_key_, static_cast<Index>(mesh_.regions.size()));
      if (is_new) mesh_.regions.push_back({name(tag), tag});
      last_ = place->second;
    }
    mesh_.tet_region.push_back(*last_);
  }

 private:
  TetMesh& mesh_;
  std::map<std::pair<int, int>, Index> index_;
  std::pair<int, int> last_key_;
  std::optional<Index> last_;
};

/// Node groups as a file gives them: by the dimension of what carries them (0 points … 3 volumes) and a number.
class GroupCollector {
 public:
  /// The nodes of a group so far, repeats allowed. The reference stays good.
  std::vector<Index>& nodes(int dim, int tag) { return groups_[{dim, tag}]; }
  void set_name(int dim, int tag, std::string name) { names_[{dim, tag}] = std::move(name); }
  /// The name that was set, or the number as text.
  std::string name(int dim, int tag) const;

  /// Writes the groups into the mesh, sorted by name, and makes one more of each region whose name is still free.
  /// Groups of points, curves and surfaces that share a name given by the user are joined. A bare number that several
  /// dimensions use stands for the surface, else the curve, else the points, else the volume.
  /// @return whether a number was shared so
  bool finish(TetMesh& mesh) const;

 private:
  std::map<std::pair<int, int>, std::vector<Index>> groups_;
  std::map<std::pair<int, int>, std::string> names_;
};

/// Node numbers of a file, which may have gaps and any order, to indices in order of appearance.
class NodeNumbers {
 public:
  void reserve(std::size_t count) { numbers_.reserve(count); }
  void push(std::int64_t number) { numbers_.push_back(number); }
  /// Ends the list. @return a number that stood twice, if one did
  std::optional<std::int64_t> finish();
  /// The index of a number, −1 if there is none. @pre finish() was called
  Index find(std::int64_t number) const;

 private:
  std::vector<std::int64_t> numbers_;
  std::int64_t first_ = 0;
  std::vector<Index> dense_;  // by number − first_, where that wastes little
  std::unordered_map<std::int64_t, Index> sparse_;
};

}  // namespace limber::internal
