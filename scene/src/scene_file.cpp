#include "limber/scene/scene_file.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "limber/core/error.h"
#include "limber/internal/strict_json.h"

namespace limber {
namespace {

using internal::JsonObject;
using Json = nlohmann::json;

constexpr std::int64_t kMaxSteps = 1'000'000'000;
constexpr std::int64_t kMaxCopies = 100'000;
constexpr std::int64_t kMaxSubsteps = 1'000'000;
constexpr Index kMaxIndex = std::numeric_limits<Index>::max();
constexpr double kToTheEnd = std::numeric_limits<double>::infinity();

[[noreturn]] void refuse(const std::string& where, const std::string& seen, const std::string& expected) {
  throw InputError(where + ": is " + seen + ", expected " + expected);
}

std::string shown(double x) { return JsonObject::shown(Json(x)); }

double positive(const JsonObject& o, const std::string& key) {
  const double x = o.number(key);
  if (!(x > 0.0)) refuse(o.where(key), shown(x), "a number > 0");
  return x;
}

double non_negative(const JsonObject& o, const std::string& key, double otherwise) {
  const double x = o.number(key, otherwise);
  if (x < 0.0) refuse(o.where(key), shown(x), "a number >= 0");
  return x;
}

Vec3 direction(const JsonObject& o, const std::string& key) {
  const Vec3 v = o.vec3(key);
  if (!(v.norm() > 0.0)) refuse(o.where(key), "[0, 0, 0]", "a direction of any length > 0");
  return v / v.norm();
}

/// One of a few words. @return its number in `words`
std::size_t choice(const JsonObject& o, const std::string& key, const std::vector<std::string>& words,
                   const std::string& otherwise) {
  const std::string seen = o.text(key, otherwise);
  const auto found = std::find(words.begin(), words.end(), seen);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  std::string list;
  for (const auto& w : words) list += (list.empty() ? "\"" : ", \"") + w + "\"";
  refuse(o.where(key), "\"" + seen + "\"", "one of " + list);
}

Axes read_axes(const JsonObject& o) {
  return choice(o, "axes", {"world", "body"}, "world") == 0 ? Axes::kWorld : Axes::kBody;
}

PlaceFrame read_place_frame(const JsonObject& o) {
  constexpr PlaceFrame kFrames[] = {PlaceFrame::kWorld, PlaceFrame::kBody, PlaceFrame::kInput};
  return kFrames[choice(o, "frame", {"world", "body", "input"}, "world")];
}

/// [w, x, y, z] of any length > 0, or {"axis": [x, y, z], "degrees": angle}.
Quaternion read_orientation(const JsonObject& o) {
  if (!o.has("orientation")) return {};
  const Json& value = o.at("orientation");
  if (value.is_object()) {
    const JsonObject turn(value, o.where("orientation"));
    const Vec3 axis = direction(turn, "axis");
    const double radians = turn.number("degrees") * std::numbers::pi / 180.0;
    turn.finish();
    return quaternion_from_rotation_vector(axis * radians);
  }
  const auto n = o.numbers("orientation", 4);
  const Quaternion q{n[0], n[1], n[2], n[3]};
  if (!(q.norm() > 0.0))
    refuse(o.where("orientation"), "[0, 0, 0, 0]", "a quaternion [w, x, y, z] or {\"axis\", \"degrees\"}");
  return normalized(q);
}

RigidTransform read_pose(const JsonObject& o) { return {read_orientation(o), o.vec3("position", Vec3::Zero())}; }

OnTriangle read_triangle(const JsonObject& o) {
  OnTriangle at;
  at.triangle = static_cast<Index>(o.integer("triangle", 0, kMaxIndex));
  if (!o.has("weights")) {
    at.weights = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
    return at;
  }
  constexpr double kSumError = 1e-6;  // weights typed by hand with six digits
  const auto w = o.numbers("weights", 3);
  const double sum = w[0] + w[1] + w[2];
  if (*std::min_element(w.begin(), w.end()) < 0.0 || std::abs(sum - 1.0) > kSumError)
    refuse(o.where("weights"), JsonObject::shown(Json(w)), "three numbers >= 0 with the sum 1");
  at.weights = {w[0] / sum, w[1] / sum, w[2] / sum};
  return at;
}

AlongRay read_ray(const JsonObject& o) {
  const JsonObject ray(o.at("ray"), o.where("ray"));
  AlongRay at{.from = ray.vec3("from"), .direction = direction(ray, "direction"), .frame = PlaceFrame::kWorld};
  ray.finish();
  at.frame = read_place_frame(o);
  return at;
}

SurfacePlace read_place(const JsonObject& parent) {
  const JsonObject o(parent.at("at"), parent.where("at"));
  const bool kinds[] = {o.has("triangle"), o.has("vertex"), o.has("nearest"), o.has("ray")};
  if (std::count(std::begin(kinds), std::end(kinds), true) != 1)
    refuse(o.where(), JsonObject::shown(parent.at("at")),
           "exactly one of \"triangle\", \"vertex\", \"nearest\" and \"ray\"");
  SurfacePlace place;
  if (kinds[0]) place = read_triangle(o);
  if (kinds[1]) place = AtVertex{static_cast<Index>(o.integer("vertex", 0, kMaxIndex))};
  if (kinds[2]) place = NearestTo{.point = o.vec3("nearest"), .frame = read_place_frame(o)};
  if (kinds[3]) place = read_ray(o);
  o.finish();
  return place;
}

double time_inside(const JsonObject& o, const std::string& key, const Scene& scene) {
  const double t = o.number(key);
  if (!(t >= 0.0 && t < scene.duration()))
    refuse(o.where(key), shown(t), "a time within the scene's duration, [0, " + shown(scene.duration()) + ") s");
  return t;
}

Strike read_strike(const Json& value, const std::string& where, const Scene& scene) {
  const JsonObject o(value, where);
  Strike s{.body = o.text("body"),
           .time = time_inside(o, "time", scene),
           .at = read_place(o),
           .impulse = o.vec3("impulse"),
           .axes = read_axes(o),
           .where = where};
  o.finish();
  return s;
}

HeldForce read_force(const Json& value, const std::string& where, const Scene& scene) {
  const JsonObject o(value, where);
  HeldForce f{.body = o.text("body"),
              .start = o.has("start") ? time_inside(o, "start", scene) : 0.0,
              .duration = kToTheEnd,
              .at = read_place(o),
              .force = o.vec3("force"),
              .axes = read_axes(o),
              .where = where};
  if (o.has("duration")) f.duration = positive(o, "duration");
  if (f.duration < scene.step)
    refuse(o.where("duration"), shown(f.duration), "at least one step, " + shown(scene.step) + " s (or use a strike)");
  o.finish();
  return f;
}

Shake read_shake(const JsonObject& o) {
  Shake s{.axis = direction(o, "axis"),
          .amplitude = positive(o, "amplitude"),
          .frequency = positive(o, "frequency"),
          .start = non_negative(o, "start", 0.0),
          .duration = kToTheEnd};
  if (o.has("duration")) s.duration = positive(o, "duration");
  o.finish();
  return s;
}

std::vector<PoseKey> read_keys(const JsonObject& motion) {
  std::vector<PoseKey> keys;
  motion.for_each("keys", [&](const Json& value, const std::string& where) {
    const JsonObject o(value, where);
    keys.push_back({.time = non_negative(o, "time", 0.0), .pose = read_pose(o)});
    o.finish();
    if (keys.size() > 1 && !(keys.back().time > keys[keys.size() - 2].time))
      refuse(where + ".time", shown(keys.back().time), "a time after the key before it");
  });
  if (keys.empty()) refuse(motion.where("keys"), "[]", "at least one key");
  return keys;
}

FrameMovement read_movement(const JsonObject& body) {
  if (!body.has("motion")) return {};
  const JsonObject o(body.at("motion"), body.where("motion"));
  const bool shake = o.has("shake"), keys = o.has("keys");
  if (shake == keys) refuse(o.where(), JsonObject::shown(body.at("motion")), "one of \"shake\" and \"keys\"");
  FrameMovement movement;
  if (shake) movement = read_shake(JsonObject(o.at("shake"), o.where("shake")));
  if (keys) movement = read_keys(o);
  o.finish();
  return movement;
}

/// A grid of copies: count along x, y, z and the distances between them. One body where it is not given.
struct Grid {
  std::array<Index, 3> count{1, 1, 1};
  Vec3 spacing = Vec3::Zero();
};

Grid read_grid(const JsonObject& body) {
  Grid grid;
  if (!body.has("copies")) return grid;
  const JsonObject o(body.at("copies"), body.where("copies"));
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

std::variant<Index, std::string> read_part(const JsonObject& o) {
  if (!o.has("part")) return Index{0};
  if (o.at("part").is_string()) return o.text("part");
  return static_cast<Index>(o.integer("part", 0, kMaxIndex));
}

std::string known_asset(const JsonObject& o, const Scene& scene) {
  std::string name = o.text("asset");
  if (scene.assets.contains(name)) return name;
  std::vector<std::string> known;
  for (const auto& [key, unused] : scene.assets) known.push_back(key);
  throw InputError(o.where("asset") + ": \"" + name + "\" is not among the scene's assets; did you mean \"" +
                   internal::nearest_word(name, known) + "\"?");
}

void add_copies(const SceneBody& original, const Grid& grid, Scene& scene) {
  const bool alone = grid.count[0] == 1 && grid.count[1] == 1 && grid.count[2] == 1;
  int i = 0;
  for (Index z = 0; z < grid.count[2]; ++z)
    for (Index y = 0; y < grid.count[1]; ++y)
      for (Index x = 0; x < grid.count[0]; ++x) {
        SceneBody copy = original;
        if (!alone) copy.name += "[" + std::to_string(i++) + "]";
        const Vec3 shift = Vec3(x, y, z).cwiseProduct(grid.spacing);
        copy.placement.pose.p += shift;
        if (auto* keys = std::get_if<std::vector<PoseKey>>(&copy.movement))
          for (PoseKey& key : *keys) key.pose.p += shift;
        scene.bodies.push_back(std::move(copy));
      }
}

void read_body(const Json& value, const std::string& where, Scene& scene) {
  const JsonObject o(value, where);
  SceneBody body;
  body.name = body.group = o.text("name");
  body.asset = known_asset(o, scene);
  body.part = read_part(o);
  body.placement = {.pose = read_pose(o),
                    .velocity = o.vec3("velocity", Vec3::Zero()),
                    .angular_velocity = o.vec3("angular_velocity", Vec3::Zero())};
  body.movement = read_movement(o);
  if (body.movement.index() != 0 && (o.has("velocity") || o.has("angular_velocity")))
    throw InputError(where + ": has both a velocity and a \"motion\", expected one of them");
  body.where = where;
  const Grid grid = read_grid(o);
  o.finish();
  add_copies(body, grid, scene);
}

void require_unique_names(const Scene& scene) {
  std::set<std::string> seen;
  for (const SceneBody& body : scene.bodies)
    if (!seen.insert(body.name).second)
      throw InputError(body.where + ".name: \"" + body.name + "\" is the name of another body, expected one name each");
}

void require_known_body(const Scene& scene, const std::string& name, const std::string& where) {
  std::vector<std::string> known;
  for (const SceneBody& body : scene.bodies) {
    if (body.name == name || body.group == name) return;
    known.push_back(body.name);
  }
  throw InputError(where + ".body: \"" + name + "\" is not among the scene's bodies; did you mean \"" +
                   internal::nearest_word(name, known) + "\"?");
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
    refuse(o.where("duration"), shown(o.number("duration")), "at most " + std::to_string(kMaxSteps) + " steps");
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

SceneLimits read_limits(const JsonObject& o) {
  constexpr LoadKind kKinds[] = {LoadKind::kStatic, LoadKind::kSudden, LoadKind::kResonant};
  SceneLimits limits;
  limits.max_modes =
      static_cast<int>(o.integer("max_modes", 0, std::numeric_limits<int>::max(), std::numeric_limits<int>::max()));
  limits.max_force = non_negative(o, "max_force", 0.0);
  limits.min_displacement = non_negative(o, "min_displacement", 0.0);
  limits.frame_rate = non_negative(o, "frame_rate", 0.0);
  limits.load = kKinds[choice(o, "load", {"static", "sudden", "resonant"}, "sudden")];
  o.finish();
  if ((limits.max_force > 0.0) != (limits.min_displacement > 0.0))
    throw InputError(o.where() + ": has only one of \"max_force\" and \"min_displacement\", expected both or none");
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
  o.for_each("bodies", [&](const Json& v, const std::string& where) { read_body(v, where, scene); });
  if (scene.bodies.empty()) refuse(o.where("bodies"), "[]", "at least one body");
  require_unique_names(scene);
  if (o.has("strikes"))
    o.for_each("strikes",
               [&](const Json& v, const std::string& w) { scene.strikes.push_back(read_strike(v, w, scene)); });
  if (o.has("forces"))
    o.for_each("forces", [&](const Json& v, const std::string& w) { scene.forces.push_back(read_force(v, w, scene)); });
  for (const Strike& s : scene.strikes) require_known_body(scene, s.body, s.where);
  for (const HeldForce& f : scene.forces) require_known_body(scene, f.body, f.where);
  o.finish();
  return scene;
}

Scene read_scene(const std::filesystem::path& path) {
  constexpr std::size_t kMaxBytes = std::size_t{64} << 20;
  Scene scene = parse_scene(read_file(path, kMaxBytes), "\"" + path.string() + "\"", path.parent_path());
  scene.name = path.stem().string();
  return scene;
}

}  // namespace limber
