// Geomview's OFF, text and binary: vertices and polygons; normals, colours and texture coordinates are passed over.
#include "formats/file_scanner.h"
#include "formats/mesh_file.h"

namespace limber::internal {
namespace {

class OffReader {
 public:
  explicit OffReader(const FileBytes& file) : in_(file.bytes, file.name, {.comment = '#'}) {}

  MeshFile read() {
    read_head();
    const Index vertices = count(binary() ? 12 : 5, "number of vertices");
    const Index faces = count(binary() ? 8 : 2, "number of faces");
    pass_number_of_edges();
    mesh_.tets.nodes.reserve(static_cast<std::size_t>(vertices));
    for (Index i = 0; i < vertices; ++i) read_vertex();
    for (Index i = 0; i < faces; ++i) read_face(vertices);
    return std::move(mesh_);
  }

 private:
  bool binary() const { return encoding_ != Encoding::kText; }

  /// [ST][C][N][4][n]OFF [BINARY]; the word may be missing.
  void read_head() {
    auto kind = in_.peek_word();
    if (!kind.ends_with("OFF")) return;
    in_.word("OFF");
    const auto take = [&](std::string_view letters) {
      const bool there = kind.starts_with(letters);
      if (there) kind.remove_prefix(letters.size());
      return there;
    };
    const bool texture = take("ST"), colours = take("C"), normals = take("N");
    homogeneous_ = take("4");
    const bool any_dimension = take("n");
    if (kind != "OFF") in_.fail("seen " + shown(kind) + ", expected OFF, or [ST][C][N][4][n]OFF");
    passed_over_ = (normals ? 12U : 0U) + (colours ? 16U : 0U) + (texture ? 8U : 0U);
    if (in_.more_on_line() && in_.peek_word() == "BINARY") {
      in_.word("BINARY");
      in_.end_line("BINARY");
      encoding_ = Encoding::kBigEndian;
    }
    if (any_dimension)
      if (const auto n = in_.number<std::int32_t>(encoding_, "the number of dimensions"); n != 3)
        in_.fail("the vertices have " + std::to_string(n) + " dimensions, expected 3");
  }

  Index count(std::size_t least_bytes, const char* items) {
    return in_.checked_count(in_.number<std::int32_t>(encoding_, items), least_bytes, items);
  }

  /// In text the number of edges may be missing, and nobody needs it.
  void pass_number_of_edges() {
    if (binary())
      in_.number<std::int32_t>(encoding_, "number of edges");
    else
      in_.rest_of_line();
  }

  double coordinate() {
    return binary() ? static_cast<double>(in_.number<float>(encoding_, "a coordinate")) : in_.real("a coordinate");
  }

  void read_vertex() {
    Vec3 x;
    for (double& c : x) c = coordinate();
    if (homogeneous_) {
      const double w = coordinate();
      if (w == 0.0) in_.fail("a vertex lies at infinity: its fourth coordinate is 0");
      x /= w;
    }
    mesh_.tets.nodes.push_back(x);
    if (binary())
      in_.skip_bytes(passed_over_, "a vertex");
    else
      in_.rest_of_line();
  }

  void read_face(Index vertices) {
    const Index corners = in_.checked_count(in_.number<std::int32_t>(encoding_, "a face's number of corners"),
                                            binary() ? 4 : 1, "corners");
    for (Index c = 0; c < corners; ++c) {
      const auto vertex = in_.number<std::int32_t>(encoding_, "a vertex of a face");
      if (vertex < 0 || vertex >= vertices)
        in_.fail("a face names vertex " + std::to_string(vertex) + ", expected 0 to " + std::to_string(vertices - 1));
      mesh_.polygons.corners.push_back(vertex);
    }
    mesh_.polygons.close();
    if (!binary()) {
      in_.rest_of_line();
      return;
    }
    const auto colours = in_.number<std::int32_t>(encoding_, "a face's number of colour components");
    in_.skip_bytes(4 * static_cast<std::uint64_t>(in_.checked_count(colours, 4, "colour components")), "a colour");
  }

  FileScanner in_;
  MeshFile mesh_;
  Encoding encoding_ = Encoding::kText;
  bool homogeneous_ = false;
  std::uint64_t passed_over_ = 0;  ///< bytes of a binary vertex behind its coordinates
};

}  // namespace

MeshFile read_off(const FileBytes& file) { return OffReader(file).read(); }

}  // namespace limber::internal
