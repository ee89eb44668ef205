// The scenes that are played: their meshes, bakes and scene files.
#include "error_scenes.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "constants.h"
#include "limber/core/error.h"
#include "scene_meshes.h"

namespace limber::testing {
namespace {

using Json = nlohmann::ordered_json;

const Material kRubber{.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000.0};
const Material kSponge{.youngs_modulus = 2e5, .poisson_ratio = 0.3, .density = 1000.0};
const Material kPlastic{.youngs_modulus = 5e7, .poisson_ratio = 0.3, .density = 1000.0};
const Vec3 kBar{0.4, 0.1, 0.1};
constexpr std::array kBarCells{16, 4, 4};

ErrorBody bar(const std::string& name, bool clamped) {
  return {.name = name, .size = kBar, .cells = kBarCells, .clamped = clamped, .material = kRubber};
}

ErrorScene poke() {
  return {.name = "poke",
          .what = "a clamped bar is pushed at a corner of its end and let go",
          .bodies = {bar("bar", true)},
          .forces = {{0, kBar, {0.0, 2.0, -8.0}, 0.2}},
          .tip = kBar};
}

ErrorScene drag() {
  return {.name = "drag",
          .what = "a clamped bar's corner is led aside, held and let go",
          .bodies = {bar("bar", true)},
          .leads = {{0, kBar, {0.0, 0.01, -0.03}, 0.3, 0.5}},
          .tip = kBar};
}

ErrorScene drop() {
  ErrorBody falling = bar("bar", false);
  falling.pose = {quaternion_from_rotation_vector({0.0, 0.35, 0.0}), {0.0, 0.0, 0.2}};
  falling.velocity = {0.0, 0.0, -1.0};
  falling.wall = Wall{};
  return {.name = "drop",
          .what = "a bar falls askew onto a smooth plane",
          .bodies = {falling},
          .gravity = kDown,
          .ground = true,
          .duration = 0.3,
          .tip = kBar};
}

ErrorScene collide() {
  ErrorBody left = bar("left", false), right = bar("right", false);
  left.pose.p = {-0.25, 0.0, 0.0}, right.pose.p = {0.25, 0.0, 0.0};
  left.velocity = {1.0, 0.0, 0.0}, right.velocity = {-1.0, 0.0, 0.0};
  left.wall = Wall{.axis = 0, .sign = -1.0}, right.wall = Wall{.axis = 0, .sign = 1.0};
  right.mirrored = true;
  return {.name = "collide",
          .what = "two bars meet end on, each the other's mirror image",
          .bodies = {left, right},
          .duration = 0.3,
          .tip = kBar};
}

ErrorScene spin() {
  ErrorBody turning = bar("bar", false);
  turning.angular_velocity = {0.0, 0.0, 12.0};
  return {.name = "spin",
          .what = "a bar turns about an axis across it and is struck at a corner",
          .bodies = {turning},
          .forces = {{0, kBar, {0.0, 0.0, 20.0}, 1.0 / 30.0}},
          .tip = kBar};
}

ErrorScene whirl() {
  ErrorScene scene = spin();
  scene.name = "whirl", scene.what = "spin, with inertial coupling";
  scene.bodies[0].coupled = true;
  return scene;
}

ErrorScene lamp() {
  const Vec3 size{0.2, 0.03, 0.03};
  const Vec3 low_end(0.0, 0.015, 0.015), high_end(0.2, 0.015, 0.015);
  ErrorScene scene{.name = "lamp", .what = "two arms and a foot, ball joints between them, swing under gravity"};
  for (int i = 0; i < 3; ++i)
    scene.bodies.push_back({.name = std::array{"foot", "arm", "head"}[static_cast<std::size_t>(i)],
                            .size = size,
                            .cells = {8, 2, 2},
                            .clamped = i == 0,
                            .material = {.youngs_modulus = 1e7, .poisson_ratio = 0.3, .density = 1000.0},
                            .pose = {{}, {0.2 * i + 0.1, 0.015, 0.015}}});
  scene.gravity = kDown;
  scene.ties = {{0, high_end, 1, low_end}, {1, high_end, 2, low_end}};
  scene.duration = 0.5;
  scene.tip_body = 2;
  scene.tip = high_end;
  return scene;
}

ErrorScene squeeze() {
  const Vec3 size{0.2, 0.2, 0.1};
  ErrorScene scene{.name = "squeeze", .what = "a soft block on a smooth plane is pressed at nine points of its top"};
  scene.bodies = {{.name = "block",
                   .size = size,
                   .cells = {8, 8, 4},
                   .material = kSponge,
                   .pose = {{}, {0.0, 0.0, 0.05}},
                   .wall = Wall{}}};
  scene.gravity = kDown;
  scene.ground = true;
  for (int i = 1; i <= 3; ++i)
    for (int j = 1; j <= 3; ++j)
      scene.forces.push_back({0, {0.05 * i, 0.05 * j, 0.1}, {0.0, 0.0, i == 2 && j == 2 ? -30.0 : -20.0}, 0.3});
  scene.duration = 0.5;
  scene.tip = {0.1, 0.1, 0.1};
  return scene;
}

ErrorScene strip() {
  const Vec3 size{0.5, 0.04, 0.01};
  return {.name = "strip",
          .what = "a long thin strip, clamped, is bent far: the worst case of [H03]",
          .bodies = {{.name = "strip", .size = size, .cells = {40, 2, 1}, .clamped = true, .material = kPlastic}},
          .forces = {{0, {0.5, 0.02, 0.01}, {0.0, 0.0, 1.0}, 0.5}},
          .tip = {0.5, 0.02, 0.01}};
}

Json vector(const Vec3& v) { return Json::array({v.x(), v.y(), v.z()}); }
Json place(const Vec3& at) { return {{"nearest", vector(at)}, {"frame", "input"}}; }

Json body_json(const ErrorBody& body) {
  const Quaternion& q = body.pose.q;
  Json out{{"name", body.name},
           {"asset", body.name},
           {"position", vector(body.pose.p)},
           {"orientation", Json::array({q.w, q.x, q.y, q.z})}};
  if (body.clamped) return out;
  out["velocity"] = vector(body.velocity);
  out["angular_velocity"] = vector(body.angular_velocity);
  if (body.coupled) out["inertial_coupling"] = true;
  return out;
}

Vec3 in_world(const ErrorBody& body, const Vec3& at) { return body.pose * Vec3(at - 0.5 * body.size); }

void add_loads(const ErrorScene& scene, Json& out) {
  for (const ErrorForce& f : scene.forces)
    out["forces"].push_back({{"body", scene.bodies[f.body].name},
                             {"start", 0.0},
                             {"duration", f.duration},
                             {"at", place(f.at)},
                             {"force", vector(f.force)}});
  for (const ErrorLead& lead : scene.leads) {
    const Vec3 to = in_world(scene.bodies[lead.body], lead.at) + lead.way;
    out["handles"].push_back(
        {{"body", scene.bodies[lead.body].name},
         {"start", 0.0},
         {"duration", lead.ends},
         {"at", place(lead.at)},
         {"motion", {{"keys", Json::array({{{"time", lead.arrives}, {"position", vector(to)}}})}}}});
  }
  for (const ErrorTie& tie : scene.ties)
    out["joints"].push_back({{"a", scene.bodies[tie.body_a].name},
                             {"b", scene.bodies[tie.body_b].name},
                             {"type", "ball"},
                             {"origin", vector(in_world(scene.bodies[tie.body_a], tie.at_a))}});
}

}  // namespace

const std::vector<ErrorScene>& error_scenes() {
  static const std::vector<ErrorScene> scenes{poke(),  drag(), drop(),    collide(), spin(),
                                              whirl(), lamp(), squeeze(), strip()};
  return scenes;
}

const ErrorScene& error_scene(const std::string& name) {
  std::string known;
  for (const ErrorScene& scene : error_scenes()) {
    if (scene.name == name) return scene;
    known += (known.empty() ? "" : ", ") + scene.name;
  }
  throw InvalidArgument("error_scene: \"" + name + "\", expected one of " + known);
}

ErrorScene driven(ErrorScene scene, double times) {
  scene.gravity *= times;
  for (ErrorBody& body : scene.bodies) body.velocity *= times, body.angular_velocity *= times;
  for (ErrorForce& f : scene.forces) f.force *= times;
  for (ErrorLead& lead : scene.leads) lead.way *= times;
  return scene;
}

std::string text(const ErrorSetting& s) {
  return fmt::format("{} modes, step {:.6g} s, {}, residual {}, {}, mesh {}, drive {:g}{}", s.modes, s.step, s.method,
                     s.residual ? "on" : "off", s.basis, s.mesh, s.drive,
                     s.substeps > 0 ? fmt::format(", game {}", s.substeps) : "");
}

std::string scene_text(const ErrorScene& scene, const ErrorSetting& setting,
                       const std::function<std::string(const std::string&)>& asset_file) {
  Json out{{"step", setting.step},
           {"steps", std::llround(scene.duration / setting.step)},
           {"gravity", vector(scene.gravity)},
           {"solver", setting.substeps > 0 ? "game" : "exact"}};
  if (setting.substeps > 0) out["small_steps"] = setting.substeps;
  for (const ErrorBody& body : scene.bodies) {
    out["assets"][body.name] = asset_file(body.name);
    out["bodies"].push_back(body_json(body));
  }
  if (scene.has_contact())
    out["contact"] = {{"method", setting.method}, {"friction", 0.0}, {"residual_compliance", setting.residual}};
  if (scene.ground) out["statics"] = Json::array({{{"name", "ground"}, {"shape", {{"half_space", Json::object()}}}}});
  add_loads(scene, out);
  return out.dump(2) + "\n";
}

}  // namespace limber::testing
