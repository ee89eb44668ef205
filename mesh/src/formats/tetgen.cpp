// TetGen's .node and .ele, as its manual describes them.
#include <cmath>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"
#include "limber/core/file.h"

namespace limber::internal {
namespace {

std::filesystem::path with_extension(std::filesystem::path path, const char* extension) {
  return path.replace_extension(extension);
}

class TetgenReader {
 public:
  explicit TetgenReader(const std::filesystem::path& path)
      : node_path_(with_extension(path, ".node")),
        ele_path_(with_extension(path, ".ele")),
        node_bytes_(read_file(node_path_)),
        ele_bytes_(read_file(ele_path_)),
        regions_(mesh_.tets) {}

  MeshFile read() {
    read_nodes();
    read_elements();
    groups_.finish(mesh_.tets);
    return std::move(mesh_);
  }

 private:
  static constexpr FileScanner::Syntax kSyntax = {.comment = '#'};

  void read_nodes() {
    FileScanner in(node_bytes_, shown_path(node_path_), kSyntax);
    const auto count = in.count(7, "number of nodes");
    in.integer(3, 3, "a dimension");
    const auto attributes = in.integer(0, 1'000'000, "a number of attributes");
    const bool markers = in.integer(0, 1, "a flag for boundary markers") == 1;
    mesh_.tets.nodes.reserve(static_cast<std::size_t>(count));
    for (Index i = 0; i < count; ++i) {
      read_number(in, i, "a node number");
      const double x = in.real("a coordinate"), y = in.real("a coordinate"), z = in.real("a coordinate");
      mesh_.tets.nodes.emplace_back(x, y, z);
      for (std::int64_t a = 0; a < attributes; ++a) in.real("an attribute");
      if (!markers) continue;
      const auto marker = in.integer(std::numeric_limits<int>::min(), std::numeric_limits<int>::max(), "a marker");
      if (marker != 0) groups_.nodes(0, static_cast<int>(marker)).push_back(i);
    }
    refuse_more(in, "nodes");
  }

  void read_elements() {
    FileScanner in(ele_bytes_, shown_path(ele_path_), kSyntax);
    const auto count = in.count(9, "number of tetrahedra");
    const auto per_tet = in.integer("nodes per tetrahedron");
    if (per_tet != 4 && per_tet != 10)
      in.fail("seen " + std::to_string(per_tet) + " nodes per tetrahedron, expected 4, or 10 of tetgen -o2");
    const auto attributes = in.integer(0, 1'000'000, "a number of attributes");
    const auto nodes = static_cast<std::int64_t>(mesh_.tets.nodes.size());
    mesh_.tets.tets.reserve(static_cast<std::size_t>(count));
    std::vector<Index> tet(static_cast<std::size_t>(per_tet));
    for (Index i = 0; i < count; ++i) {
      read_number(in, i, "a tetrahedron's number");
      for (Index& n : tet) n = static_cast<Index>(in.integer(first_, first_ + nodes - 1, "a node") - first_);
      push_tet(mesh_.tets, tet, kTetgenMidEdges);
      push_region(in, attributes);
    }
    refuse_more(in, "tetrahedra");
  }

  /// Items are numbered one by one from 0 or from 1, both files alike; the first node tells.
  void read_number(FileScanner& in, Index i, const char* expected) {
    if (mesh_.tets.nodes.empty())
      first_ = in.integer(0, 1, expected);
    else
      in.integer(first_ + i, first_ + i, expected);
  }

  /// The first attribute is the region, as `tetgen -A` writes it.
  void push_region(FileScanner& in, std::int64_t attributes) {
    if (attributes == 0) {
      regions_.push(0, 0, [](int tag) { return std::to_string(tag); });
      return;
    }
    const double region = in.real("a region attribute");
    if (region != std::round(region) || std::abs(region) > std::numeric_limits<int>::max())
      in.fail("seen " + std::to_string(region) + ", expected a whole number as region attribute");
    regions_.push(0, static_cast<int>(region), [](int tag) { return std::to_string(tag); });
    for (std::int64_t a = 1; a < attributes; ++a) in.real("an attribute");
  }

  static void refuse_more(FileScanner& in, const char* items) {
    if (in.at_end()) return;
    const auto seen = in.word("");
    in.fail("seen " + shown(seen) + ", expected the end: the head counts fewer " + items);
  }

  std::filesystem::path node_path_, ele_path_;
  std::string node_bytes_, ele_bytes_;
  MeshFile mesh_;
  RegionTable regions_;
  GroupCollector groups_;
  std::int64_t first_ = 0;
};

}  // namespace

MeshFile read_tetgen(const std::filesystem::path& path) { return TetgenReader(path).read(); }

}  // namespace limber::internal
