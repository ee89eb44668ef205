// Gmsh MSH 2.x and 4.1, ASCII and binary. The format is described in the Gmsh reference manual, "File formats".
#include <algorithm>
#include <array>
#include <cstdlib>
#include <set>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"

namespace limber::internal {
namespace {

struct ElementType {
  int type, dim, nodes;
  const char* name;
};

constexpr ElementType kElementTypes[] = {
    {15, 0, 1, "point"},
    {1, 1, 2, "line"},
    {8, 1, 3, "3-node line"},
    {26, 1, 4, "4-node line"},
    {27, 1, 5, "5-node line"},
    {28, 1, 6, "6-node line"},
    {2, 2, 3, "triangle"},
    {3, 2, 4, "quadrangle"},
    {9, 2, 6, "6-node triangle"},
    {10, 2, 9, "9-node quadrangle"},
    {16, 2, 8, "8-node quadrangle"},
    {20, 2, 9, "9-node triangle"},
    {21, 2, 10, "10-node triangle"},
    {22, 2, 12, "12-node triangle"},
    {23, 2, 15, "15-node triangle"},
    {24, 2, 15, "15-node triangle"},
    {25, 2, 21, "21-node triangle"},
    {4, 3, 4, "tetrahedron"},
    {5, 3, 8, "hexahedron"},
    {6, 3, 6, "prism"},
    {7, 3, 5, "pyramid"},
    {11, 3, 10, "10-node tetrahedron"},
    {29, 3, 20, "20-node tetrahedron"},
    {30, 3, 35, "35-node tetrahedron"},
    {31, 3, 56, "56-node tetrahedron"},
    {12, 3, 27, "27-node hexahedron"},
    {17, 3, 20, "20-node hexahedron"},
    {92, 3, 64, "64-node hexahedron"},
    {93, 3, 125, "125-node hexahedron"},
    {13, 3, 18, "18-node prism"},
    {18, 3, 15, "15-node prism"},
    {14, 3, 14, "14-node pyramid"},
    {19, 3, 13, "13-node pyramid"},
};

constexpr int kTriangle = 2, kQuadrangle = 3, kTetrahedron = 4, kTenNodeTetrahedron = 11;
constexpr int kPhysical = 0, kElementary = 1;  // kinds of region

class GmshReader {
 public:
  GmshReader(const FileBytes& file, Warnings& warnings)
      : in_(file.bytes, file.name, {}), warnings_(warnings), regions_(mesh_.tets) {}

  MeshFile read() {
    read_format();
    while (!in_.at_end()) read_section();
    if (!has_nodes_) in_.fail("the file ends, expected a section $Nodes");
    if (!has_elements_) in_.fail("the file ends, expected a section $Elements");
    drop_repeats();
    refuse_curved_surface();
    finish_groups();
    return std::move(mesh_);
  }

 private:
  // --- sections

  void read_format() {
    in_.expect("$MeshFormat");
    const auto version = in_.word("a version");
    if (version != "2" && version != "2.0" && version != "2.1" && version != "2.2" && version != "4.1")
      in_.fail("seen version " + shown(version) +
               ", expected 2.2 or 4.1; save again with gmsh, option -format msh41 or msh22");
    version4_ = version == "4.1";
    const bool binary = in_.integer(0, 1, "the file type") == 1;
    if (const auto size = in_.integer("the data size"); size != 8)
      in_.fail("seen data size " + std::to_string(size) + ", expected 8");
    if (binary) read_byte_order();
    in_.expect("$EndMeshFormat");
  }

  /// The integer 1, written in the file's own order.
  void read_byte_order() {
    in_.end_line("the data size");
    const auto one = in_.number<std::uint32_t>(Encoding::kLittleEndian, "the number 1");
    if (one == 1)
      encoding_ = Encoding::kLittleEndian;
    else if (one == 0x01000000u)
      encoding_ = Encoding::kBigEndian;
    else
      in_.fail("seen " + std::to_string(one) + ", expected the number 1 of a binary file's head");
  }

