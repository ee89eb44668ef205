#include "reading/scene_reading.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

using Json = nlohmann::json;

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

}  // namespace

double positive(const JsonObject& o, const std::string& key) {
  const double x = o.number(key);
  if (!(x > 0.0)) refuse(o.where(key), JsonObject::shown(x), "a number > 0");
  return x;
}

double positive(const JsonObject& o, const std::string& key, double otherwise) {
  return o.has(key) ? positive(o, key) : otherwise;
}

double non_negative(const JsonObject& o, const std::string& key, double otherwise) {
  const double x = o.number(key, otherwise);
  if (x < 0.0) refuse(o.where(key), JsonObject::shown(x), "a number >= 0");
  return x;
}

Vec3 vector_of(const Json& value, const std::string& where) {
  const bool numbers = value.is_array() && value.size() == 3 &&
                       std::all_of(value.begin(), value.end(),
                                   [](const Json& x) { return x.is_number() && std::isfinite(x.get<double>()); });
  if (!numbers) refuse(where, JsonObject::shown(value), "an array of 3 numbers");
  return {value[0].get<double>(), value[1].get<double>(), value[2].get<double>()};
}

Vec3 direction_of(const Json& value, const std::string& where) {
  const Vec3 v = vector_of(value, where);
  if (!(v.norm() > 0.0)) refuse(where, "[0, 0, 0]", "a direction of any length > 0");
  return v / v.norm();
}

Vec3 direction(const JsonObject& o, const std::string& key) { return direction_of(o.at(key), o.where(key)); }

double time_inside(const JsonObject& o, const std::string& key, const Scene& scene) {
  const double t = o.number(key);
  if (!(t >= 0.0 && t < scene.duration()))
    refuse(o.where(key), JsonObject::shown(t),
           "a time within the scene's duration, [0, " + JsonObject::shown(scene.duration()) + ") s");
  return t;
}

double held_duration(const JsonObject& o, const Scene& scene, const std::string& otherwise) {
  const double duration = positive(o, "duration", kToTheEnd);
  if (duration < scene.step)
    refuse(o.where("duration"), JsonObject::shown(duration),
           "at least one step, " + JsonObject::shown(scene.step) + " s" + otherwise);
  return duration;
}

std::size_t choice(const JsonObject& o, const std::string& key, const std::vector<std::string>& words,
                   const std::string& otherwise) {
  const std::string seen = o.text(key, otherwise);
  const auto found = std::find(words.begin(), words.end(), seen);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  std::string list;
  for (const auto& w : words) list += (list.empty() ? "\"" : ", \"") + w + "\"";
  refuse(o.where(key), in_quotes(seen), "one of " + list);
}

void check_input(const std::string& where, const std::function<void()>& check) {
  try {
    check();
  } catch (const InvalidArgument& e) {
    throw InputError(where + ": " + e.what());
  }
}

RigidTransform read_pose(const JsonObject& o) { return {read_orientation(o), o.vec3("position", Vec3::Zero())}; }

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

namespace {

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

std::vector<PoseKey> read_keys(const JsonObject& motion, bool turns) {
  std::vector<PoseKey> keys;
  motion.for_each("keys", [&](const Json& value, const std::string& where) {
    const JsonObject o(value, where);
    keys.push_back(
        {.time = non_negative(o, "time", 0.0), .pose = turns ? read_pose(o) : RigidTransform{{}, o.vec3("position")}});
    o.finish();
    if (keys.size() > 1 && !(keys.back().time > keys[keys.size() - 2].time))
      refuse(where + ".time", JsonObject::shown(keys.back().time), "a time after the key before it");
  });
  if (keys.empty()) refuse(motion.where("keys"), "[]", "at least one key");
  return keys;
}

}  // namespace

FrameMovement read_movement(const JsonObject& parent, bool turns) {
  if (!parent.has("motion")) return {};
  const JsonObject o(parent.at("motion"), parent.where("motion"));
  const bool shake = o.has("shake"), keys = o.has("keys");
  if (shake == keys) refuse(o.where(), JsonObject::shown(parent.at("motion")), "one of \"shake\" and \"keys\"");
  FrameMovement movement;
  if (shake) movement = read_shake(JsonObject(o.at("shake"), o.where("shake")));
  if (keys) movement = read_keys(o, turns);
  o.finish();
  return movement;
}

}  // namespace limber::internal
