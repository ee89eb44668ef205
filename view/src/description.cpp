#include "description.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "limber/collision/shape_surface.h"

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
Json factor_json(const PageSettings& settings, std::size_t model) {
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

}  // namespace

std::string describe(const Scene& scene, const SceneModels& models, std::span<const PageModel> shown,
                     std::span<const PageBody> bodies, const PageSettings& settings) {
  Json out;
  out["name"] = scene.name;
  out["settings"] = {{"gravity", vector(settings.gravity)},  {"drag_frequency", settings.drag_frequency},
                     {"poke_speed", settings.poke_speed},    {"step", settings.step},
                     {"substeps", settings.substeps},        {"modes", settings.modes},
                     {"damping", settings.damping},          {"friction", settings.friction},
                     {"solver", to_string(settings.solver)}, {"joint_friction", settings.joint_friction}};
  out["settings"]["stiffness"] = Json::array();
  for (std::size_t i = 0; i < shown.size(); ++i) out["settings"]["stiffness"].push_back(factor_json(settings, i));
  out["contact"] = scene.contacts.options.has_value();
  out["models"] = Json::array();
  for (const PageModel& model : shown)
    out["models"].push_back(
        {{"name", model.name},
         {"mass", model.mass},
         {"sound",
          {{"modes", model.sound ? model.sound->modes() : 0}, {"vertices", model.sound ? model.sound->vertices : 0}}},
         {"vertices", model.rest.size() / 3},
         {"triangles", model.triangles.size() / 3},
         {"frequencies", model.frequencies},
         {"visible_amplitudes", model.visible_amplitudes}});
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
  for (const SceneJoint& joint : scene.joints)
    out["joints"].push_back(
        {{"type", to_string(joint.spec.type)}, {"a", joint.a}, {"b", joint.b}, {"limits", limits(joint.spec)}});
  return out.dump(-1, ' ', true, Json::error_handler_t::replace);
}

}  // namespace limber::internal