  void read_section() {
    const std::string section(in_.word("a section"));
    if (!section.starts_with('$')) in_.fail("seen " + shown(section) + ", expected a section such as $Nodes");
    if (section == "$PhysicalNames")
      read_physical_names();
    else if (section == "$Entities" && version4_)
      in_section(section, [&] { read_entities(false); });
    else if (section == "$PartitionedEntities" && version4_)
      in_section(section, [&] { read_entities(true); });
    else if (section == "$Nodes")
      in_section(section, [&] { version4_ ? read_nodes4() : read_nodes2(); });
    else if (section == "$Elements")
      in_section(section, [&] { version4_ ? read_elements4() : read_elements2(); });
    else if (!in_.skip_to_line("$End" + section.substr(1)))
      in_.fail("the section " + shown(section) + " has no end, expected $End" + section.substr(1));
    in_.expect("$End" + section.substr(1));
  }

  template <class F>
  void in_section(const std::string& section, F&& read) {
    if (encoding_ != Encoding::kText) in_.end_line(section.c_str());
    if (section == "$Nodes" && std::exchange(has_nodes_, true)) in_.fail("a second section $Nodes, expected one");
    if (section == "$Elements") {
      if (std::exchange(has_elements_, true)) in_.fail("a second section $Elements, expected one");
      if (!has_nodes_) in_.fail("seen $Elements, expected $Nodes before it");
    }
    read();
  }

  void read_physical_names() {
    const auto names = in_.count(5, "number of physical names");
    for (Index i = 0; i < names; ++i) {
      const auto dim = static_cast<int>(in_.integer(0, 3, "a dimension"));
      const auto tag = physical_tag(in_.integer("a physical tag"));
      in_.need_on_line("a name in quotes");
      std::string_view name = in_.rest_of_line();
      if (name.size() >= 2 && name.front() == '"' && name.back() == '"') name = name.substr(1, name.size() - 2);
      groups_.set_name(dim, tag, std::string(name));
    }
  }

  /// Version 4.1: which physical groups each elementary entity is in.
  void read_entities(bool partitioned) {
    if (partitioned) {
      size("number of partitions");
      const auto ghosts = count(8, "number of ghost entities");
      for (Index i = 0; i < ghosts; ++i) integer(), integer();
    }
    std::array<Index, 4> entities{};
    for (int dim = 0; dim < 4; ++dim) entities[dim] = count(0, "number of entities");
    for (int dim = 0; dim < 4; ++dim) {
      in_.checked_count(entities[dim], 5, "number of entities");
      for (Index i = 0; i < entities[dim]; ++i) read_entity(dim, partitioned);
    }
  }

  void read_entity(int dim, bool partitioned) {
    const int tag = integer();
    if (partitioned) {
      integer(), integer();  // the parent
      const auto partitions = count(1, "number of partitions");
      for (Index i = 0; i < partitions; ++i) integer();
    }
    for (int i = 0; i < (dim == 0 ? 3 : 6); ++i) skip_real();  // the place or the box
    auto& physical = physical_of_[{dim, tag}];
    const auto tags = count(1, "number of physical tags");
    for (Index i = 0; i < tags; ++i) physical.push_back(physical_tag(integer()));
    if (dim == 0) return;
    const auto boundary = count(1, "number of bounding entities");
    for (Index i = 0; i < boundary; ++i) integer();
  }

  void read_nodes2() {
    const auto nodes = text_count(8, "number of nodes");
    start_nodes(nodes);
    for (Index i = 0; i < nodes; ++i) {
      numbers_.push(integer());
      push_position();
    }
    end_nodes();
  }

  void read_nodes4() {
    const auto blocks = count(8, "number of node blocks");
    const auto nodes = count(4, "number of nodes");
    size("smallest node tag"), size("largest node tag");
    start_nodes(nodes);
    for (Index b = 0; b < blocks; ++b) {
      const int dim = integer();
      integer();  // the entity
      const int parameters = integer() != 0 ? dim : 0;
      const auto in_block = count(4, "number of nodes of a block");
      for (Index i = 0; i < in_block; ++i) numbers_.push(size("a node tag"));
      for (Index i = 0; i < in_block; ++i) {
        push_position();
        for (int p = 0; p < parameters; ++p) skip_real();
      }
    }
    if (mesh_.tets.nodes.size() != static_cast<std::size_t>(nodes))
      in_.fail("seen " + std::to_string(mesh_.tets.nodes.size()) + " nodes in the blocks, expected " +
               std::to_string(nodes) + " as the section's head says");
    end_nodes();
  }

