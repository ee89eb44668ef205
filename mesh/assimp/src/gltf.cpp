#include "gltf.h"

#include <algorithm>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string_view>

#include "assimp_scene.h"
#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber::internal {
namespace {

using Json = nlohmann::json;
using Matrix = aiMatrix4x4t<double>;

/// Extensions that say nothing of shapes begin so.
constexpr std::string_view kOfLooks[] = {"KHR_materials_",        "KHR_texture_", "EXT_texture_",
                                         "MSFT_texture_",         "KHR_lights_",  "EXT_lights_",
                                         "KHR_animation_pointer", "KHR_xmp",      "KHR_techniques_webgl"};

/// The JSON of a .gltf or .glb file; discarded if it is none.
Json json_of(std::string_view bytes) {
  constexpr std::size_t kHead = 20;  // of the container and its first chunk, whose length stands at byte 12
  if (bytes.starts_with("glTF") && bytes.size() >= kHead) {
    std::size_t length = 0;
    for (std::size_t i = 4; i-- > 0;) length = length << 8 | static_cast<unsigned char>(bytes[12 + i]);
    bytes = bytes.substr(kHead, length);
  }
  return Json::parse(bytes.begin(), bytes.end(), nullptr, false);
}

bool is_gltf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  return extension == ".gltf" || extension == ".glb";
}

const Json& member(const Json& of, const char* key) {
  static const Json nothing;
  if (!of.is_object()) return nothing;
  const auto found = of.find(key);
  return found == of.end() ? nothing : *found;
}

void check_positions(const Json& file, const std::string& name) {
  constexpr int kFloat = 5126;
  const Json& accessors = member(file, "accessors");
  for (const Json& mesh : member(file, "meshes"))
    for (const Json& primitive : member(mesh, "primitives")) {
      const Json& position = member(member(primitive, "attributes"), "POSITION");
      if (!position.is_number_unsigned() || !accessors.is_array() || position.get<std::size_t>() >= accessors.size())
        continue;  // Assimp tells what is wrong
      const Json& type = member(accessors[position.get<std::size_t>()], "componentType");
      if (type.is_number_integer() && type.get<int>() != kFloat)
        throw InputError(name +
                         ": its positions are whole numbers (KHR_mesh_quantization), which is not read; save it "
                         "without quantization");
    }
}

/// By the node's name: each bone of Assimp's has its joint's.
Matrix pose_of(const aiNode* node) {
  Matrix pose;
  for (; node != nullptr; node = node->mParent) pose = Matrix(node->mTransformation) * pose;
  return pose;
}

aiVector3t<double> wide(const aiVector3D& p) { return {p.x, p.y, p.z}; }

std::vector<aiVector3t<double>> morphed(const aiMesh& mesh) {
  std::vector<aiVector3t<double>> places;
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) places.push_back(wide(mesh.mVertices[i]));
  for (unsigned t = 0; t < mesh.mNumAnimMeshes; ++t) {
    const aiAnimMesh& target = *mesh.mAnimMeshes[t];
    const auto weight = static_cast<double>(target.mWeight);
    if (weight == 0.0 || target.mVertices == nullptr || target.mNumVertices != mesh.mNumVertices) continue;
    for (unsigned i = 0; i < mesh.mNumVertices; ++i)
      places[i] += (wide(target.mVertices[i]) - wide(mesh.mVertices[i])) * weight;
  }
  return places;
}

}  // namespace

void check_gltf(const std::filesystem::path& path, const std::string& name) {
  if (!is_gltf(path)) return;
  const Json file = json_of(read_file(path));
  for (const Json& required : member(file, "extensionsRequired")) {
    const std::string extension = required.is_string() ? required.get<std::string>() : required.dump();
    const auto begins_it = [&](std::string_view start) { return extension.starts_with(start); };
    if (std::none_of(std::begin(kOfLooks), std::end(kOfLooks), begins_it))
      throw InputError(name + ": requires the extension \"" + one_line(extension) +
                       "\", which is not read; save it without");
  }
  check_positions(file, name);
}

std::vector<Vec3> shown_vertices(const aiScene& scene, const aiMesh& mesh, const Matrix& pose) {
  const auto places = morphed(mesh);
  std::vector<Vec3> shown;
  if (mesh.mNumBones == 0) {
    for (const auto& p : places) {
      const aiVector3t<double> q = pose * p;
      shown.emplace_back(q.x, q.y, q.z);
    }
    return shown;
  }
  shown.assign(places.size(), Vec3::Zero());
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const Matrix moved = pose_of(scene.mRootNode->FindNode(bone.mName)) * Matrix(bone.mOffsetMatrix);
    for (unsigned k = 0; k < bone.mNumWeights; ++k) {
      const aiVertexWeight& weight = bone.mWeights[k];
      if (weight.mVertexId >= places.size()) continue;
      const aiVector3t<double> q = moved * places[weight.mVertexId];
      shown[weight.mVertexId] += static_cast<double>(weight.mWeight) * Vec3(q.x, q.y, q.z);
    }
  }
  return shown;
}

}  // namespace limber::internal
