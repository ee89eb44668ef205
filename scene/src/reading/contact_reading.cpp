#include "reading/contact_reading.h"

#include <array>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "reading/scene_reading.h"
#include "reading/shape_reading.h"

namespace limber {

std::string_view to_string(SceneContactRule::Method method) {
  constexpr std::array kWords{"penalty", "velocity_program", "gap_program", "complementary"};
  return kWords[static_cast<std::size_t>(method)];
}

std::string_view to_string(SceneContactRule::Friction model) {
  constexpr std::array kWords{"cone", "heuristic", "heuristic_no_slip"};
  return kWords[static_cast<std::size_t>(model)];
}

std::string_view to_string(SceneContactRule::Guard guard) {
  constexpr std::array kWords{"none", "clamp", "complementary"};
  return kWords[static_cast<std::size_t>(guard)];
}

std::string_view to_string(SceneFinder finder) {
  constexpr std::array kWords{"limber", "fcl"};
  return kWords[static_cast<std::size_t>(finder)];
}

std::string_view to_string(ContactSolver solver) {
  constexpr std::array kWords{"game", "exact"};
  return kWords[static_cast<std::size_t>(solver)];
}

}  // namespace limber

namespace limber::internal {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t kMaxSmallSteps = 1'000'000;

std::optional<double> read_friction(const JsonObject& o) {
  if (!o.has("friction")) return {};
  return non_negative(o, "friction", 0.0);
}

double read_restitution(const JsonObject& o, const Scene& scene) {
  const double e = non_negative(o, "restitution", 0.0);
  if (e > (scene.contacts.solver == ContactSolver::kGame ? 1.0 : 0.0))
    throw InputError(o.where("restitution") + ": is " + std::to_string(e) +
                     ", expected 0 to 1, and 0 where \"solver\" is \"exact\"");
  return e;
}

/// Numbers of layers as bits.
std::uint32_t read_layers(const JsonObject& o, const std::string& key, std::uint32_t otherwise) {
  constexpr int kLayers = 32;
  if (!o.has(key)) return otherwise;
  std::uint32_t bits = 0;
  o.for_each(key, [&](const Json& value, const std::string& where) {
    if (!value.is_number_integer() || value < 0 || value >= kLayers)
      refuse(where, JsonObject::shown(value), "a layer, an integer from 0 to " + std::to_string(kLayers - 1));
    bits |= std::uint32_t{1} << value.get<int>();
  });
  return bits;
}

CollisionFilter read_filter(const JsonObject& o) {
  const CollisionFilter all;
  return {.layers = read_layers(o, "layers", all.layers), .mask = read_layers(o, "meets", all.mask)};
}

SceneContactRule read_rule(const JsonObject& o) {
  using Method = SceneContactRule::Method;
  using Friction = SceneContactRule::Friction;
  using Guard = SceneContactRule::Guard;
  SceneContactRule rule;
  rule.method =
      choice_of(o, "method", {Method::kPenalty, Method::kVelocityProgram, Method::kGapProgram, Method::kComplementary},
                rule.method);
  rule.friction = choice_of(o, "friction_model", {Friction::kCone, Friction::kHeuristic, Friction::kHeuristicNoSlip},
                            rule.friction);
  rule.guard = choice_of(o, "guard", {Guard::kNone, Guard::kClamp, Guard::kComplementary}, rule.guard);
  rule.penalty_frequency = positive(o, "penalty_frequency", rule.penalty_frequency);
  rule.penalty_damping = non_negative(o, "penalty_damping", rule.penalty_damping);
  if (rule.is_own() || LIMBER_HAS_HAUSER) return rule;
  const bool method = rule.method != Method::kComplementary;
  refuse(o.where(method ? "method" : "friction_model"),
         in_quotes(std::string(method ? to_string(rule.method) : to_string(rule.friction))) +
             ", and this build of limber has no limber::hauser",
         method ? "\"complementary\", or a build with LIMBER_BUILD_PAPERS=ON"
                : "\"cone\", or a build with LIMBER_BUILD_PAPERS=ON");
}

SceneFinder read_finder(const JsonObject& o) {
  const SceneFinder finder = choice_of(o, "finder", {SceneFinder::kLimber, SceneFinder::kFcl}, SceneFinder::kLimber);
  if (finder == SceneFinder::kFcl && !LIMBER_HAS_FCL)
    refuse(o.where("finder"), "\"fcl\", and this build of limber has no FCL",
           "\"limber\", or a build where libfcl-dev is installed");
  return finder;
}

ContactOptions read_contact_options(const JsonObject& o) {
  ContactOptions c;
  c.friction = non_negative(o, "friction", c.friction);
  c.rolling_friction = non_negative(o, "rolling_friction", c.rolling_friction);
  c.recovery_speed = non_negative(o, "recovery_speed", c.recovery_speed);
  c.residual_compliance = o.boolean("residual_compliance", c.residual_compliance);
  o.finish();
  check_input(o.where(), [&] { c.validate(); });
  return c;
}

}  // namespace

