// Wavefront OBJ: positions, faces, and the names of objects, groups and materials; normals, texture coordinates and
// curves are passed over.
#include <charconv>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"

namespace limber::internal {
namespace {

/// Statements that carry no vertex and no face.
constexpr std::string_view kPassedOver[] = {
    "vn",   "vt",         "vp",        "s",     "mg",    "mtllib", "usemap", "maplib",   "l",
    "p",    "cstype",     "deg",       "bmat",  "step",  "curv",   "curv2",  "surf",     "parm",
    "trim", "hole",       "scrv",      "sp",    "end",   "con",    "bevel",  "c_interp", "d_interp",
    "lod",  "shadow_obj", "trace_obj", "ctech", "stech", "call",   "csh"};

class ObjReader {
 public:
  explicit ObjReader(const FileBytes& file) : in_(file.bytes, file.name, {.comment = '#', .continuation = '\\'}) {}

  MeshFile read() {
    while (!in_.at_end()) read_statement();
    if (highest_ >= vertex_count())
      in_.fail_at(highest_at_, "a face names vertex " + std::to_string(highest_ + 1) + ", expected 1 to " +
                                   std::to_string(vertex_count()));
    return std::move(mesh_);
  }

 private:
  std::int64_t vertex_count() const { return static_cast<std::int64_t>(mesh_.tets.nodes.size()); }

  void read_statement() {
    const auto keyword = in_.word("a statement");
    if (keyword == "v") return read_vertex();
    if (keyword == "f" || keyword == "fo") return read_face();
    if (keyword == "o" || keyword == "g") return begin_group(&PolygonGroup::name);
    if (keyword == "usemtl") return begin_group(&PolygonGroup::material);
    for (const auto known : kPassedOver)
      if (keyword == known) return pass_over();
    in_.fail("seen " + shown(keyword) + ", expected a statement of OBJ such as v or f");
  }

  void begin_group(std::string PolygonGroup::*which) {
    PolygonGroup group = mesh_.groups.empty() ? PolygonGroup{} : mesh_.groups.back();
    group.first = mesh_.polygons.size();
    std::string name;
    while (in_.more_on_line()) {
      if (!name.empty()) name += ' ';
      name += in_.word("a name");
    }
    group.*which = std::move(name);
    mesh_.groups.push_back(std::move(group));
  }

  void read_vertex() {
    Vec3 x;
    for (double& c : x) {
      in_.need_on_line("three coordinates");
      c = in_.real("a coordinate");
    }
    mesh_.tets.nodes.push_back(x);
    pass_over();  // a weight or a colour
  }

  void read_face() {
    const auto begin = mesh_.polygons.corners.size();
    while (in_.more_on_line()) mesh_.polygons.corners.push_back(corner());
    if (mesh_.polygons.corners.size() - begin < 3) {
      in_.fail("a face of " + std::to_string(mesh_.polygons.corners.size() - begin) + " corners, expected 3 or more");
    }
    mesh_.polygons.close();
  }

  /// "7", "7/1", "7//3" or "7/1/3"; −1 is the vertex last defined.
  Index corner() {
    const auto word = in_.word("a vertex");
    std::int64_t number = 0;
    const auto [p, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    const auto rest = word.substr(static_cast<std::size_t>(p - word.data()));
    if (error != std::errc() || !(rest.empty() || rest[0] == '/') ||
        rest.find_first_not_of("/-0123456789") != rest.npos)
      in_.fail("seen " + shown(word) + ", expected a corner such as 7, 7/1, 7//3 or 7/1/3");
    const auto index = number < 0 ? vertex_count() + number : number - 1;
    if (index < 0 || index > std::numeric_limits<Index>::max())
      in_.fail("a face names vertex " + std::to_string(number) + ", expected 1 to " + std::to_string(vertex_count()) +
               " (or -1 to -" + std::to_string(vertex_count()) + ")");
    if (index > highest_) {  // it may still be defined further down
      highest_ = index;
      highest_at_ = in_.last_word();
    }
    return static_cast<Index>(index);
  }

  void pass_over() {
    while (in_.more_on_line()) in_.word("");
  }

  FileScanner in_;
  MeshFile mesh_;
  std::int64_t highest_ = -1;
  std::size_t highest_at_ = 0;
};

}  // namespace

MeshFile read_obj(const FileBytes& file) { return ObjReader(file).read(); }

}  // namespace limber::internal
