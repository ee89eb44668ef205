#include "limber/internal/joint_spec_json.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/core/quaternion.h"

namespace limber::internal {
namespace {

// Limits -----------------------------------------------------------------------------------------------------------

double end_of(const nlohmann::json& value, const std::string& where, double open) {
  if (value.is_null()) return open;
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    refuse(where, JsonObject::shown(value), "a finite number, or null where it is open");
  return value.get<double>();
}

Interval interval_of(const nlohmann::json& value, const std::string& where) {
  constexpr double kOpen = std::numeric_limits<double>::infinity();
  if (!value.is_array() || value.size() != 2) refuse(where, JsonObject::shown(value), "[low, high]");
  const Interval i{end_of(value[0], where + "[0]", -kOpen), end_of(value[1], where + "[1]", kOpen)};
  if (i.low > i.high) refuse(where, JsonObject::shown(value), "[low, high] with the lower end first");
  return i;
}

template <std::size_t N>
std::array<Interval, N> intervals_of(const nlohmann::json& value, const std::string& where) {
  if (!value.is_array() || value.size() != N)
    refuse(where, JsonObject::shown(value), std::to_string(N) + " pairs [low, high]");
  std::array<Interval, N> out;
  for (std::size_t i = 0; i < N; ++i) out[i] = interval_of(value[i], where + "[" + std::to_string(i) + "]");
  return out;
}

/// A member of limits that a type has or has not.
bool limit_member(const JsonObject& o, const std::string& key, bool expected, JointType type) {
  if (!o.has(key)) return false;
  if (!expected)
    throw InputError(o.where(key) + ": a " + std::string(to_string(type)) + " joint has no such limit; remove it");
  return true;
}

// Type and frame ---------------------------------------------------------------------------------------------------

JointType read_joint_type(const JsonObject& o) {
  const std::string seen = o.text("type");
  if (const auto type = joint_type_of(seen)) return *type;
  refuse(o.where("type"), in_quotes(seen),
         "one of \"ball\", \"revolute\", \"cylindrical\", \"prismatic\", \"planar\", \"fixed\"");
}

/// Axes made orthonormal again: files carry numbers that people typed.
Mat3 read_joint_axes(const JsonObject& o) {
  constexpr double kTyped = 1e-3;
  const auto n = o.numbers("frame", 9);
  Mat3 m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = n[3 * static_cast<std::size_t>(r) + static_cast<std::size_t>(c)];
  if (!((m.transpose() * m - Mat3::Identity()).cwiseAbs().maxCoeff() <= kTyped) || !(m.determinant() > 0.0))
    throw InputError(o.where("frame") + ": its columns are not three unit vectors, right-handed and at right angles");
  constexpr double kExact = 1e-12;
  if ((m.transpose() * m - Mat3::Identity()).cwiseAbs().maxCoeff() <= kExact) return m;  // the same bits back
  const Vec3 x = m.col(0).normalized(), y = (m.col(1) - x.dot(m.col(1)) * x).normalized();
  m << x, y, x.cross(y);
  return m;
}

/// Axes with this direction as their column; the others are turned along by the least angle.
Mat3 turned_to(const Mat3& axes, int column, const Vec3& direction) {
  const Vec3 from = axes.col(column), across = from.cross(direction);
  const double sine = across.norm(), cosine = from.dot(direction);
  const Vec3 about = sine > 0.0 ? Vec3(across / sine) : Vec3(axes.col((column + 1) % 3));
  Mat3 out = to_matrix(quaternion_from_rotation_vector(std::atan2(sine, cosine) * about)) * axes;
  out.col(column) = direction;
  return out;
}

/// `axis` wins over `frame`: it is what people edit.
void read_joint_frame(const JsonObject& o, JointSpec& joint) {
  constexpr double kSame = 1e-9;
  joint.frame.origin = o.vec3("origin");
  if (o.has("frame")) joint.frame.axes = read_joint_axes(o);
  const auto column = axis_column(joint.type);
  if (!o.has("axis")) {
    if (column && !o.has("frame")) o.at("axis");  // told as missing
    return;
  }
  if (!column) {
    if (!o.at("axis").is_null())
      refuse(o.where("axis"), JsonObject::shown(o.at("axis")),
             "null: a " + std::string(to_string(joint.type)) + " joint has no axis");
    return;
  }
  const Vec3 axis = o.vec3("axis");
  if (!(axis.norm() > 0.0)) refuse(o.where("axis"), "[0, 0, 0]", "a direction of any length > 0");
  const Vec3 unit = axis.normalized();
  if ((unit - joint.frame.axes.col(*column)).norm() > kSame)
    joint.frame.axes = turned_to(joint.frame.axes, *column, unit);
}

// Writing ----------------------------------------------------------------------------------------------------------

using OrderedJson = nlohmann::ordered_json;

OrderedJson number_or_null(double x) { return std::isfinite(x) ? OrderedJson(x) : OrderedJson(); }
OrderedJson json_of(const Interval& i) { return OrderedJson::array({number_or_null(i.low), number_or_null(i.high)}); }
OrderedJson json_of(const Vec3& v) { return OrderedJson::array({v.x(), v.y(), v.z()}); }

OrderedJson json_of(const Mat3& m) {
  OrderedJson rows = OrderedJson::array();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) rows.push_back(m(r, c));
  return rows;
}

/// True if anything stops the joint.
bool limited(const JointSpec& joint) {
  const JointLimits& l = joint.limits;
  if (joint.type == JointType::kBall)
    return std::isfinite(l.cone) ||
           std::any_of(l.euler.begin(), l.euler.end(), [](const auto& i) { return !i.open(); });
  const bool turn = has_rotation(joint.type) && !l.rotation.open();
  const bool slide = has_translation(joint.type) && !l.translation[0].open();
  return turn || slide || (joint.type == JointType::kPlanar && !l.translation[1].open());
}

double at_least_zero(const JsonObject& o, const std::string& key, double otherwise) {
  const double x = o.number(key, otherwise);
  if (x < 0.0) refuse(o.where(key), JsonObject::shown(x), "a number >= 0");
  return x;
}

}  // namespace

