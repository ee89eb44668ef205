#include "reading/machine_reading.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/internal/joint_spec_json.h"
#include "limber/machine/machine.h"
#include "limber/model/asset.h"
#include "reading/contact_reading.h"
#include "reading/scene_reading.h"

namespace limber::internal {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kMaxCopies = 100'000;

/// As the scene tells it, all copies alike.
struct SceneMachine {
  std::string name, asset, where;
  MachinePlacement placement{};
  SceneBody like{};  // what all its bodies have in common
  Grid grid{};
  std::vector<AssetJoint> joints;  // of the asset, with the scene's drives
};

std::string body_name(const std::string& machine, const Asset& asset, Index body) {
  return body == AssetJoint::kWorld ? "" : machine + "/" + asset.bodies[static_cast<std::size_t>(body)]->name();
}

/// `drives`: what acts on the coordinates of a joint, which two bodies of the asset name.
void read_drive(const Json& value, const std::string& where, const Asset& asset, std::vector<AssetJoint>& joints) {
  const JsonObject o(value, where);
  const auto number = [&](const char* key) {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
      names.push_back(asset.bodies[i]->name());
      if (names.back() == o.text(key)) return static_cast<Index>(i);
    }
    throw InputError(o.where(key) + ": " + in_quotes(o.text(key)) + " is no body of the asset; did you mean " +
                     in_quotes(nearest_word(o.text(key), names)) + "?");
  };
  const Index a = o.has("a") ? number("a") : AssetJoint::kWorld, b = number("b");
  const auto joint =
      std::find_if(joints.begin(), joints.end(), [&](const AssetJoint& j) { return j.a == a && j.b == b; });
  if (joint == joints.end())
    throw InputError(where + ": the asset has no joint from " + (o.has("a") ? in_quotes(o.text("a")) : "the world") +
                     " to " + in_quotes(o.text("b")) + "; limber-inspect lists them");
  joint->coordinates = read_joint_coordinates(o, joint->spec.type);
  o.finish();
  for (const JointActuation& actuation : joint->coordinates) check_input(where, [&] { actuation.validate(); });
}

SceneMachine read_machine(const JsonObject& o, const Asset& asset, const std::filesystem::path& folder,
                          const Scene& scene) {
  SceneMachine machine{.name = o.text("name"), .asset = o.text("asset"), .where = o.where(), .joints = asset.joints};
  machine.placement = {.pose = read_pose(o),
                       .velocity = o.vec3("velocity", Vec3::Zero()),
                       .angular_velocity = o.vec3("angular_velocity", Vec3::Zero()),
                       .tied = o.boolean("tied", true)};
  read_touch(o, scene, folder, machine.like);
  if (o.has("shape")) throw InputError(o.where("shape") + ": a machine has no shape of its own; remove it");
  machine.like.placement.modal_skin = o.boolean("modal_skin", true);
  if (o.has("drives"))
    o.for_each("drives", [&](const Json& v, const std::string& w) { read_drive(v, w, asset, machine.joints); });
  machine.grid = read_grid(o);
  o.finish();
  return machine;
}

void add_bodies(const SceneMachine& machine, const std::string& copy, const MachinePlacement& placement,
                const Asset& asset, Scene& scene) {
  for (std::size_t i = 0; i < asset.bodies.size(); ++i) {
    SceneBody body = machine.like;
    body.name = body_name(copy, asset, static_cast<Index>(i));
    body.group = body_name(machine.name, asset, static_cast<Index>(i));
    body.asset = machine.asset;
    body.part = static_cast<Index>(i);
    const BodyPlacement placed = placement_in_machine(*asset.bodies[i], placement);
    body.placement.pose = placed.pose;
    body.placement.velocity = placed.velocity;
    body.placement.angular_velocity = placed.angular_velocity;
    body.where = machine.where;
    scene.bodies.push_back(std::move(body));
  }
}

void add_machine(const SceneMachine& machine, const Asset& asset, Scene& scene) {
  machine.grid.for_each([&](int number, const Vec3& shift) {
    const std::string name = machine.grid.one() ? machine.name : machine.name + "[" + std::to_string(number) + "]";
    MachinePlacement placement = machine.placement;
    placement.pose.p += shift;
    add_bodies(machine, name, placement, asset, scene);
    for (const AssetJoint& joint : machine.joints)
      if (joint.a != AssetJoint::kWorld || placement.tied)
        scene.joints.push_back({.a = body_name(name, asset, joint.a),
                                .b = body_name(name, asset, joint.b),
                                .spec = joint.spec.moved_by(placement.pose),
                                .patch_radius = joint.patch_radius,
                                .collide = joint.collide,
                                .coordinates = joint.coordinates,
                                .where = machine.where});
    for (const auto& [a, b] : asset.apart)
      scene.contacts.apart.push_back({body_name(name, asset, a), body_name(name, asset, b)});
  });
}

}  // namespace

Grid read_grid(const JsonObject& parent) {
  Grid grid{};
  if (!parent.has("copies")) return grid;
  const JsonObject o(parent.at("copies"), parent.where("copies"));
  const auto count = o.numbers("count", 3);
  for (int a = 0; a < 3; ++a) {
    if (count[a] != std::floor(count[a]) || count[a] < 1 || count[a] > kMaxCopies)
      refuse(o.where("count"), JsonObject::shown(Json(count)), "three whole numbers >= 1");
    grid.count[a] = static_cast<Index>(count[a]);
  }
  if (count[0] * count[1] * count[2] > kMaxCopies)
    refuse(o.where("count"), JsonObject::shown(Json(count)), "at most " + std::to_string(kMaxCopies) + " copies");
  grid.spacing = o.vec3("spacing");
  o.finish();
  return grid;
}

std::string known_asset(const JsonObject& o, const Scene& scene) {
  std::string name = o.text("asset");
  if (scene.assets.contains(name)) return name;
  std::vector<std::string> known;
  for (const auto& [key, unused] : scene.assets) known.push_back(key);
  throw InputError(o.where("asset") + ": \"" + name + "\" is not among the scene's assets; did you mean \"" +
                   nearest_word(name, known) + "\"?");
}

void read_machines(const JsonObject& o, const std::filesystem::path& folder, Scene& scene) {
  if (!o.has("machines")) return;
  std::map<std::string, Asset> assets;
  o.for_each("machines", [&](const Json& value, const std::string& where) {
    const JsonObject machine(value, where);
    const std::string name = known_asset(machine, scene);
    if (!assets.contains(name)) assets.emplace(name, read_asset(scene.assets.at(name)));
    add_machine(read_machine(machine, assets.at(name), folder, scene), assets.at(name), scene);
  });
}

}  // namespace limber::internal
