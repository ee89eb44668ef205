#include "reading/constraint_reading.h"

#include "limber/core/error.h"
#include "limber/internal/joint_spec_json.h"
#include "reading/scene_reading.h"

namespace limber::internal {
namespace {

using Json = nlohmann::json;

HandleOptions read_handle_options(const JsonObject& o) {
  HandleOptions options;
  if (o.has("directions")) {
    o.for_each("directions",
               [&](const Json& v, const std::string& where) { options.directions.push_back(direction_of(v, where)); });
    if (options.directions.empty()) refuse(o.where("directions"), "[]", "1 to 3 directions at right angles");
  }
  options.max_force = positive(o, "max_force", options.max_force);
  options.stiffness = non_negative(o, "stiffness", options.stiffness);
  options.damping = non_negative(o, "damping", options.damping);
  check_input(o.where(), [&] { options.validate(); });
  return options;
}

}  // namespace

SceneHandle read_handle(const Json& value, const std::string& where, const Scene& scene) {
  const JsonObject o(value, where);
  SceneHandle h{.body = o.text("body"),
                .start = o.has("start") ? time_inside(o, "start", scene) : 0.0,
                .duration = held_duration(o, scene),
                .at = read_place(o),
                .options = read_handle_options(o),
                .movement = read_movement(o, false),
                .where = where};
  o.finish();
  return h;
}

SceneJoint read_joint(const Json& value, const std::string& where) {
  const JsonObject o(value, where);
  SceneJoint j{.a = o.text("a", ""), .b = o.text("b"), .where = where};
  if (o.has("a") && j.a.empty()) refuse(o.where("a"), "\"\"", "a body; without \"a\" it is the world");
  j.spec = read_joint_kind(o);
  if (o.has("limits")) j.spec.limits = read_joint_limits(o, j.spec.type);
  check_input(where, [&] { j.spec.validate(); });
  j.patch_radius = non_negative(o, "patch_radius", 0.0);
  j.collide = o.boolean("collide", false);
  j.coordinates = read_joint_coordinates(o, j.spec.type);
  o.finish();
  return j;
}

}  // namespace limber::internal
