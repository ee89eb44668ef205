#include "limber/scene/scene_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "reading/constraint_reading.h"
#include "reading/contact_reading.h"
#include "reading/machine_reading.h"
#include "reading/scene_reading.h"

namespace limber {
namespace {

using internal::choice;
using internal::Grid;
using internal::held_duration;
using internal::JsonObject;
using internal::kMaxIndex;
using internal::known_asset;
using internal::non_negative;
using internal::positive;
using internal::read_contact;
using internal::read_grid;
using internal::read_handle;
using internal::read_joint;
using internal::read_machines;
using internal::read_movement;
using internal::read_place;
using internal::read_pose;
using internal::read_sensor;
using internal::read_static;
using internal::read_touch;
using internal::refuse;
using internal::time_inside;
using Json = nlohmann::json;

constexpr std::int64_t kMaxSteps = 1'000'000'000;
constexpr std::int64_t kMaxSubsteps = 1'000'000;

Axes read_axes(const JsonObject& o) {
  return choice(o, "axes", {"world", "body"}, "world") == 0 ? Axes::kWorld : Axes::kBody;
}

Strike read_strike(const Json& value, const std::string& where, const Scene& scene) {
  const JsonObject o(value, where);
  Strike s{.body = o.text("body"),
           .time = time_inside(o, "time", scene),
           .at = read_place(o),
           .impulse = o.vec3("impulse"),
           .axes = read_axes(o),
           .where = where};
  if (o.has("contact_time")) {
    s.contact_time = o.number("contact_time");
    if (!(s.contact_time >= 1e-6 && s.contact_time <= 10.0))
      refuse(o.where("contact_time"), JsonObject::shown(o.at("contact_time")), "seconds from 1e-6 to 10");
  }
  o.finish();
  return s;
}

HeldForce read_force(const Json& value, const std::string& where, const Scene& scene) {
  const JsonObject o(value, where);
  HeldForce f{.body = o.text("body"),
              .start = o.has("start") ? time_inside(o, "start", scene) : 0.0,
              .duration = held_duration(o, scene, " (or use a strike)"),
              .at = read_place(o),
              .force = o.vec3("force"),
              .axes = read_axes(o),
              .where = where};
  o.finish();
  return f;
}

std::variant<Index, std::string> read_part(const JsonObject& o) {
  if (!o.has("part")) return Index{0};
  if (o.at("part").is_string()) return o.text("part");
  return static_cast<Index>(o.integer("part", 0, kMaxIndex));
}

void add_copies(const SceneBody& original, const Grid& grid, Scene& scene) {
  grid.for_each([&](int number, const Vec3& shift) {
    SceneBody copy = original;
    if (!grid.one()) copy.name += "[" + std::to_string(number) + "]";
    copy.placement.pose.p += shift;
    if (auto* keys = std::get_if<std::vector<PoseKey>>(&copy.movement))
      for (PoseKey& key : *keys) key.pose.p += shift;
    scene.bodies.push_back(std::move(copy));
  });
}

/// `damping` and `locks` are for the game solver.
void require_game(const JsonObject& o, const char* key, const Scene& scene) {
  if (o.has(key) && scene.contacts.solver == ContactSolver::kExact)
    refuse(o.where(key), "given, and the scene's solver is \"exact\"", "\"solver\": \"game\"");
}

std::array<bool, 3> read_locked(const JsonObject& o, const char* key) {
  std::array<bool, 3> locked{};
  if (!o.has(key)) return locked;
  o.for_each(key, [&](const Json& axis, const std::string& where) {
    const std::string name = axis.is_string() ? axis.get<std::string>() : "";
    if (name.size() != 1 || name[0] < 'x' || name[0] > 'z')
      refuse(where, JsonObject::shown(axis), "\"x\", \"y\" or \"z\"");
    locked[static_cast<std::size_t>(name[0] - 'x')] = true;
  });
  return locked;
}

FrameSettings read_frame_settings(const JsonObject& o, const Scene& scene) {
  FrameSettings settings{.gravity_scale = o.number("gravity_scale", 1.0)};
  for (const char* key : {"damping", "locks"}) require_game(o, key, scene);
  if (o.has("damping")) {
    const JsonObject damping(o.at("damping"), o.where("damping"));
    settings.linear_damping = non_negative(damping, "linear", 0.0);
    settings.angular_damping = non_negative(damping, "angular", 0.0);
    damping.finish();
  }
  if (o.has("locks")) {
    const JsonObject locks(o.at("locks"), o.where("locks"));
    settings.locks = {.translation = read_locked(locks, "translation"), .rotation = read_locked(locks, "rotation")};
    locks.finish();
  }
  return settings;
}

void read_body(const Json& value, const std::string& where, const std::filesystem::path& folder, Scene& scene) {
  const JsonObject o(value, where);
  SceneBody body;
  body.name = body.group = o.text("name");
  body.asset = known_asset(o, scene);
  body.part = read_part(o);
  body.placement = {.pose = read_pose(o),
                    .velocity = o.vec3("velocity", Vec3::Zero()),
                    .angular_velocity = o.vec3("angular_velocity", Vec3::Zero())};
  body.placement.modal_skin = o.boolean("modal_skin", true);
  body.placement.frame = read_frame_settings(o, scene);
  body.placement.inertial_coupling = o.boolean("inertial_coupling", false);
  read_touch(o, scene, folder, body);
  body.movement = read_movement(o, true);
  if (body.movement.index() != 0 && (o.has("velocity") || o.has("angular_velocity")))
    throw InputError(where + ": has both a velocity and a \"motion\", expected one of them");
  body.where = where;
  const Grid grid = read_grid(o);
  o.finish();
  add_copies(body, grid, scene);
}

void require_unique_names(const Scene& scene) {
  std::set<std::string> seen;
  const auto require_new = [&](const std::string& name, const std::string& where) {
    if (!seen.insert(name).second)
      throw InputError(where + ".name: \"" + name +
                       "\" is the name of another body, static or sensor, expected one name each");
  };
  for (const SceneBody& body : scene.bodies) require_new(body.name, body.where);
  for (const SceneStatic& s : scene.statics) require_new(s.name, s.where);
  for (const SceneSensor& s : scene.sensors) require_new(s.name, s.where);
}

/// @return how many bodies have the name
std::size_t require_known_body(const Scene& scene, const std::string& name, const std::string& where) {
  const auto named = [&](const SceneBody& body) { return body.name == name || body.group == name; };
  const auto count = std::count_if(scene.bodies.begin(), scene.bodies.end(), named);
  if (count > 0) return static_cast<std::size_t>(count);
  std::vector<std::string> known;
  for (const SceneBody& body : scene.bodies) known.push_back(body.name);
  throw InputError(where + ": \"" + name + "\" is not among the scene's bodies; did you mean \"" +
                   internal::nearest_word(name, known) + "\"?");
}

void require_one_body(const Scene& scene, const std::string& name, const std::string& where) {
  const std::size_t count = require_known_body(scene, name, where);
  if (count > 1)
    throw InputError(where + ": \"" + name + "\" is the name of " + std::to_string(count) +
                     " copies, expected one of them, such as \"" + name + "[0]\"");
}

/// `apart`: two bodies each.
void read_apart(const Json& value, const std::string& where, Scene& scene) {
  if (!value.is_array() || value.size() != 2 || !value[0].is_string() || !value[1].is_string() || value[0] == value[1])
    refuse(where, JsonObject::shown(value), "the names of two bodies");
  scene.contacts.apart.push_back({value[0].get<std::string>(), value[1].get<std::string>()});
  for (const std::string& name : scene.contacts.apart.back()) require_one_body(scene, name, where);
}

void require_joined_bodies(const Scene& scene, const SceneJoint& joint) {
  if (!joint.a.empty()) require_one_body(scene, joint.a, joint.where + ".a");
  require_one_body(scene, joint.b, joint.where + ".b");
  if (joint.a == joint.b) refuse(joint.where + ".b", internal::in_quotes(joint.b), "another body than \"a\"");
}

void read_microphones(const JsonObject& o, Scene& scene) {
  constexpr std::size_t kMostMicrophones = 16;
  if (!o.has("microphones")) return;
  scene.microphones.clear();
  o.for_each("microphones", [&](const Json& v, const std::string& w) {
    const JsonObject microphone(v, w);
    scene.microphones.push_back(microphone.vec3("position"));
    microphone.finish();
  });
  if (scene.microphones.empty() || scene.microphones.size() > kMostMicrophones)
    refuse(o.where("microphones"), std::to_string(scene.microphones.size()) + " of them", "1 to 16");
}

/// Whatever names a body is read when all are known.
void read_actions(const JsonObject& o, Scene& scene) {
  const auto each = [&](const char* key, auto&& read) {
    if (o.has(key)) o.for_each(key, read);
  };
  each("strikes", [&](const Json& v, const std::string& w) { scene.strikes.push_back(read_strike(v, w, scene)); });
  each("forces", [&](const Json& v, const std::string& w) { scene.forces.push_back(read_force(v, w, scene)); });
  each("handles", [&](const Json& v, const std::string& w) { scene.handles.push_back(read_handle(v, w, scene)); });
  each("apart", [&](const Json& v, const std::string& w) { read_apart(v, w, scene); });
  each("joints", [&](const Json& v, const std::string& w) { scene.joints.push_back(read_joint(v, w)); });
  for (const Strike& s : scene.strikes) require_known_body(scene, s.body, s.where + ".body");
  for (const HeldForce& f : scene.forces) require_known_body(scene, f.body, f.where + ".body");
  for (const SceneHandle& h : scene.handles) require_known_body(scene, h.body, h.where + ".body");
  for (const SceneJoint& j : scene.joints) require_joined_bodies(scene, j);
}

void read_time(const JsonObject& o, Scene& scene) {
  scene.step = positive(o, "step");
  if (o.has("steps") == o.has("duration"))
    throw InputError(o.where() + ": has " + (o.has("steps") ? "both \"steps\" and" : "neither \"steps\" nor") +
                     " \"duration\", expected one of them");
  if (o.has("steps")) {
    scene.steps = o.integer("steps", 1, kMaxSteps);
    return;
  }
  // A duration that is a multiple of the step but for round-off is that many steps; else the last step is begun.
  const double exact = positive(o, "duration") / scene.step;
  if (!(exact <= static_cast<double>(kMaxSteps)))
    refuse(o.where("duration"), JsonObject::shown(o.number("duration")),
           "at most " + std::to_string(kMaxSteps) + " steps");
  const double nearest = std::round(exact);
  scene.steps = static_cast<std::int64_t>(std::abs(exact - nearest) <= 1e-9 * exact ? nearest : std::ceil(exact));
}

void read_assets(const JsonObject& o, const std::filesystem::path& folder, Scene& scene) {
  const Json& assets = o.at("assets");
  if (!assets.is_object() || assets.empty())
    refuse(o.where("assets"), JsonObject::shown(assets), "an object {name: file, ...} with at least one");
  const JsonObject entries(assets, o.where("assets"));
  for (const auto& [name, unused] : assets.items()) {
    const std::string file = entries.text(name);
    if (file.empty()) refuse(entries.where(name), "\"\"", "a file name");
    scene.assets[name] = folder / file;
  }
}

SleepOptions read_sleep(const JsonObject& o) {
  SleepOptions sleep{.enabled = true};
  sleep.time = non_negative(o, "time", sleep.time);
  sleep.speed = non_negative(o, "speed", sleep.speed);
  o.finish();
  return sleep;
}

/// The smallest displacement that a picture shows.
double read_camera(const JsonObject& o) {
  constexpr double kHalfTurn = 180.0;
  const double degrees = positive(o, "degrees");
  if (degrees >= kHalfTurn) refuse(o.where("degrees"), JsonObject::shown(degrees), "less than 180");
  const double visible = visible_displacement(positive(o, "distance"), degrees * std::numbers::pi / kHalfTurn,
                                              static_cast<int>(o.integer("height", 1, 1'000'000)));
  o.finish();
  return visible;
}

SceneLimits read_limits(const JsonObject& o) {
  constexpr LoadKind kKinds[] = {LoadKind::kStatic, LoadKind::kSudden, LoadKind::kResonant};
  SceneLimits limits;
  limits.max_modes =
      static_cast<int>(o.integer("max_modes", 1, std::numeric_limits<int>::max(), std::numeric_limits<int>::max()));
  limits.max_force = non_negative(o, "max_force", 0.0);
  if (o.has("camera") && o.has("min_displacement"))
    throw InputError(o.where() + ": has both \"camera\" and \"min_displacement\", expected one of them");
  limits.min_displacement = o.has("camera") ? read_camera(JsonObject(o.at("camera"), o.where("camera")))
                                            : non_negative(o, "min_displacement", 0.0);
  limits.frame_rate = non_negative(o, "frame_rate", 0.0);
  limits.load = kKinds[choice(o, "load", {"static", "sudden", "resonant"}, "sudden")];
  o.finish();
  if ((limits.max_force > 0.0) != (limits.min_displacement > 0.0))
    throw InputError(o.where() +
                     ": has only one of \"max_force\" and \"min_displacement\" or \"camera\", expected both or none");
  return limits;
}

}  // namespace

Scene parse_scene(std::string_view text, const std::string& name, const std::filesystem::path& folder) {
  const Json document = internal::parse_json(text, name);
  const JsonObject o(document, name);
  Scene scene;
  read_time(o, scene);
  scene.substeps = static_cast<int>(o.integer("substeps", 1, kMaxSubsteps, scene.substeps));
  if (o.has("sleep")) scene.sleep = read_sleep(JsonObject(o.at("sleep"), o.where("sleep")));
  scene.gravity = o.vec3("gravity", scene.gravity);
  read_assets(o, folder, scene);
  if (o.has("limits")) scene.limits = read_limits(JsonObject(o.at("limits"), o.where("limits")));
  read_contact(o, scene);
  if (o.has("statics"))
    o.for_each("statics",
               [&](const Json& v, const std::string& w) { scene.statics.push_back(read_static(v, w, scene, folder)); });
  if (o.has("sensors"))
    o.for_each("sensors",
               [&](const Json& v, const std::string& w) { scene.sensors.push_back(read_sensor(v, w, folder)); });
  if (o.has("bodies") || !o.has("machines"))
    o.for_each("bodies", [&](const Json& v, const std::string& w) { read_body(v, w, folder, scene); });
  read_machines(o, folder, scene);
  if (scene.bodies.empty()) refuse(o.where("bodies"), "[]", "at least one body");
  require_unique_names(scene);
  read_actions(o, scene);
  read_microphones(o, scene);
  o.finish();
  return scene;
}

std::vector<std::filesystem::path> files_of(const Scene& scene) {
  std::set<std::filesystem::path> files;
  const auto add = [&](const SceneShape& shape) {
    if (const auto* file = std::get_if<ShapeFile>(&shape)) files.insert(file->path);
  };
  for (const auto& [name, file] : scene.assets) files.insert(file);
  for (const SceneBody& body : scene.bodies) add(body.shape);
  for (const SceneStatic& s : scene.statics) add(s.shape);
  for (const SceneSensor& s : scene.sensors) add(s.shape);
  return {files.begin(), files.end()};
}

Scene read_scene(const std::filesystem::path& path) {
  constexpr std::size_t kMaxBytes = std::size_t{64} << 20;
  Scene scene = parse_scene(read_file(path, kMaxBytes), "\"" + path.string() + "\"", path.parent_path());
  scene.name = path.stem().string();
  return scene;
}

}  // namespace limber
