#include "limber/mesh_assimp/read_surface_mesh.h"

#include <assimp/postprocess.h>

#include <cctype>
#include <limits>
#include <numeric>
#include <unordered_map>

#include "assimp_scene.h"
#include "file_unit.h"
#include "in_child.h"
#include "limber/core/error.h"
#include "limber/mesh/unused_vertices.h"

namespace limber {
namespace {

using internal::quoted_path;
using internal::read_scene;

/// A file as Assimp gives it: neither welded nor validated.
struct RawSurface {
  GroupedSurface grouped;              ///< a group per mesh of a node
  std::vector<std::size_t> node_ends;  ///< per node, one past its last triangle
  FileUnit unit;                       ///< applied
};

/// Collects the meshes of a scene as its nodes show them.
class Collector {
 public:
  Collector(const aiScene& scene, std::string name) : scene_(scene), name_(std::move(name)) {}

  void add(const aiNode& node, const aiMatrix4x4t<double>& parent) {
    const aiMatrix4x4t<double> pose = parent * aiMatrix4x4t<double>(node.mTransformation);
    for (unsigned i = 0; i < node.mNumMeshes; ++i) add(*scene_.mMeshes[node.mMeshes[i]], pose, node.mName.C_Str());
    read.node_ends.push_back(read.grouped.surface.triangles.size());
    for (unsigned i = 0; i < node.mNumChildren; ++i) add(*node.mChildren[i], pose);
  }

  RawSurface read;
  std::size_t points_and_lines = 0;

 private:
  void add(const aiMesh& mesh, const aiMatrix4x4t<double>& pose, const char* node) {
    SurfaceMesh& surface = read.grouped.surface;
    const auto first = surface.vertices.size();
    read.grouped.groups.push_back({node, material_of(mesh), static_cast<Index>(surface.triangles.size()), 0});
    if (first + mesh.mNumVertices > static_cast<std::size_t>(std::numeric_limits<Index>::max()))
      throw InputError(name_ + ": holds more than 2147483647 vertices");
    for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
      const aiVector3t<double> p =
          pose * aiVector3t<double>(mesh.mVertices[i].x, mesh.mVertices[i].y, mesh.mVertices[i].z);
      surface.vertices.emplace_back(p.x, p.y, p.z);
    }
    const bool mirrored = pose.Determinant() < 0.0;
    for (unsigned i = 0; i < mesh.mNumFaces; ++i) {
      const aiFace& face = mesh.mFaces[i];
      if (face.mNumIndices != 3) {
        ++points_and_lines;
        continue;
      }
      Triangle t{};
      for (int a = 0; a < 3; ++a) {
        if (face.mIndices[a] >= mesh.mNumVertices)
          throw InputError(name_ + ": a face names vertex " + std::to_string(face.mIndices[a]) + " of " +
                           std::to_string(mesh.mNumVertices));
        t[a] = static_cast<Index>(first + face.mIndices[a]);
      }
      if (mirrored) std::swap(t[1], t[2]);
      surface.triangles.push_back(t);
      ++read.grouped.groups.back().count;
    }
  }

  std::string material_of(const aiMesh& mesh) const {
    aiString name;
    if (mesh.mMaterialIndex < scene_.mNumMaterials) scene_.mMaterials[mesh.mMaterialIndex]->Get(AI_MATKEY_NAME, name);
    return name.C_Str();
  }