  void read_elements2() {
    const auto elements = text_count(6, "number of elements");
    const bool binary = encoding_ != Encoding::kText;
    for (Index done = 0; done < elements;) {
      std::int64_t number = 0;
      if (!binary) number = in_.integer("an element number");
      const ElementType& type = element_type(integer());
      const Index run = binary ? run_length(elements - done) : 1;
      const int tags = integer();
      if (tags < 0 || tags > 1'000'000)
        in_.fail("seen " + std::to_string(tags) + " as the number of tags, expected 2 or more");
      for (Index i = 0; i < run; ++i, ++done) {
        if (binary) number = integer();
        int physical = 0, elementary = 0;
        for (int t = 0; t < tags; ++t) {
          const int tag = integer();
          if (t == 0) physical = physical_tag(tag);
          if (t == 1) elementary = tag;
        }
        const int groups[1] = {physical};
        push_element(type, number, std::span(groups, physical == 0 ? 0u : 1u), elementary);
      }
    }
  }

  /// Version 2 binary: elements of one type and tag count follow each other under one head.
  Index run_length(Index left) {
    const int run = integer();
    if (run < 1 || run > left)
      in_.fail("seen " + std::to_string(run) + " elements under one head, expected 1 to " + std::to_string(left));
    return run;
  }

  void read_elements4() {
    const auto blocks = count(8, "number of element blocks");
    const auto elements = count(4, "number of elements");
    size("smallest element tag"), size("largest element tag");
    std::int64_t seen = 0;
    for (Index b = 0; b < blocks; ++b) {
      const int dim = integer();
      const int entity = integer();
      const ElementType& type = element_type(integer());
      if (dim != type.dim)
        in_.fail("seen dimension " + std::to_string(dim) + " for elements of type " + type.name + ", expected " +
                 std::to_string(type.dim));
      const auto found = physical_of_.find({dim, entity});
      const auto groups = found == physical_of_.end() ? std::span<const int>() : std::span<const int>(found->second);
      const auto in_block = count(4, "number of elements of a block");
      for (Index i = 0; i < in_block; ++i) push_element(type, size("an element tag"), groups, entity);
      seen += in_block;
    }
    if (seen != elements)
      in_.fail("seen " + std::to_string(seen) + " elements in the blocks, expected " + std::to_string(elements) +
               " as the section's head says");
  }

  // --- elements

  const ElementType& element_type(int type) const {
    for (const ElementType& known : kElementTypes)
      if (known.type == type) return known;
    in_.fail("seen element type " + std::to_string(type) +
             ", expected one that Gmsh defines, such as 4 for a tetrahedron");
  }

  void push_element(const ElementType& type, std::int64_t number, std::span<const int> physical, int elementary) {
    const bool tet = type.type == kTetrahedron || type.type == kTenNodeTetrahedron;
    if (type.dim == 3 && !tet)
      in_.fail("element " + std::to_string(number) + " is a " + type.name +
               "; of solids only tetrahedra of 4 or 10 nodes are read: mesh with tetrahedra (gmsh -3 -order 1 or 2)");
    std::array<Index, 10> nodes{};
    for (int a = 0; a < type.nodes; ++a) {
      const auto node = node_index(number);
      for (const int tag : physical)
        if (type.dim < 3) groups_.nodes(type.dim, tag).push_back(node);
      if (a < 10) nodes[a] = node;
    }
    if (tet) push_solid(std::span(nodes).first(static_cast<std::size_t>(type.nodes)), number, physical, elementary);
    if (type.dim == 2) push_face(type, nodes, physical.empty() ? 0 : physical[0]);
  }

