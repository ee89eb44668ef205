#include "limber/view/page_file.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "asset_scene.h"
#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/base64.h"
#include "limber/mesh/write_mesh.h"
#include "limber/model/asset.h"
#include "limber/model/asset_without_normals.h"
#include "limber/posing/posed_model.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"
#include "packed_asset.h"

namespace limber {
namespace {

using Json = nlohmann::ordered_json;

using internal::base64;

/// JSON in which no markup can stand, for the inside of a script element.
std::string safe(const Json& json) {
  std::string text;
  for (const char c : json.dump(-1, ' ', true, Json::error_handler_t::replace))
    if (c == '<' || c == '>' || c == '&')
      text += c == '<' ? "\\u003c" : c == '>' ? "\\u003e" : "\\u0026";
    else
      text += c;
  return text;
}

std::string small_bytes(const Asset& asset, bool volumes) {
  return asset_bytes_without_normals(internal::asset_for_a_page(asset, volumes));
}

/// A file as the page has it: view/web/unpack.js reads it.
Json packed_file(const PageFile& file, const std::function<std::string(std::string_view)>& compress) {
  if (!compress) return {{"path", file.path}, {"base64", base64(file.bytes)}};
  if (!file.path.ends_with(".glb")) return {{"path", file.path}, {"gzip", base64(compress(file.bytes))}};
  return {{"path", file.path}, {"packed", base64(compress(internal::packed(file.bytes)))}};
}

/// Names of our own for the files of a scene.
class Renamed {
 public:
  explicit Renamed(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// @param bytes of the file, as the page is to have them
  void rename(Json& name, const std::function<std::string(const std::filesystem::path&)>& bytes) {
    const std::filesystem::path path = folder_ / name.get<std::string>();
    const auto [found, fresh] = names_.emplace(path.lexically_normal(), "");
    if (fresh) {
      found->second = std::to_string(names_.size() - 1) + path.extension().string();
      content.files.push_back({"/scene/" + found->second, bytes(path)});
    }
    name = found->second;
  }

  PageContent content;

 private:
  std::filesystem::path folder_;
  std::map<std::filesystem::path, std::string> names_;
};

UpAxis up_of_source(const Asset& asset) {
  const std::string format = std::filesystem::path(asset.provenance.input).extension().string();
  return format == ".glb" || format == ".gltf" ? UpAxis::kY : UpAxis::kZ;
}

}  // namespace

PageContent page_of_scene(const std::filesystem::path& path) {
  const Scene told = read_scene(path);
  load_models(told);  // what is wrong is told here, not in the page
  const bool volumes = std::ranges::any_of(told.bodies, [](const SceneBody& body) {
    return body.placement.filter.self || body.placement.inertial_coupling;
  });
  const auto asset = [&](const std::filesystem::path& file) { return small_bytes(read_asset(file), volumes); };
  const auto surface = [](const std::filesystem::path& file) { return read_file(file); };
  Json scene = Json::parse(read_file(path));
  Renamed renamed(path.parent_path());
  for (auto& [name, file] : scene["assets"].items()) renamed.rename(file, asset);
  for (const char* list : {"bodies", "statics", "sensors"})
    if (scene.contains(list))
      for (Json& entry : scene[list])
        if (entry.contains("shape"))
          for (auto& [kind, shape] : entry["shape"].items())
            if (shape.is_object() && shape.contains("file")) renamed.rename(shape["file"], surface);
  PageContent content = std::move(renamed.content);
  content.scene = "/scene/" + path.stem().string() + ".json";
  content.files.push_back({content.scene, scene.dump(-1, ' ', true, Json::error_handler_t::replace)});
  return content;
}

PageContent page_of_asset(const std::filesystem::path& path, std::optional<UpAxis> up) {
  const Asset asset = read_asset(path);
  const Json scene = internal::scene_of_asset(asset, path.stem().string(), up.value_or(up_of_source(asset)));
  const std::string name = "/scene/" + path.stem().string() + ".json";
  return {.scene = name,
          .files = {{"/scene/asset.glb", small_bytes(asset, false)},
                    {name, scene.dump(-1, ' ', true, Json::error_handler_t::replace)}}};
}

PageContent page_of_pose(const GroupedSurface& surface, const JointsFile& joints, const std::string& name,
                         const std::string& joints_name) {
  const JointedModel model = jointed_model(surface, joints, joints_name);
  const std::string stem = "/scene/" + name;
  return {.scene = stem + ".obj",
          .files = {{stem + ".obj", obj_text(model.surface)}, {stem + ".json", joints_text(joints_file(model))}},
          .joints = stem + ".json"};
}

std::string page_with(std::string_view empty, const PageContent& content,
                      const std::function<std::string(std::string_view)>& compress) {
  constexpr std::string_view kPlace = "@FILES@";
  const std::size_t at = empty.find(kPlace);
  if (at == std::string_view::npos) throw InvalidArgument("page_with: the page has no place for files");
  Json json = {{"scene", content.scene}, {"files", Json::array()}};
  if (!content.joints.empty()) json["joints"] = content.joints;
  for (const PageFile& file : content.files) json["files"].push_back(packed_file(file, compress));
  std::string page(empty.substr(0, at));
  page += safe(json);
  page += empty.substr(at + kPlace.size());
  return page;
}

}  // namespace limber
