#include "scene_library.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "limber/core/error.h"
#include "limber/core/quaternion.h"
#include "scene_bodies.h"

namespace limber::scenes {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kStep = 1.0 / 60.0;  // s

constexpr std::array kEntries{
    SceneEntry{"flight", "bars that fly, spin and ring", {100, 20, 0}},
    SceneEntry{"boxes", "rigid boxes that fall into a pit", {100, 0, 0}},
    SceneEntry{"mixed", "boxes, balls and capsules that fall into a pit; every tenth body bends", {100, 6, 0}},
    SceneEntry{"stack", "boxes that bend, one on the other", {5, 12, 0}},
    SceneEntry{"bunnies", "soft bunnies that fall on the ground and a ball", {4, 12, 0}},
    SceneEntry{"chain", "links that bend, on ball joints and hinges, the first hung from the world", {8, 10, 0}},
    SceneEntry{"lamp", "arms that bend, on hinges with springs; the last is led by the hand", {4, 10, 0}},
    SceneEntry{"drag", "a bar that is dragged over the ground by a corner", {1, 20, 0}},
    SceneEntry{"bin", "bunnies, bars and bowls that fall into a bin", {500, 32, 0}},
    SceneEntry{"sleepers", "boxes that sleep on the ground, and a hundred that are kept awake", {1000, 6, 0}, 20},
};
constexpr int kAwake = 100;  // of "sleepers"

Json vec(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }
Json quat(const Quaternion& q) { return Json::array({q.w, q.x, q.y, q.z}); }

Json body_at(const std::string& name, const std::string& asset, const Vec3& at, const Quaternion& turn = {}) {
  return {{"name", name}, {"asset", asset}, {"position", vec(at)}, {"orientation", quat(turn)}};
}

Json ground() { return {{"name", "ground"}, {"shape", {{"half_space", Json::object()}}}}; }

/// The ground and four sides at this distance from the middle, turned outwards by so much from upright (rad).
Json pit(double half_width, double lean) {
  Json all = Json::array({ground()});
  for (int side = 0; side < 4; ++side) {
    const Quaternion turn = quaternion_from_rotation_vector({0.0, 0.0, 0.5 * std::numbers::pi * side});
    const Quaternion tilt = quaternion_from_rotation_vector({0.0, 0.5 * std::numbers::pi - lean, 0.0});
    all.push_back({{"name", "side " + std::to_string(side)},
                   {"shape", {{"half_space", Json::object()}}},
                   {"position", vec(turn * Vec3(-half_width, 0.0, 0.0))},
                   {"orientation", quat(turn * tilt)}});
  }
  return all;
}

/// Without its assets.
Json scene_of(double seconds) { return {{"step", kStep}, {"steps", std::lround(seconds / kStep)}}; }

Json flight(int bodies) {
  Json scene = scene_of(5.0);
  scene["gravity"] = vec(Vec3::Zero());
  scene["bodies"] = {{{"name", "bar"},
                      {"asset", "bar"},
                      {"velocity", vec({0.0, 1.0, 3.0})},
                      {"angular_velocity", vec({1.0, 2.0, 0.5})},
                      {"copies", {{"count", {bodies, 1, 1}}, {"spacing", vec({1.0, 0.0, 0.0})}}}}};
  scene["strikes"] = {{{"body", "bar"}, {"time", 0.0}, {"at", {{"triangle", 5}}}, {"impulse", vec({0.0, 0.1, 0.2})}}};
  return scene;
}

/// In layers of nine above a pit. @param rolls two of three are balls and capsules. @param bends every tenth bends
Json pile(int bodies, bool rolls, bool bends) {
  constexpr double kSize = 0.3;  // m
  Json scene = scene_of(6.0);
  scene["contact"] = {{"friction", 0.5}};
  if (rolls) scene["contact"]["rolling_friction"] = 0.1;
  scene["statics"] = pit(3.0 * kSize, 0.5 * std::numbers::pi - 0.6);
  const Json shapes[] = {{{"box", {{"half_extents", vec(Vec3(0.5, 0.4, 0.3) * kSize)}}}},
                         {{"sphere", {{"radius", 0.4 * kSize}}}},
                         {{"capsule", {{"radius", 0.25 * kSize}, {"half_length", 0.3 * kSize}}}}};
  for (int i = 0; i < bodies; ++i) {
    const int layer = i / 9, place = i % 9;
    const Vec3 at((place % 3 - 1) * 1.3 * kSize + 0.02 * std::sin(3.0 * i),
                  (place / 3 - 1) * 1.3 * kSize + 0.02 * std::cos(5.0 * i), (0.8 + 1.3 * layer) * kSize);
    const bool bent = bends && i % 10 == 9;
    Json body = body_at("body " + std::to_string(i), bent ? "bent" : "brick", at,
                        quaternion_from_rotation_vector({0.3 * std::sin(i), 0.2 * std::cos(i), 0.5 * i}));
    if (!bent) body["shape"] = shapes[rolls ? i % 3 : 0];
    scene["bodies"].push_back(std::move(body));
  }
  return scene;
}

Json stack(int bodies) {
  const double height = body_size("box").z();
  Json scene = scene_of(4.0);
  scene["contact"] = {{"friction", 0.5}};
  scene["statics"] = Json::array({ground()});
  scene["bodies"] = {{{"name", "box"},
                      {"asset", "box"},
                      {"position", vec({0.0, 0.0, 0.5 * height})},
                      {"copies", {{"count", {1, 1, bodies}}, {"spacing", vec({0.0, 0.0, height})}}}}};
  return scene;
}

Json bunnies(int bodies) {
  Json scene = scene_of(4.0);
  scene["contact"] = {{"friction", 0.5}};
  scene["statics"] = Json::array(
      {ground(),
       {{"name", "ball"}, {"shape", {{"sphere", {{"radius", 0.08}}}}}, {"position", vec({0.02, 0.0, 0.08})}}});
  for (int i = 0; i < bodies; ++i)
    scene["bodies"].push_back(body_at("bunny " + std::to_string(i), "bunny",
                                      {0.03 * std::sin(2.0 * i), 0.03 * std::cos(2.0 * i), 0.35 + 0.26 * i},
                                      quaternion_from_rotation_vector({0.5 * std::numbers::pi, 0.4 * i, 0.0})));
  return scene;
}

/// Along x, end to end. @param name of the links
Json row_of_links(const std::string& name, int bodies) {
  const double length = body_size("link").x();
  return {{"name", name},
          {"asset", "link"},
          {"position", vec({0.5 * length, 0.0, 0.0})},
          {"copies", {{"count", {bodies, 1, 1}}, {"spacing", vec({length, 0.0, 0.0})}}}};
}
std::string copy(const std::string& name, int i, int bodies) {
  return bodies == 1 ? name : name + "[" + std::to_string(i) + "]";
}

Json joint_of_link(const std::string& name, int i, int bodies, const std::string& type) {
  Json joint{{"b", copy(name, i, bodies)},
             {"type", type},
             {"origin", vec({i * body_size("link").x(), 0.0, 0.0})},
             {"patch_radius", 0.03}};
  if (i > 0) joint["a"] = copy(name, i - 1, bodies);
  if (type == "revolute") joint["axis"] = vec(Vec3::UnitY());
  return joint;
}

Json chain(int bodies) {
  Json scene = scene_of(4.0);
  scene["bodies"] = Json::array({row_of_links("link", bodies)});
  for (int i = 0; i < bodies; ++i) {
    Json joint = joint_of_link("link", i, bodies, i % 2 == 0 ? "revolute" : "ball");
    if (i % 2 == 0 && i > 0) joint["limits"] = {{"rotation", {-1.5, 1.5}}};
    scene["joints"].push_back(std::move(joint));
  }
  return scene;
}

Json lamp(int bodies) {
  Json scene = scene_of(4.0);
  scene["bodies"] = Json::array({row_of_links("arm", bodies)});
  for (int i = 0; i < bodies; ++i) {
    Json joint = joint_of_link("arm", i, bodies, "revolute");
    joint["coordinates"] = Json::array({{{"drive", {{"target", 0.3}, {"stiffness", 5.0}, {"damping", 0.2}}}}});
    scene["joints"].push_back(std::move(joint));
  }
  const double reach = bodies * body_size("link").x();
  scene["handles"] = {{{"body", copy("arm", bodies - 1, bodies)},
                       {"start", 0.5},
                       {"duration", 1.5},
                       {"at", {{"nearest", vec({reach, 0.0, 0.0})}}},
                       {"motion", {{"keys", {{{"time", 1.0}, {"position", vec({0.7 * reach, 0.0, 0.2})}}}}}},
                       {"max_force", 50.0}}};
  return scene;
}

Json drag(int bodies) {
  const Vec3 size = body_size("bar");
  Json scene = scene_of(3.0);
  scene["contact"] = {{"friction", 0.4}};
  scene["statics"] = Json::array({ground()});
  for (int i = 0; i < bodies; ++i) {
    const std::string name = "bar " + std::to_string(i);
    const double y = 0.4 * i;
    scene["bodies"].push_back(body_at(name, "bar", {0.0, y, 0.5 * size.z()}));
    scene["handles"].push_back(
        {{"body", name},
         {"start", 0.25},
         {"duration", 2.0},
         {"at", {{"nearest", vec({0.5 * size.x(), 0.5 * size.y(), size.z()})}, {"frame", "body"}}},
         {"motion", {{"keys", {{{"time", 1.5}, {"position", vec({0.8, y + 0.1, 0.15})}}}}}},
         {"stiffness", 300.0},
         {"damping", 10.0}});
  }
  return scene;
}

Json bin(int bodies) {
  constexpr std::array kKinds{"bunny", "bar", "bowl"};
  constexpr double kSpacing = 0.28;  // m
  const int row = std::max(2, static_cast<int>(std::lround(std::cbrt(0.7 * bodies))));
  Json scene = scene_of(10.0);
  scene["contact"] = {{"friction", 0.4}};
  scene["sleep"] = Json::object();
  scene["statics"] = pit(0.5 * kSpacing * (row + 1), 0.0);
  for (int i = 0; i < bodies; ++i) {
    const int layer = i / (row * row), place = i % (row * row);
    const Vec3 at(kSpacing * (place % row - 0.5 * (row - 1)), kSpacing * (place / row - 0.5 * (row - 1)),
                  0.2 + kSpacing * layer);
    scene["bodies"].push_back(body_at("body " + std::to_string(i), kKinds[static_cast<std::size_t>(i) % 3], at,
                                      quaternion_from_rotation_vector({1.1 * i, 0.7 * i, 0.4 * i})));
  }
  return scene;
}

/// A hundred are pushed by next to nothing, which keeps them awake; the others fall asleep while the scene settles.
Json sleepers(int bodies) {
  const Vec3 size = body_size("brick");
  const int awake = std::min(bodies, kAwake), asleep = bodies - awake, row = std::max(1, (asleep + 99) / 100);
  Json scene = scene_of(2.0);
  scene["contact"] = Json::object();
  scene["sleep"] = {{"time", 0.05}, {"speed", 0.01}};
  scene["statics"] = Json::array({ground()});
  const auto grid = [&](const std::string& name, int columns, int rows, double y) {
    return Json{{"name", name},
                {"asset", "bent"},
                {"position", vec({0.0, y, 0.5 * size.z()})},
                {"copies", {{"count", {columns, rows, 1}}, {"spacing", vec({0.5, 0.5, 0.0})}}}};
  };
  scene["bodies"].push_back(grid("awake", awake, 1, 0.0));
  if (asleep > 0) scene["bodies"].push_back(grid("asleep", (asleep + row - 1) / row, row, 2.0));
  scene["forces"] = {{{"body", "awake"}, {"at", {{"triangle", 0}}}, {"force", vec({0.0, 0.0, 1e-3})}}};
  return scene;
}

Json scene_by_name(std::string_view name, int bodies) {
  if (name == "flight") return flight(bodies);
  if (name == "boxes") return pile(bodies, false, false);
  if (name == "mixed") return pile(bodies, true, true);
  if (name == "stack") return stack(bodies);
  if (name == "bunnies") return bunnies(bodies);
  if (name == "chain") return chain(bodies);
  if (name == "lamp") return lamp(bodies);
  if (name == "drag") return drag(bodies);
  if (name == "bin") return bin(bodies);
  return sleepers(bodies);
}

/// The library's body behind an asset's name, and how many modes it keeps.
std::pair<std::string, int> body_behind(const std::string& asset, int modes) {
  if (asset == "bent") return {"brick", modes};
  return {asset, asset == "brick" ? 0 : modes};
}

}  // namespace