  void push_solid(std::span<const Index> tet, std::int64_t number, std::span<const int> physical, int elementary) {
    if (!push_tet(mesh_.tets, tet, kGmshMidEdges))
      in_.fail("element " + std::to_string(number) + " has " + std::to_string(tet.size()) +
               " nodes; tetrahedra of 4 and of 10 nodes in one file, expected one kind");
    if (physical.empty()) {
      regions_.push(kElementary, elementary, [&](int tag) { return "entity " + std::to_string(tag); });
      return;
    }
    regions_.push(kPhysical, physical[0], [&](int tag) { return groups_.name(3, tag); });
    if (physical.size() > 1) {
      ++in_several_;
      for (const int tag : physical.subspan(1)) push_all(groups_.nodes(3, tag), tet);
    }
  }

  void push_face(const ElementType& type, const std::array<Index, 10>& nodes, int physical) {
    const bool flat = type.type == kTriangle || type.type == kQuadrangle;
    if (!flat && curved_face_ == nullptr) curved_face_ = type.name;
    mesh_.polygons.push(std::span(nodes).first(flat ? static_cast<std::size_t>(type.nodes) : 3));
    face_groups_.insert(physical);
  }

  Index node_index(std::int64_t element) {
    const std::int64_t number = version4_ ? size("a node tag") : integer();
    const Index index = numbers_.find(number);
    if (index < 0)
      in_.fail("element " + std::to_string(element) + " names node " + std::to_string(number) +
               ", expected one that stands in $Nodes");
    return index;
  }

  template <class Nodes>
  static void push_all(std::vector<Index>& list, const Nodes& tet) {
    list.insert(list.end(), tet.begin(), tet.end());
  }

  // --- after the last section

  /// Version 2 writes an element once for each physical group it is in. Kept twice it would weigh twice.
  void drop_repeats() {
    if (version4_) return;
    if (mesh_.tets.regions.size() > 1) drop_repeated_tets();
    if (mesh_.tets.tets.empty() && face_groups_.size() > 1) drop_repeated_faces();
  }

  void drop_repeated_tets() {
    TetMesh& mesh = mesh_.tets;
    const auto first = first_of_same(mesh.tets.size(), [&](std::size_t i) { return mesh.tets[i]; });
    std::size_t kept = 0;
    for (std::size_t i = 0; i < first.size(); ++i) {
      if (first[i] != i) {
        ++in_several_;
        push_all(groups_.nodes(3, mesh.regions[mesh.tet_region[i]].tag), TetNodes(mesh, i));
        continue;
      }
      mesh.tets[kept] = mesh.tets[i];
      if (mesh.has_mid_edge_nodes()) mesh.mid_edge_nodes[kept] = mesh.mid_edge_nodes[i];
      mesh.tet_region[kept++] = mesh.tet_region[i];
    }
    mesh.tets.resize(kept);
    if (mesh.has_mid_edge_nodes()) mesh.mid_edge_nodes.resize(kept);
    mesh.tet_region.resize(kept);
    drop_unused_regions();
  }

  void drop_repeated_faces() {
    const Polygons all = std::exchange(mesh_.polygons, {});
    const auto first = first_of_same(all.size(), [&](std::size_t i) {
      std::array<Index, 4> corners{-1, -1, -1, -1};
      std::copy(all[i].begin(), all[i].end(), corners.begin());
      return corners;
    });
    for (std::size_t i = 0; i < first.size(); ++i)
      if (first[i] == i) mesh_.polygons.push(all[i]);
  }

  /// Per element the first one with the same nodes in any order.
  template <class F>
  static std::vector<std::size_t> first_of_same(std::size_t count, F&& corners) {
    std::vector<std::pair<std::array<Index, 4>, std::size_t>> sorted;
    sorted.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      std::array<Index, 4> key = corners(i);
      std::sort(key.begin(), key.end());
      sorted.emplace_back(key, i);
    }
    std::sort(sorted.begin(), sorted.end());
    std::vector<std::size_t> first(count);
    for (std::size_t i = 0; i < count; ++i) {
      const bool same = i > 0 && sorted[i].first == sorted[i - 1].first;
      first[sorted[i].second] = same ? first[sorted[i - 1].second] : sorted[i].second;
    }
    return first;
  }

