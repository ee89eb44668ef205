#include "limber/view/page_file.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/model/asset.h"
#include "limber/scene/scene_file.h"
#include "limber/scene/scene_model.h"

namespace limber {
namespace {

using Json = nlohmann::ordered_json;

std::string base64(std::string_view bytes) {
  static constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

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
  Vec3 size;
  double low = 0.0;  // the least z
};

/// In the scene's axes.
Extent extent_of(const ModalModel& model, UpAxis up) {
  Vec3 most = Vec3::Constant(-1e300), least = Vec3::Constant(1e300);
  for (const Vec3f& at_rest : model.render().rest) {
    Vec3 p = at_rest.cast<double>();
    if (up == UpAxis::kY) p = {p.x(), -p.z(), p.y()};
    most = most.cwiseMax(p);
    least = least.cwiseMin(p);
  }
  return {most - least, least.z()};
}

}  // namespace

PageContent page_of_scene(const std::filesystem::path& path) {
  load_models(read_scene(path));  // what is wrong is told here, not in the page
  Json scene = Json::parse(read_file(path));
  Renamed renamed(path.parent_path());
  for (auto& [name, file] : scene["assets"].items()) renamed.rename(file);
  for (const char* list : {"bodies", "statics"})
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
  constexpr double kGap = 0.25;  // of a body's size, between two
  constexpr double kDrop = 0.5;  // of its height
  const Asset asset = read_asset(path);
  Json scene = {{"step", 1.0 / 60.0}, {"duration", 3600}, {"assets", {{"asset", "asset.glb"}}}};
  double x = 0.0;
  bool falls = false;
  for (std::size_t part = 0; part < asset.bodies.size(); ++part) {
    const ModalModel& model = *asset.bodies[part];
    const auto [size, low] = extent_of(model, up);
    if (part > 0) x += (0.5 + kGap) * size.x();
    const bool free = model.data().motion == FrameMotion::kFree;
    falls = falls || free;
    scene["bodies"].push_back({{"name", "body " + std::to_string(part)},
                               {"asset", "asset"},
                               {"part", part},
                               {"position", {x, 0.0, free ? kDrop * size.z() - low : 0.0}}});
    if (up == UpAxis::kY) scene["bodies"].back()["orientation"] = {{"axis", {1, 0, 0}}, {"degrees", 90}};
    x += 0.5 * size.x();
  }
  if (falls) {
    scene["contact"] = Json::object();
    scene["statics"] = Json::array({{{"name", "ground"}, {"shape", {{"half_space", Json::object()}}}}});
  }
  const std::string name = "/scene/" + path.stem().string() + ".json";
  return {.scene = name, .files = {{"/scene/asset.glb", read_file(path)}, {name, scene.dump()}}};
}

std::string page_with(std::string_view empty, const PageContent& content) {
  constexpr std::string_view kPlace = "@FILES@";
  const std::size_t at = empty.find(kPlace);
  if (at == std::string_view::npos) throw InvalidArgument("page_with: the page has no place for files");
  Json json = {{"scene", content.scene}, {"files", Json::array()}};
  for (const PageFile& file : content.files)
    json["files"].push_back({{"path", file.path}, {"base64", base64(file.bytes)}});
  std::string page(empty.substr(0, at));
  page += safe(json);
  page += empty.substr(at + kPlace.size());
  return page;
}

}  // namespace limber
