#include "asset_scene.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "joint_loads.h"

namespace limber::internal {
namespace {

using Json = nlohmann::ordered_json;

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
constexpr double kGravity = 9.80665;

void stand_up(Json& placed, UpAxis up) {
  if (up == UpAxis::kY) placed["orientation"] = {{"axis", {1, 0, 0}}, {"degrees", 90}};
}

void add_ground(Json& scene) {
  scene["contact"] = Json::object();
  scene["statics"] = Json::array({{{"name", "ground"}, {"shape", {{"half_space", Json::object()}}}}});
}

Linkage linkage_of(const Asset& asset) {
  Linkage linkage;
  for (const auto& body : asset.bodies)
    linkage.bodies.push_back({body->data().origin_in_input + body->data().center_of_mass, body->data().mass});
  for (const AssetJoint& joint : asset.joints) linkage.joints.push_back({joint.a, joint.b, joint.spec.frame.origin});
  for (std::size_t i = 0; i < asset.bodies.size(); ++i)  // what was fixed when it was baked
    if (asset.bodies[i]->data().motion != FrameMotion::kFree)
      linkage.joints.push_back({Linkage::kWorld, static_cast<Index>(i), linkage.bodies[i].centre});
  return linkage;
}

/// Friction that bears what the world holds by each joint, where the asset says nothing of it.
Json held_still(const Asset& asset) {
  const std::vector<JointLoad> loads = joint_loads(linkage_of(asset));
  Json drives = Json::array();
  std::set<std::pair<Index, Index>> told;  // a scene finds a joint by its two bodies
  for (std::size_t j = 0; j < asset.joints.size(); ++j) {
    const AssetJoint& joint = asset.joints[j];
    const int count = freedoms(joint.spec.type).count();
    if (!joint.coordinates.empty() || !loads[j].held || count == 0) continue;
    if (!told.emplace(joint.a, joint.b).second) continue;
    const auto name = [&](Index i) { return asset.bodies[static_cast<std::size_t>(i)]->name(); };
    Json drive = {{"b", name(joint.b)}, {"coordinates", Json::array()}};
    if (joint.a != AssetJoint::kWorld) drive["a"] = name(joint.a);
    for (int i = 0; i < count; ++i)
      drive["coordinates"].push_back(
          {{"friction", kGravity * (is_rotation(joint.spec.type, i) ? loads[j].moment : loads[j].mass)}});
    drives.push_back(std::move(drive));
  }
  return drives;
}

void add_machine(const Asset& asset, const std::string& name, UpAxis up, Json& scene) {
  Json machine = {{"name", name}, {"asset", "asset"}};
  stand_up(machine, up);
  Extent extent;
  for (const auto& body : asset.bodies) extent.add(*body, up, body->data().origin_in_input);
  add_ground(scene);
  const bool tied = std::any_of(asset.joints.begin(), asset.joints.end(),
                                [](const AssetJoint& joint) { return joint.a == AssetJoint::kWorld; });
  machine["position"] = {0.0, 0.0, (tied ? 0.0 : kDrop * extent.size().z()) - extent.low.z()};
  if (Json drives = held_still(asset); !drives.empty()) machine["drives"] = std::move(drives);
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
    scene["bodies"].push_back({{"name", model.name()},
                               {"asset", "asset"},
                               {"part", part},
                               {"position", {x, 0.0, free ? kDrop * size.z() - extent.low.z() : 0.0}}});
    stand_up(scene["bodies"].back(), up);
    x += 0.5 * size.x();
  }
  if (falls) add_ground(scene);
}

}  // namespace

Json scene_of_asset(const Asset& asset, const std::string& name, UpAxis up) {
  Json scene = {{"step", 1.0 / 60.0}, {"duration", 3600}, {"assets", {{"asset", "asset.glb"}}}};
  if (asset.joints.empty())
    add_single_bodies(asset, up, scene);
  else
    add_machine(asset, name, up, scene);
  return scene;
}

}  // namespace limber::internal