std::span<const SceneEntry> scene_entries() { return kEntries; }

const SceneEntry& scene_entry(std::string_view name) {
  const auto found =
      std::find_if(kEntries.begin(), kEntries.end(), [&](const SceneEntry& e) { return e.name == name; });
  if (found != kEntries.end()) return *found;
  std::string known;
  for (const SceneEntry& e : kEntries) known += (known.empty() ? "" : ", ") + std::string(e.name);
  throw InvalidArgument("there is no scene \"" + std::string(name) + "\", expected one of " + known);
}

Scene LibraryScene::parsed() const { return parse_scene(text, name, {}); }

const Asset& SceneLibrary::body(const std::string& name, int modes, int vertices) {
  const auto key = std::tuple(name, modes, vertices);
  const auto known = baked_.find(key);
  return known != baked_.end()
             ? known->second
             : baked_.emplace(key, bake_body(name, {.modes = modes, .vertices = vertices})).first->second;
}

LibraryScene SceneLibrary::scene(std::string_view name, const SceneSize& size) {
  const SceneEntry& entry = scene_entry(name);
  for (const int n : {size.bodies, size.modes, size.vertices})
    if (n < 0) throw InvalidArgument("SceneLibrary: a size is " + std::to_string(n) + ", expected 0 or more");
  const int modes = size.modes > 0 ? size.modes : entry.size.modes;
  const Json made = scene_by_name(name, size.bodies > 0 ? size.bodies : entry.size.bodies);
  LibraryScene out{.name = std::string(name), .text = {}, .assets = {}};
  Json files = Json::object();
  for (const Json& described : made["bodies"]) {
    const std::string asset = described["asset"].get<std::string>();
    if (out.assets.contains(asset)) continue;
    const auto [body_name, kept] = body_behind(asset, modes);
    out.assets.emplace(asset, body(body_name, kept, size.vertices));
    files[asset] = asset + ".glb";
  }
  Json whole{{"assets", files}};
  whole.update(made);
  out.text = whole.dump(1) + "\n";
  return out;
}

}  // namespace limber::scenes