/// [H03]'s rules stand in place of the exact solver.
void read_solver(const JsonObject& o, Scene& scene) {
  scene.contacts.solver = choice_of(o, "solver", {ContactSolver::kGame, ContactSolver::kExact}, scene.contacts.solver);
  scene.contacts.small_steps.substeps =
      static_cast<int>(o.integer("small_steps", 1, kMaxSmallSteps, scene.contacts.small_steps.substeps));
  if (scene.contacts.rule.is_own()) return;
  if (o.has("solver") && scene.contacts.solver == ContactSolver::kGame)
    refuse(o.where("solver"), "\"game\", and \"contact\" has a rule of [H03]", "\"exact\"");
  scene.contacts.solver = ContactSolver::kExact;
}

void read_contact(const JsonObject& o, Scene& scene) {
  if (o.has("contact")) {
    const JsonObject contact(o.at("contact"), o.where("contact"));
    scene.contacts.finder = read_finder(contact);
    scene.contacts.rule = read_rule(contact);
    scene.contacts.options = read_contact_options(contact);
  } else if (o.has("statics")) {
    scene.contacts.options.emplace();
  }
  read_solver(o, scene);
}

Vec3 read_surface_velocity(const JsonObject& o, const Scene& scene) {
  const char* key = "surface_velocity";
  if (o.has(key) && scene.contacts.solver == ContactSolver::kExact)
    refuse(o.where(key), "given, and the scene's solver is \"exact\"", "\"solver\": \"game\"");
  return o.vec3(key, Vec3::Zero());
}

SceneStatic read_static(const Json& value, const std::string& where, const Scene& scene,
                        const std::filesystem::path& folder) {
  const JsonObject o(value, where);
  SceneStatic s{.name = o.text("name"),
                .shape = read_shape(o, folder, Wearer::kStatic),
                .pose = read_pose(o),
                .filter = read_filter(o),
                .friction = read_friction(o),
                .surface_velocity = read_surface_velocity(o, scene),
                .where = where};
  o.finish();
  return s;
}

SceneSensor read_sensor(const Json& value, const std::string& where, const std::filesystem::path& folder) {
  const JsonObject o(value, where);
  SceneSensor s{.name = o.text("name"),
                .shape = read_shape(o, folder, Wearer::kSensor),
                .pose = read_pose(o),
                .filter = read_filter(o),
                .where = where};
  o.finish();
  return s;
}

void read_touch(const JsonObject& o, const Scene& scene, const std::filesystem::path& folder, SceneBody& body) {
  for (const std::string key :
       {"friction", "restitution", "surface_velocity", "shape", "layers", "meets", "touches_itself"})
    if (o.has(key) && !scene.contacts.options && (scene.sensors.empty() || (key != "layers" && key != "meets")))
      throw InputError(o.where(key) + ": is given, but nothing touches in this scene, expected \"contact\": {} or " +
                       "\"statics\" beside \"bodies\"");
  body.placement.friction = read_friction(o);
  body.placement.restitution = read_restitution(o, scene);
  body.surface_velocity = read_surface_velocity(o, scene);
  body.placement.filter = read_filter(o);
  body.placement.filter.self = o.boolean("touches_itself", false);
  if (o.has("shape")) body.shape = read_shape(o, folder, Wearer::kBody);
  if (o.has("shape") && body.placement.filter.self)
    throw InputError(o.where("touches_itself") + ": is true, but the body has a \"shape\", which does not deform, " +
                     "expected one of the two");
}

}  // namespace limber::internal