  /// A region whose every tet stood first in another one is a node group only.
  void drop_unused_regions() {
    TetMesh& mesh = mesh_.tets;
    std::vector<Index> new_index(mesh.regions.size(), -1);
    for (const Index r : mesh.tet_region) new_index[r] = 0;
    std::vector<Region> used;
    for (std::size_t r = 0; r < new_index.size(); ++r) {
      if (new_index[r] < 0) continue;
      new_index[r] = static_cast<Index>(used.size());
      used.push_back(mesh.regions[r]);
    }
    mesh.regions = std::move(used);
    for (Index& r : mesh.tet_region) r = new_index[r];
  }

  void refuse_curved_surface() const {
    if (mesh_.tets.tets.empty() && curved_face_ != nullptr)
      in_.fail(std::string("the surface has an element of type ") + curved_face_ +
               "; expected 3-node triangles and 4-node quadrangles: mesh with gmsh -2 -order 1");
  }

  void finish_groups() {
    if (in_several_ > 0)
      warnings_.push_back(
          in_.name() + ": " + std::to_string(in_several_) +
          " tetrahedra are in several physical groups; the first one listed is their region, the others "
          "are node groups only");
    // An elementary tag is told as plain text where no physical group has taken that text.
    for (Region& region : mesh_.tets.regions) {
      const auto plain = std::to_string(region.tag);
      if (region.name == "entity " + plain && std::none_of(mesh_.tets.regions.begin(), mesh_.tets.regions.end(),
                                                           [&](const Region& r) { return r.name == plain; }))
        region.name = plain;
    }
    if (groups_.finish(mesh_.tets))
      warnings_.push_back(in_.name() +
                          ": physical groups of several dimensions share a name; it stands for the surface group, else "
                          "the curve, the points, the volume: give each group a name of its own");
  }

  // --- numbers

  int integer() { return in_.number<std::int32_t>(encoding_, "an integer"); }
  std::int64_t size(const char* expected) {
    const auto value = in_.number<std::uint64_t>(encoding_, expected);
    if (value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
      in_.fail("seen " + std::to_string(value) + ", expected " + expected);
    return static_cast<std::int64_t>(value);
  }
  Index count(std::size_t least_bytes, const char* items) {
    const auto value = size(items);
    return in_.checked_count(value, std::max<std::size_t>(least_bytes, 1), items);
  }
  /// Version 2 writes its two counts as text even in binary files.
  Index text_count(std::size_t least_bytes, const char* items) {
    const auto value = in_.count(least_bytes, items);
    if (encoding_ != Encoding::kText) in_.end_line(items);
    return value;
  }
  /// A negative tag turns the entity's orientation, nothing else.
  int physical_tag(std::int64_t tag) const {
    if (std::abs(tag) > std::numeric_limits<int>::max())
      in_.fail("seen " + std::to_string(tag) + ", expected a physical tag");
    return static_cast<int>(std::abs(tag));
  }
  void skip_real() { in_.number<double>(encoding_, "a number"); }
  void push_position() {
    const double x = in_.number<double>(encoding_, "a coordinate"), y = in_.number<double>(encoding_, "a coordinate"),
                 z = in_.number<double>(encoding_, "a coordinate");
    mesh_.tets.nodes.emplace_back(x, y, z);
  }
  void start_nodes(Index count) {
    mesh_.tets.nodes.reserve(static_cast<std::size_t>(count));
    numbers_.reserve(static_cast<std::size_t>(count));
  }
  void end_nodes() {
    if (const auto twice = numbers_.finish())
      in_.fail("node " + std::to_string(*twice) + " stands twice in $Nodes, expected once");
  }

  FileScanner in_;
  Warnings& warnings_;
  MeshFile mesh_;
  RegionTable regions_;
  GroupCollector groups_;
  NodeNumbers numbers_;
  Encoding encoding_ = Encoding::kText;
  bool version4_ = false, has_nodes_ = false, has_elements_ = false;
  std::map<std::pair<int, int>, std::vector<int>> physical_of_;  // of an entity (dimension, tag)
  std::set<int> face_groups_;
  const char* curved_face_ = nullptr;
  std::size_t in_several_ = 0;
};

}  // namespace

MeshFile read_gmsh(const FileBytes& file, Warnings& warnings) { return GmshReader(file, warnings).read(); }

}  // namespace limber::internal
