#include "limber/mesh/read_mesh.h"

#include <algorithm>
#include <fstream>

#include "formats/file_scanner.h"
#include "formats/mesh_file.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/mesh/grouped_surface.h"
#include "limber/mesh/unused_vertices.h"

namespace limber {
namespace {

using internal::FileBytes;
using internal::MeshFile;
using internal::PolygonGroup;
using internal::Polygons;
using internal::shown_path;

enum class Format { kGmsh, kMedit, kVtk, kTetgen, kPly, kObj, kOff, kStl, kGltf };

constexpr const char* kKnownFormats =
    "Gmsh .msh, MEDIT .mesh, TetGen .node/.ele, VTK legacy .vtk, OBJ .obj, OFF .off, STL .stl, PLY .ply or glTF "
    ".gltf/.glb";

std::optional<Format> format_of_content(std::string_view head) {
  if (head.starts_with("glTF")) return Format::kGltf;
  if (head.starts_with("\xef\xbb\xbf")) head.remove_prefix(3);
  const auto text = head.substr(std::min(head.find_first_not_of(" \t\r\n"), head.size()));
  if (text.starts_with("$MeshFormat")) return Format::kGmsh;
  if (text.starts_with("MeshVersionFormatted")) return Format::kMedit;
  if (text.starts_with("# vtk DataFile")) return Format::kVtk;
  if (text.starts_with("ply\n") || text.starts_with("ply\r")) return Format::kPly;
  return std::nullopt;
}

std::optional<Format> format_of_extension(const std::filesystem::path& path) {
  const std::string extension = internal::lower_case(path.extension().string());
  constexpr std::pair<const char*, Format> kExtensions[] = {
      {".msh", Format::kGmsh},    {".mesh", Format::kMedit}, {".meshb", Format::kMedit}, {".vtk", Format::kVtk},
      {".node", Format::kTetgen}, {".ele", Format::kTetgen}, {".ply", Format::kPly},     {".obj", Format::kObj},
      {".off", Format::kOff},     {".stl", Format::kStl},    {".gltf", Format::kGltf},   {".glb", Format::kGltf}};
  for (const auto& [known, format] : kExtensions)
    if (extension == known) return format;
  return std::nullopt;
}

/// The format of a file whose first bytes, at least, are given.
std::optional<Format> format_of(const std::filesystem::path& path, std::string_view head) {
  const auto told = format_of_content(head);
  return told ? told : format_of_extension(path);
}

MeshFile read_as(Format format, const std::filesystem::path& path, const FileBytes& file, Warnings& warnings) {
  switch (format) {
    case Format::kGmsh:
      return internal::read_gmsh(file, warnings);
    case Format::kMedit:
      return internal::read_medit(file, warnings);
    case Format::kVtk:
      return internal::read_vtk(file, warnings);
    case Format::kTetgen:
      return internal::read_tetgen(path);
    case Format::kPly:
      return internal::read_ply(file);
    case Format::kObj:
      return internal::read_obj(file);
    case Format::kOff:
      return internal::read_off(file);
    case Format::kStl:
      return internal::read_stl(file);
    case Format::kGltf:
      return internal::read_gltf(path, file, warnings);
  }
  throw InputError(file.name + ": unknown format");
}

struct ReadFile {
  Format format;
  MeshFile content;
};

ReadFile read_any(const std::filesystem::path& path, Warnings& warnings) {
  const std::string bytes = read_file(path);
  const auto format = format_of(path, bytes);
  if (!format) throw InputError(shown_path(path) + ": the format is not known, expected " + kKnownFormats);
  return {*format, read_as(*format, path, {shown_path(path), bytes}, warnings)};
}

bool has_tets(const ReadFile& file) { return file.format == Format::kTetgen || !file.content.tets.tets.empty(); }

std::vector<Triangle> triangles_of(const MeshFile& content, const std::string& name, Warnings& warnings) {
  internal::Triangulation cut = internal::triangulated(content.polygons, content.tets.nodes);
  if (cut.crossing_polygons > 0)
    warnings.push_back(name + ": " + std::to_string(cut.crossing_polygons) +
                       " polygons cross themselves; no triangles of them are right");
  return std::move(cut.triangles);
}

SurfaceMesh surface_of(ReadFile file, const std::string& name, Warnings& warnings) {
  SurfaceMesh surface;
  surface.triangles = triangles_of(file.content, name, warnings);
  surface.vertices = std::move(file.content.tets.nodes);
  if (file.format == Format::kStl || file.format == Format::kGltf) weld(surface);
  validate(surface, name, warnings);
  drop_unused_vertices(surface, name, warnings);
  return surface;
}

/// Per triangle of triangulated(), its polygon: one of n corners gives n − 2.
std::vector<Index> polygon_of_triangles(const Polygons& polygons) {
  std::vector<Index> of;
  for (std::size_t i = 0; i < polygons.size(); ++i)
    for (std::size_t c = 2; c < polygons[i].size(); ++c) of.push_back(static_cast<Index>(i));
  return of;
}

/// Groups of polygons as groups of the triangles that are cut from them.
std::vector<SurfaceGroup> groups_of_triangles(const std::vector<PolygonGroup>& groups,
                                              const std::vector<Index>& face_of) {
  std::vector<SurfaceGroup> out;
  const auto push = [&](const std::string& name, const std::string& material, std::size_t begin, std::size_t end) {
    const auto first = std::lower_bound(face_of.begin(), face_of.end(), static_cast<Index>(begin)) - face_of.begin();
    const auto last = std::lower_bound(face_of.begin(), face_of.end(), static_cast<Index>(end)) - face_of.begin();
    if (last > first) out.push_back({name, material, static_cast<Index>(first), static_cast<Index>(last - first)});
  };
  const std::size_t polygons = face_of.empty() ? 0 : static_cast<std::size_t>(face_of.back()) + 1;
  push("", "", 0, groups.empty() ? polygons : groups.front().first);
  for (std::size_t g = 0; g < groups.size(); ++g)
    push(groups[g].name, groups[g].material, groups[g].first, g + 1 < groups.size() ? groups[g + 1].first : polygons);
  return out;
}

TetMesh tets_of(ReadFile file, const std::string& name, Warnings& warnings) {
  validate(file.content.tets, name, warnings);
  return std::move(file.content.tets);
}

}  // namespace

bool is_known_mesh_format(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  char head[256];
  file.read(head, sizeof head);
  // A missing file, a directory and the like are told by read_file() in one voice.
  if (file.gcount() == 0) read_file(path);
  const auto format = format_of(path, std::string_view(head, static_cast<std::size_t>(file.gcount())));
  return format && !(format == Format::kGltf && internal::is_gltf_1(read_file(path)));
}

std::variant<TetMesh, SurfaceMesh> read_mesh(const std::filesystem::path& path, Warnings& warnings) {
  auto file = read_any(path, warnings);
  if (has_tets(file)) return tets_of(std::move(file), shown_path(path), warnings);
  return surface_of(std::move(file), shown_path(path), warnings);
}

SurfaceMesh read_surface_mesh(const std::filesystem::path& path, Warnings& warnings) {
  auto file = read_any(path, warnings);
  if (has_tets(file)) throw InputError(shown_path(path) + ": holds tetrahedra, expected a surface");
  return surface_of(std::move(file), shown_path(path), warnings);
}

GroupedSurface read_grouped_surface(const std::filesystem::path& path, Warnings& warnings) {
  auto file = read_any(path, warnings);
  if (has_tets(file)) throw InputError(shown_path(path) + ": holds tetrahedra, expected a surface");
  GroupedSurface out;
  out.surface.triangles = triangles_of(file.content, shown_path(path), warnings);
  out.surface.vertices = std::move(file.content.tets.nodes);
  out.face_of = polygon_of_triangles(file.content.polygons);
  out.groups = groups_of_triangles(file.content.groups, out.face_of);
  validate(out, shown_path(path), warnings);
  drop_unused_vertices(out.surface, shown_path(path), warnings);
  return out;
}

}  // namespace limber