  const aiScene& scene_;
  std::string name_;
};

/// In the child: reads the file and hands on what was read.
void send_raw(const std::filesystem::path& path, const std::string& name, internal::MessageWriter& message) {
  Assimp::Importer importer;
  const aiScene& scene = read_scene(importer, path, aiProcess_Triangulate);
  const internal::UnitOfScene unit = internal::unit_of(importer, scene, path);
  Collector collector(scene, name);
  collector.add(*scene.mRootNode, aiMatrix4x4t<double>());
  message.put(unit.unit.metres);
  message.put(unit.unit.stated);
  message.put(unit.unit.up);
  message.put(collector.points_and_lines);
  const GroupedSurface& grouped = collector.read.grouped;
  message.put(grouped.surface.vertices.size());
  for (const Vec3& p : grouped.surface.vertices) message.put(Vec3(unit.factor * p));
  message.put(grouped.surface.triangles.size());
  for (const Triangle& t : grouped.surface.triangles)
    for (const Index v : t) message.put(v);
  message.put(grouped.groups.size());
  for (const SurfaceGroup& group : grouped.groups) {
    message.put(group.name);
    message.put(group.material);
    message.put(group.first);
    message.put(group.count);
  }
  message.put(collector.read.node_ends.size());
  for (const std::size_t end : collector.read.node_ends) message.put(end);
}

RawSurface read_raw(const std::filesystem::path& path, const std::string& name, Warnings& warnings) {
  internal::MessageReader message = internal::in_child(name, internal::limits_for(path),
                                                       [&](internal::MessageWriter& to) { send_raw(path, name, to); });
  RawSurface read;
  read.unit.metres = message.get<double>();
  read.unit.stated = message.get<bool>();
  read.unit.up = message.get<char>();
  const auto left_out = message.get<std::size_t>();
  if (left_out > 0)
    warnings.push_back(name + ": " + std::to_string(left_out) +
                       " points and lines are no surface and have been left out");
  GroupedSurface& grouped = read.grouped;
  grouped.surface.vertices.resize(message.get<std::size_t>());
  for (Vec3& p : grouped.surface.vertices) p = message.get_vector();
  grouped.surface.triangles.resize(message.get<std::size_t>());
  for (Triangle& t : grouped.surface.triangles)
    for (Index& v : t) v = message.get<Index>();
  grouped.face_of.resize(grouped.surface.triangles.size());
  std::iota(grouped.face_of.begin(), grouped.face_of.end(), Index{0});
  grouped.groups.resize(message.get<std::size_t>());
  for (SurfaceGroup& group : grouped.groups) {
    group.name = message.get_text();
    group.material = message.get_text();
    group.first = message.get<Index>();
    group.count = message.get<Index>();
  }
  read.node_ends.resize(message.get<std::size_t>());
  for (std::size_t& end : read.node_ends) end = message.get<std::size_t>();
  return read;
}

/// Joins equal vertices within each node.
void weld_nodes(SurfaceMesh& surface, const std::vector<std::size_t>& node_ends) {
  SurfaceMesh all;
  std::size_t begin = 0;
  for (const std::size_t end : node_ends) {
    SurfaceMesh part;
    std::unordered_map<Index, Index> local;
    for (; begin < end; ++begin) {
      Triangle t = surface.triangles[begin];
      for (Index& v : t) {
        const auto [place, is_new] = local.try_emplace(v, static_cast<Index>(part.vertices.size()));
        if (is_new) part.vertices.push_back(surface.vertices[v]);
        v = place->second;
      }
      part.triangles.push_back(t);
    }
    weld(part);
    const auto offset = static_cast<Index>(all.vertices.size());
    for (const Triangle& t : part.triangles) all.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    all.vertices.insert(all.vertices.end(), part.vertices.begin(), part.vertices.end());
  }
  surface = std::move(all);
}

/// Of a format that limber reads itself: glTF has one, the others state none.
void tell_unit_of_known(const std::filesystem::path& path, FileUnit* unit) {
  std::string extension = path.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (unit != nullptr && (extension == ".gltf" || extension == ".glb"))
    *unit = {.metres = 1.0, .stated = true, .up = 'y'};
}

}  // namespace

SurfaceMesh read_surface_mesh_with_assimp(const std::filesystem::path& path, Warnings& warnings, FileUnit* unit) {
  const std::string name = quoted_path(path);
  RawSurface read = read_raw(path, name, warnings);
  if (unit != nullptr) *unit = read.unit;
  SurfaceMesh surface = std::move(read.grouped.surface);
  weld(surface);
  validate(surface, name, warnings);
  drop_unused_vertices(surface, name, warnings);
  return surface;
}

GroupedSurface read_any_grouped_surface(const std::filesystem::path& path, Warnings& warnings, FileUnit* unit) {
  if (is_known_mesh_format(path)) {
    tell_unit_of_known(path, unit);
    return read_grouped_surface(path, warnings);
  }
  const std::string name = quoted_path(path);
  RawSurface read = read_raw(path, name, warnings);
  if (unit != nullptr) *unit = read.unit;
  weld_nodes(read.grouped.surface, read.node_ends);
  validate(read.grouped, name, warnings);
  drop_unused_vertices(read.grouped.surface, name, warnings);
  return std::move(read.grouped);
}

SurfaceMesh read_any_surface_mesh(const std::filesystem::path& path, Warnings& warnings, FileUnit* unit) {
  if (!is_known_mesh_format(path)) return read_surface_mesh_with_assimp(path, warnings, unit);
  tell_unit_of_known(path, unit);
  return read_surface_mesh(path, warnings);
}

std::variant<TetMesh, SurfaceMesh> read_any_mesh(const std::filesystem::path& path, Warnings& warnings,
                                                 FileUnit* unit) {
  if (!is_known_mesh_format(path)) return read_surface_mesh_with_assimp(path, warnings, unit);
  tell_unit_of_known(path, unit);
  return read_mesh(path, warnings);
}

}  // namespace limber