bool has_rotation(JointType t) {
  return t == JointType::kRevolute || t == JointType::kCylindrical || t == JointType::kPlanar;
}
bool has_translation(JointType t) {
  return t == JointType::kPrismatic || t == JointType::kCylindrical || t == JointType::kPlanar;
}

std::optional<int> axis_column(JointType t) {
  if (t == JointType::kBall || t == JointType::kFixed) return std::nullopt;
  return t == JointType::kPlanar ? 2 : 0;
}

JointLimits read_joint_limits(const JsonObject& joint, JointType type) {
  JointLimits limits;
  if (joint.at("limits").is_null()) return limits;
  const JsonObject o(joint.at("limits"), joint.where("limits"));
  if (limit_member(o, "rotation", has_rotation(type), type))
    limits.rotation = interval_of(o.at("rotation"), o.where("rotation"));
  if (limit_member(o, "translation", has_translation(type), type)) {
    if (type == JointType::kPlanar)
      limits.translation = intervals_of<2>(o.at("translation"), o.where("translation"));
    else
      limits.translation[0] = interval_of(o.at("translation"), o.where("translation"));
  }
  const bool ball = type == JointType::kBall;
  if (limit_member(o, "cone", ball, type))
    limits.cone = end_of(o.at("cone"), o.where("cone"), std::numeric_limits<double>::infinity());
  if (limits.cone < 0.0) refuse(o.where("cone"), JsonObject::shown(limits.cone), "an angle >= 0");
  if (limit_member(o, "euler", ball, type)) limits.euler = intervals_of<3>(o.at("euler"), o.where("euler"));
  o.finish();
  return limits;
}

