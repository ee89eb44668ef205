// STL, text and binary. A soup of triangles: the caller welds it.
#include <algorithm>
#include <cstdint>
#include <limits>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"

namespace limber::internal {
namespace {

constexpr std::size_t kHead = 84, kFacet = 50;  // bytes of a binary file

/// Programs that write facets as they come leave their count at 0 or at its largest.
bool is_left_open(std::uint64_t facets) { return facets == 0 || facets == std::numeric_limits<std::uint32_t>::max(); }

/// "solid" does not tell: many binary files begin with it too. A length that fits the count does; no text has a count
/// that fits, since four printable characters count half a thousand million facets or more.
bool is_binary(const FileBytes& file) {
  FileScanner in(file.bytes, file.name, {});
  if (file.bytes.size() >= kHead) {
    in.skip_bytes(80, "the head");
    const std::uint64_t facets = in.number<std::uint32_t>(Encoding::kLittleEndian, "a count");
    if (file.bytes.size() == kHead + kFacet * facets) return true;
  }
  const auto text = file.bytes.substr(0, 1024);
  const auto word = FileScanner(file.bytes, file.name, {}).peek_word();
  return lower_case(word.substr(0, 5)) != "solid" || text.find('\0') != text.npos;
}

void push_facet(MeshFile& mesh) {
  const auto n = static_cast<Index>(mesh.tets.nodes.size());
  mesh.polygons.push(std::array{n - 3, n - 2, n - 1});
}

MeshFile read_binary(const FileBytes& file) {
  FileScanner in(file.bytes, file.name, {});
  in.skip_bytes(80, "the 80 bytes of a binary STL file's head");
  auto facets = in.number<std::uint32_t>(Encoding::kLittleEndian, "the number of facets");
  if (is_left_open(facets) && in.remaining() % kFacet == 0)
    facets = static_cast<std::uint32_t>(in.remaining() / kFacet);
  in.checked_count(facets, kFacet, "number of facets");
  MeshFile mesh;
  mesh.tets.nodes.reserve(3 * std::size_t{facets});
  for (std::uint32_t i = 0; i < facets; ++i) {
    in.skip_bytes(12, "a normal");
    for (int corner = 0; corner < 3; ++corner) {
      const auto next = [&] { return static_cast<double>(in.number<float>(Encoding::kLittleEndian, "a coordinate")); };
      const double x = next(), y = next(), z = next();
      mesh.tets.nodes.emplace_back(x, y, z);
    }
    in.skip_bytes(2, "an attribute");
    push_facet(mesh);
  }
  return mesh;
}

class StlText {
 public:
  explicit StlText(const FileBytes& file) : in_(file.bytes, file.name, {}) {}

  MeshFile read() {
    while (!in_.at_end()) read_solid();
    return std::move(mesh_);
  }

 private:
  void read_solid() {
    keyword("solid");
    in_.rest_of_line();  // its name, anything
    while (!next_is("endsolid")) read_facet();
    keyword("endsolid");
    in_.rest_of_line();
  }

  void read_facet() {
    keyword("facet");
    if (next_is("normal")) keyword("normal");
    for (int i = 0; i < 3; ++i) in_.word("a normal");  // may well be NaN; the corners' order tells the outside
    keyword("outer");
    keyword("loop");
    for (int corner = 0; corner < 3; ++corner) {
      keyword("vertex");
      const double x = in_.real("a coordinate"), y = in_.real("a coordinate"), z = in_.real("a coordinate");
      mesh_.tets.nodes.emplace_back(x, y, z);
    }
    keyword("endloop");
    keyword("endfacet");
    push_facet(mesh_);
  }

  bool next_is(std::string_view lower) { return lower_case(in_.peek_word()) == lower; }
  void keyword(const char* lower) {
    const auto seen = in_.word(lower);
    if (lower_case(seen) != lower) in_.fail("seen " + shown(seen) + ", expected " + lower);
  }

  FileScanner in_;
  MeshFile mesh_;
};

}  // namespace

MeshFile read_stl(const FileBytes& file) { return is_binary(file) ? read_binary(file) : StlText(file).read(); }

}  // namespace limber::internal
