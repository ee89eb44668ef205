#include "description.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "joint_loads.h"
#include "limber/collision/shape_surface.h"
#include "limber/scene/scene_player.h"

namespace limber::internal {
namespace {

using Json = nlohmann::ordered_json;

Json vector(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }

Json interval(const Interval& i) {
  const auto end = [](double x) { return std::isfinite(x) ? Json(x) : Json(); };
  return Json::array({end(i.low), end(i.high)});
}

/// Limits by coordinate.
Json limits(const JointSpec& spec) {
  const JointLimits& l = spec.limits;
  switch (spec.type) {
    case JointType::kRevolute:
      return Json::array({interval(l.rotation)});
    case JointType::kPrismatic:
      return Json::array({interval(l.translation[0])});
    case JointType::kCylindrical:
      return Json::array({interval(l.rotation), interval(l.translation[0])});
    case JointType::kPlanar:
      return Json::array({interval(l.translation[0]), interval(l.translation[1]), interval(l.rotation)});
    case JointType::kBall:
      return Json::array({interval(l.euler[0]), interval(l.euler[1]), interval(l.euler[2])});
    case JointType::kFixed:
      break;
  }
  return Json::array();
}

/// None: rigid.
Json factor_json(const LiveSettings& settings, std::size_t model) {
  const double factor = model < settings.stiffness.size() ? settings.stiffness[model] : 1.0;
  return std::isinf(factor) ? Json() : Json(factor);
}

constexpr double kHalfSide = 3.0;  // m, of what is shown of a half-space

Json surface_json(const TriangleMesh& mesh, const RigidTransform& pose) {
  Json points = Json::array(), corners = Json::array();
  for (const Vec3& p : mesh.vertices) {
    const Vec3 x = pose * p;
    for (int i = 0; i < 3; ++i) points.push_back(x[i]);
  }
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) corners.push_back(v);
  return {{"points", std::move(points)}, {"triangles", std::move(corners)}};
}

/// @param standing a static or a sensor
template <class Standing>
Json standing_shape(const Standing& standing, const Shape& shape) {
  Json json = surface_json(surface_of(shape, Vec3::Zero(), kHalfSide), standing.pose);
  json["name"] = standing.name;
  json["ground"] = std::holds_alternative<HalfSpace>(shape);
  return json;
}

/// Numbers of bodies by name; −1: the world.
Index number_of(const std::string& name, const Scene& scene) {
  const auto body =
      std::find_if(scene.bodies.begin(), scene.bodies.end(), [&](const SceneBody& b) { return b.name == name; });
  return body == scene.bodies.end() ? Linkage::kWorld : static_cast<Index>(body - scene.bodies.begin());
}

/// As the bodies are placed.
Linkage linkage_of(const Scene& scene, std::span<const std::shared_ptr<const ModalModel>> kinds,
                   std::span<const LiveScene::Body> bodies) {
  Linkage linkage;
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    const ModalModelData& data = kinds[bodies[i].model]->data();
    const Vec3 centre = start_of(scene.bodies[i]).pose * data.center_of_mass;
    linkage.bodies.push_back({centre, data.mass, 0.5 * data.inertia.trace()});
  }
  for (const SceneJoint& joint : scene.joints)
    linkage.joints.push_back({number_of(joint.a, scene), number_of(joint.b, scene), joint.spec.frame.origin});
  for (std::size_t i = 0; i < scene.bodies.size(); ++i)
    if (kinds[bodies[i].model]->data().motion != FrameMotion::kFree)
      linkage.joints.push_back({Linkage::kWorld, static_cast<Index>(i), linkage.bodies[i].centre});
  return linkage;
}

/// Where it is drawn: in the frame of a body, which the world moves as.
Json joint_json(const Scene& scene, std::size_t number, const JointLoad& load) {
  const SceneJoint& joint = scene.joints[number];
  const Index on = number_of(joint.a.empty() ? joint.b : joint.a, scene);
  const RigidTransform X = start_of(scene.bodies[static_cast<std::size_t>(on)]).pose.inverse();
  Json json = {{"type", to_string(joint.spec.type)},
               {"a", joint.a},
               {"b", joint.b},
               {"limits", limits(joint.spec)},
               {"on", on},
               {"origin", vector(X * joint.spec.frame.origin)},
               {"axis", vector(X.q * Vec3(joint.spec.frame.axes.col(0)))},
               {"load", {{"mass", load.mass}, {"moment", load.moment}, {"inertia", load.inertia}}}};
  json["acts"] = Json::array();
  for (const JointActuation& acts : joint.coordinates)
    json["acts"].push_back({{"motorVelocity", acts.motor_velocity},
                            {"motorMaxForce", acts.motor_max_force},
                            {"driveTarget", acts.drive_target},
                            {"driveStiffness", acts.drive_stiffness},
                            {"driveDamping", acts.drive_damping},
                            {"friction", acts.friction}});
  return json;
}

}  // namespace

std::string describe(const Scene& scene, const SceneModels& models,
                     std::span<const std::shared_ptr<const ModalModel>> kinds, const LiveSound& sound,
                     std::span<const LiveScene::Body> bodies, const LiveSettings& settings) {
  Json out;
  out["name"] = scene.name;
  out["settings"] = {{"gravity", vector(settings.gravity)},  {"step", settings.step},
                     {"substeps", settings.substeps},        {"modes", settings.modes},
                     {"damping", settings.damping},          {"friction", settings.friction},
                     {"solver", to_string(settings.solver)}, {"joint_friction", settings.joint_friction}};
  out["settings"]["stiffness"] = Json::array();
  for (std::size_t i = 0; i < kinds.size(); ++i) out["settings"]["stiffness"].push_back(factor_json(settings, i));
  out["contact"] = scene.contacts.options.has_value();
  out["models"] = Json::array();
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    const SoundModes* heard = sound.modes(i);
    out["models"].push_back(
        {{"name", kinds[i]->name()},
         {"sound", {{"modes", heard ? heard->modes() : 0}, {"vertices", heard ? heard->vertices : 0}}}});
  }
  out["bodies"] = Json::array();
  for (std::size_t i = 0; i < bodies.size(); ++i) {
    out["bodies"].push_back({{"name", bodies[i].name}, {"model", bodies[i].model}});
    if (i < models.shape_of_body.size() && models.shape_of_body[i])
      out["bodies"].back()["shape"] = surface_json(surface_of(*models.shape_of_body[i], Vec3::Zero(), kHalfSide), {});
  }
  out["statics"] = Json::array();
  for (std::size_t i = 0; i < scene.statics.size(); ++i)
    out["statics"].push_back(standing_shape(scene.statics[i], *models.shape_of_static[i]));
  out["sensors"] = Json::array();
  for (std::size_t i = 0; i < scene.sensors.size(); ++i)
    out["sensors"].push_back(standing_shape(scene.sensors[i], *models.shape_of_sensor[i]));
  out["joints"] = Json::array();
  const std::vector<JointLoad> loads = joint_loads(linkage_of(scene, kinds, bodies));
  for (std::size_t i = 0; i < scene.joints.size(); ++i) out["joints"].push_back(joint_json(scene, i, loads[i]));
  return out.dump(-1, ' ', true, Json::error_handler_t::replace);
}

}  // namespace limber::internal