JointSpec read_joint_kind(const JsonObject& o) {
  JointSpec joint{.type = read_joint_type(o)};
  read_joint_frame(o, joint);
  joint.pitch = o.number("pitch", 0.0);
  if (joint.pitch != 0.0 && joint.type != JointType::kCylindrical)
    throw InputError(o.where("pitch") + ": a " + std::string(to_string(joint.type)) + " joint has no pitch; remove it");
  return joint;
}

JointActuation read_joint_actuation(const nlohmann::json& value, const std::string& where) {
  const JsonObject o(value, where);
  JointActuation a;
  if (o.has("motor")) {
    const JsonObject motor(o.at("motor"), o.where("motor"));
    a.motor_velocity = motor.number("velocity");
    a.motor_max_force = motor.number("max_force");
    if (!(a.motor_max_force > 0.0))
      refuse(motor.where("max_force"), JsonObject::shown(a.motor_max_force), "a number > 0");
    motor.finish();
  }
  if (o.has("drive")) {
    const JsonObject drive(o.at("drive"), o.where("drive"));
    a.drive_target = drive.number("target", 0.0);
    a.drive_stiffness = at_least_zero(drive, "stiffness", 0.0);
    a.drive_damping = at_least_zero(drive, "damping", 0.0);
    drive.finish();
  }
  a.friction = at_least_zero(o, "friction", 0.0);
  o.finish();
  return a;
}

std::vector<JointActuation> read_joint_coordinates(const JsonObject& o, JointType type) {
  std::vector<JointActuation> all;
  if (o.has("coordinates"))
    o.for_each("coordinates",
               [&](const nlohmann::json& v, const std::string& w) { all.push_back(read_joint_actuation(v, w)); });
  const auto most = static_cast<std::size_t>(freedoms(type).count());
  if (all.size() > most)
    refuse(o.where("coordinates"), "an array of " + std::to_string(all.size()) + " items",
           "at most " + std::to_string(most) + ", which a " + std::string(to_string(type)) + " joint has");
  return all;
}

void write_joint_kind(const JointSpec& joint, nlohmann::ordered_json& out) {
  const auto column = axis_column(joint.type);
  out["type"] = to_string(joint.type);
  out["origin"] = json_of(joint.frame.origin);
  out["axis"] = column ? json_of(Vec3(joint.frame.axes.col(*column))) : OrderedJson();
  out["frame"] = json_of(joint.frame.axes);
  if (joint.pitch != 0.0) out["pitch"] = joint.pitch;
}

nlohmann::ordered_json joint_limits_json(const JointSpec& joint) {
  if (!limited(joint)) return {};
  const JointLimits& l = joint.limits;
  OrderedJson out = OrderedJson::object();
  if (has_rotation(joint.type)) out["rotation"] = json_of(l.rotation);
  if (joint.type == JointType::kPlanar)
    out["translation"] = OrderedJson::array({json_of(l.translation[0]), json_of(l.translation[1])});
  else if (has_translation(joint.type))
    out["translation"] = json_of(l.translation[0]);
  if (joint.type == JointType::kBall) {
    out["cone"] = number_or_null(l.cone);
    out["euler"] = OrderedJson::array({json_of(l.euler[0]), json_of(l.euler[1]), json_of(l.euler[2])});
  }
  return out;
}

nlohmann::ordered_json joint_actuation_json(const JointActuation& a) {
  OrderedJson out = OrderedJson::object();
  if (a.motor_max_force > 0.0) out["motor"] = {{"velocity", a.motor_velocity}, {"max_force", a.motor_max_force}};
  if (a.drive_stiffness > 0.0 || a.drive_damping > 0.0)
    out["drive"] = {{"target", a.drive_target}, {"stiffness", a.drive_stiffness}, {"damping", a.drive_damping}};
  if (a.friction > 0.0) out["friction"] = a.friction;
  return out;
}

}  // namespace limber::internal
