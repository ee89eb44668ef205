// MEDIT .mesh in text form, as libMeshb's manual describes it.
#include <array>
#include <cctype>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"

namespace limber::internal {
namespace {

class MeditReader {
 public:
  MeditReader(const FileBytes& file, Warnings& warnings)
      : in_(file.bytes, file.name, {.comment = '#'}), warnings_(warnings), regions_(mesh_.tets) {
    refuse_binary(file);
  }

  MeshFile read() {
    read_head();
    bool ended = false;
    while (!ended && !in_.at_end()) ended = read_section();
    if (!has_vertices_) in_.fail("the file ends, expected a section Vertices");
    if (mesh_.tets.tets.empty() && curved_faces_)
      in_.fail("the surface is of 6-node triangles, expected 3-node ones: mesh with first-order elements");
    if (!ended) warnings_.push_back(in_.name() + ": the file ends without the keyword End; it may have been cut short");
    groups_.finish(mesh_.tets);
    return std::move(mesh_);
  }

 private:
  void refuse_binary(const FileBytes& file) const {
    if (file.bytes.size() < 4) return;
    const auto head = file.bytes.substr(0, 4);
    if (head == std::string_view("\1\0\0\0", 4) || head == std::string_view("\0\0\0\1", 4))
      in_.fail(
          "binary MEDIT (.meshb) is not read, expected text (.mesh); save again as .mesh, with libMeshb's "
          "transmesh or with gmsh");
  }

  void read_head() {
    in_.expect("MeshVersionFormatted");
    in_.integer(1, 4, "a version");
    in_.expect("Dimension");
    if (const auto dimension = in_.integer("a dimension"); dimension != 3)
      in_.fail("seen dimension " + std::to_string(dimension) + ", expected 3");
  }

  /// @return true behind the keyword End
  bool read_section() {
    const auto keyword = in_.word("a keyword");
    if (!std::isalpha(static_cast<unsigned char>(keyword[0])))
      in_.fail("seen " + shown(keyword) + ", expected a keyword such as Tetrahedra");
    if (keyword == "End") return true;
    if (keyword == "Vertices")
      read_vertices();
    else if (keyword == "Edges")
      read_elements<2, 1>("number of edges");
    else if (keyword == "Triangles")
      read_elements<3, 2>("number of triangles");
    else if (keyword == "Quadrilaterals")
      read_elements<4, 2>("number of quadrilaterals");
    else if (keyword == "Tetrahedra")
      read_tetrahedra<4>();
    else if (keyword == "TetrahedraP2")
      read_tetrahedra<10>();
    else if (keyword == "EdgesP2")
      read_elements<3, 1>("number of edges");
    else if (keyword == "TrianglesP2")
      read_elements<6, 2>("number of triangles");
    else if (is_other_solid(keyword))
      refuse_solids(std::string(keyword));
    else
      skip_numbers();
    return false;
  }

  static bool is_other_solid(std::string_view keyword) {
    for (const char* name : {"Hexahedra", "Hexaedra", "Prisms", "Pentahedra", "Pentaedra", "Pyramids", "TetrahedraP"})
      if (keyword.starts_with(name) && !keyword.ends_with("Ordering")) return true;
    return false;
  }

  void refuse_solids(const std::string& keyword) {
    if (in_.integer("a count") == 0) return;
    in_.fail("seen " + shown(keyword) +
             "; of solids only tetrahedra of 4 or 10 nodes are read: mesh with first-order tetrahedra");
  }

  /// The numbers of a section that means nothing here, such as Ridges.
  void skip_numbers() {
    for (auto next = in_.peek_word(); !next.empty() && !std::isalpha(static_cast<unsigned char>(next[0]));
         next = in_.peek_word())
      in_.word("a number");
  }

  void read_vertices() {
    if (std::exchange(has_vertices_, true)) in_.fail("a second section Vertices, expected one");
    const auto count = in_.count(8, "number of vertices");
    mesh_.tets.nodes.reserve(static_cast<std::size_t>(count));
    for (Index i = 0; i < count; ++i) {
      const double x = in_.real("a coordinate"), y = in_.real("a coordinate"), z = in_.real("a coordinate");
      mesh_.tets.nodes.emplace_back(x, y, z);
      if (const int tag = reference(); tag != 0) groups_.nodes(0, tag).push_back(i);
    }
  }

  template <int n>
  std::array<Index, n> corners() {
    std::array<Index, n> c{};
    const auto last = static_cast<std::int64_t>(mesh_.tets.nodes.size());
    for (Index& i : c) i = static_cast<Index>(in_.integer(1, last, "a vertex") - 1);
    return c;
  }

  /// Curves and faces: of curved ones the first three corners make the polygon.
  template <int n, int dim>
  void read_elements(const char* items) {
    const auto count = counted_elements(n, items);
    curved_faces_ = curved_faces_ || (n == 6 && count > 0);
    for (Index i = 0; i < count; ++i) {
      const auto c = corners<n>();
      if constexpr (dim == 2) mesh_.polygons.push(std::span(c).first(n == 6 ? 3 : n));
      if (const int tag = reference(); tag != 0) {
        auto& group = groups_.nodes(dim, tag);
        group.insert(group.end(), c.begin(), c.end());
      }
    }
  }

  template <int n>
  void read_tetrahedra() {
    const auto count = counted_elements(n, "number of tetrahedra");
    mesh_.tets.tets.reserve(mesh_.tets.tets.size() + static_cast<std::size_t>(count));
    for (Index i = 0; i < count; ++i) {
      if (!push_tet(mesh_.tets, corners<n>(), kMeditMidEdges))
        in_.fail("tetrahedra of 4 and of 10 nodes in one file, expected one kind");
      regions_.push(0, reference(), [](int tag) { return std::to_string(tag); });
    }
  }

  Index counted_elements(std::size_t corner_count, const char* items) {
    if (!has_vertices_) in_.fail("elements stand before the vertices, expected the section Vertices first");
    return in_.count(2 * (corner_count + 1) - 1, items);
  }

  int reference() {
    return static_cast<int>(
        in_.integer(std::numeric_limits<int>::min(), std::numeric_limits<int>::max(), "a reference"));
  }

  FileScanner in_;
  Warnings& warnings_;
  MeshFile mesh_;
  RegionTable regions_;
  GroupCollector groups_;
  bool has_vertices_ = false, curved_faces_ = false;
};

}  // namespace

MeshFile read_medit(const FileBytes& file, Warnings& warnings) { return MeditReader(file, warnings).read(); }

}  // namespace limber::internal
