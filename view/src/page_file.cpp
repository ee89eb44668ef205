#include "limber/view/page_file.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/base64.h"
#include "limber/mesh/write_mesh.h"
#include "limber/model/asset.h"
#include "limber/posing/posed_model.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"

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

/// Names of our own for the files of a scene.
class Renamed {
 public:
  explicit Renamed(std::filesystem::path folder) : folder_(std::move(folder)) {}

  void rename(Json& name) {
    const std::filesystem::path path = folder_ / name.get<std::string>();
    const auto [found, fresh] = names_.emplace(path.lexically_normal(), "");
    if (fresh) {
      found->second = std::to_string(names_.size() - 1) + path.extension().string();
      content.files.push_back({"/scene/" + found->second, read_file(path)});
    }
    name = found->second;
  }

  PageContent content;

 private:
  std::filesystem::path folder_;
  std::map<std::filesystem::path, std::string> names_;
};

struct Extent {
  Vec3 low = Vec3::Constant(1e300), high = Vec3::Constant(-1e300);

  /// In the scene's axes. @param place of the body in the axes of the asset
  void add(const ModalModel& model, UpAxis up, const Vec3& place) {
    for (const Vec3f& at_rest : model.render().rest) {
      Vec3 p = at_rest.cast<double>() + place;
      if (up == UpAxis::kY) p = {p.x(), -p.z(), p.y()};
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
  }
  Vec3 size() const { return high - low; }
};

constexpr double kDrop = 0.5;  // of its height, that something falls

void stand_up(Json& placed, UpAxis up) {
  if (up == UpAxis::kY) placed["orientation"] = {{"axis", {1, 0, 0}}, {"degrees", 90}};
}

void add_ground(Json& scene) {
  scene["contact"] = Json::object();
  scene["statics"] = Json::array({{{"name", "ground"}, {"shape", {{"half_space", Json::object()}}}}});
}

/// As it was drawn where it is tied to the world; else it falls on the ground.
void add_machine(const Asset& asset, const std::string& name, UpAxis up, Json& scene) {
  const bool tied = std::any_of(asset.joints.begin(), asset.joints.end(),
                                [](const AssetJoint& joint) { return joint.a == AssetJoint::kWorld; });
  Json machine = {{"name", name}, {"asset", "asset"}};
  stand_up(machine, up);
  if (!tied) {
    Extent extent;
    for (const auto& body : asset.bodies) extent.add(*body, up, body->data().origin_in_input);
    machine["position"] = {0.0, 0.0, kDrop * extent.size().z() - extent.low.z()};
    add_ground(scene);
  }
  scene["machines"].push_back(std::move(machine));
}

void add_single_bodies(const Asset& asset, UpAxis up, Json& scene) {
  constexpr double kGap = 0.25;  // of a body's size, between two
  double x = 0.0;
  bool falls = false;
  for (std::size_t part = 0; part < asset.bodies.size(); ++part) {
    const ModalModel& model = *asset.bodies[part];
    Extent extent;
    extent.add(model, up, Vec3::Zero());
    const Vec3 size = extent.size();
    if (part > 0) x += (0.5 + kGap) * size.x();
    const bool free = model.data().motion == FrameMotion::kFree;
    falls = falls || free;
    scene["bodies"].push_back({{"name", "body " + std::to_string(part)},
                               {"asset", "asset"},
                               {"part", part},
                               {"position", {x, 0.0, free ? kDrop * size.z() - extent.low.z() : 0.0}}});
    stand_up(scene["bodies"].back(), up);
    x += 0.5 * size.x();
  }
  if (falls) add_ground(scene);
}

}  // namespace

PageContent page_of_scene(const std::filesystem::path& path) {
  load_models(read_scene(path));  // what is wrong is told here, not in the page
  Json scene = Json::parse(read_file(path));
  Renamed renamed(path.parent_path());
  for (auto& [name, file] : scene["assets"].items()) renamed.rename(file);
  for (const char* list : {"bodies", "statics", "sensors"})
    if (scene.contains(list))
      for (Json& entry : scene[list])
        if (entry.contains("shape"))
          for (auto& [kind, shape] : entry["shape"].items())
            if (shape.is_object() && shape.contains("file")) renamed.rename(shape["file"]);
  PageContent content = std::move(renamed.content);
  content.scene = "/scene/" + path.stem().string() + ".json";
  content.files.push_back({content.scene, scene.dump(-1, ' ', true, Json::error_handler_t::replace)});
  return content;
}

PageContent page_of_asset(const std::filesystem::path& path, UpAxis up) {
  const Asset asset = read_asset(path);
  Json scene = {{"step", 1.0 / 60.0}, {"duration", 3600}, {"assets", {{"asset", "asset.glb"}}}};
  if (asset.joints.empty())
    add_single_bodies(asset, up, scene);
  else
    add_machine(asset, path.stem().string(), up, scene);
  const std::string name = "/scene/" + path.stem().string() + ".json";
  return {.scene = name,
          .files = {{"/scene/asset.glb", read_file(path)},
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

std::string page_with(std::string_view empty, const PageContent& content) {
  constexpr std::string_view kPlace = "@FILES@";
  const std::size_t at = empty.find(kPlace);
  if (at == std::string_view::npos) throw InvalidArgument("page_with: the page has no place for files");
  Json json = {{"scene", content.scene}, {"files", Json::array()}};
  if (!content.joints.empty()) json["joints"] = content.joints;
  for (const PageFile& file : content.files)
    json["files"].push_back({{"path", file.path}, {"base64", base64(file.bytes)}});
  std::string page(empty.substr(0, at));
  page += safe(json);
  page += empty.substr(at + kPlace.size());
  return page;
}

}  // namespace limber
