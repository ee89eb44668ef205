#include "limber/articulation/joints_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "limber/core/error.h"
#include "limber/core/quaternion.h"
#include "limber/internal/strict_json.h"

namespace limber {
namespace {

using internal::in_quotes;
using internal::JsonObject;
using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Index kMaxIndex = std::numeric_limits<Index>::max();

[[noreturn]] void refuse(const std::string& where, const std::string& seen, const std::string& expected) {
  throw InputError(where + ": is " + seen + ", expected " + expected);
}

std::string shown(double x) { return JsonObject::shown(Json(x)); }

// Members of limits that each type has -----------------------------------------------------------------------------

bool has_rotation(JointType t) {
  return t == JointType::kRevolute || t == JointType::kCylindrical || t == JointType::kPlanar;
}
bool has_translation(JointType t) {
  return t == JointType::kPrismatic || t == JointType::kCylindrical || t == JointType::kPlanar;
}

/// The column of the frame that `axis` repeats: x, or z for planar; none for ball and fixed.
std::optional<int> axis_column(JointType t) {
  if (t == JointType::kBall || t == JointType::kFixed) return std::nullopt;
  return t == JointType::kPlanar ? 2 : 0;
}

// Writing -------------------------------------------------------------------------------------------------------------

OrderedJson number_or_null(double x) { return std::isfinite(x) ? OrderedJson(x) : OrderedJson(); }
OrderedJson json_of(const Interval& i) { return OrderedJson::array({number_or_null(i.low), number_or_null(i.high)}); }
OrderedJson json_of(const Vec3& v) { return OrderedJson::array({v.x(), v.y(), v.z()}); }

OrderedJson json_of(const Mat3& m) {
  OrderedJson rows = OrderedJson::array();
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) rows.push_back(m(r, c));
  return rows;
}

OrderedJson axis_json(const JointSpec& joint) {
  const auto column = axis_column(joint.type);
  return column ? json_of(Vec3(joint.frame.axes.col(*column))) : OrderedJson();
}

/// Whether anything stops the joint.
bool limited(const JointSpec& joint) {
  const JointLimits& l = joint.limits;
  if (joint.type == JointType::kBall)
    return std::isfinite(l.cone) ||
           std::any_of(l.euler.begin(), l.euler.end(), [](const auto& i) { return !i.open(); });
  const bool turn = has_rotation(joint.type) && !l.rotation.open();
  const bool slide = has_translation(joint.type) && !l.translation[0].open();
  return turn || slide || (joint.type == JointType::kPlanar && !l.translation[1].open());
}

OrderedJson limits_json(const JointSpec& joint) {
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

OrderedJson alternative_json(const AlternativeRecord& a) {
  OrderedJson out{{"type", to_string(a.joint.type)},
                  {"origin", json_of(a.joint.frame.origin)},
                  {"axis", axis_json(a.joint)},
                  {"frame", json_of(a.joint.frame.axes)}};
  if (a.joint.pitch != 0.0) out["pitch"] = a.joint.pitch;
  out["confidence"] = a.confidence;
  out["reason"] = a.reason;
  return out;
}

OrderedJson joint_json(const JointRecord& j) {
  OrderedJson out{{"a", j.a},
                  {"b", j.b},
                  {"type", to_string(j.joint.type)},
                  {"origin", json_of(j.joint.frame.origin)},
                  {"axis", axis_json(j.joint)},
                  {"frame", json_of(j.joint.frame.axes)}};
  if (j.joint.pitch != 0.0) out["pitch"] = j.joint.pitch;
  if (j.limits_known) out["limits"] = limits_json(j.joint);
  out["confidence"] = j.confidence;
  out["alternatives"] = OrderedJson::array();
  for (const AlternativeRecord& a : j.alternatives) out["alternatives"].push_back(alternative_json(a));
  out["reasons"] = j.reasons;
  return out;
}

OrderedJson component_json(const ComponentRecord& c) {
  OrderedJson faces = OrderedJson::array();
  for (const FaceRange& f : c.faces) faces.push_back(OrderedJson::array({f.first, f.count}));
  return {{"name", c.name}, {"faces", faces}};
}

std::string line(const OrderedJson& value) { return value.dump(-1, ' ', false, OrderedJson::error_handler_t::replace); }

/// A list of objects; `by_key`: each key on a line of its own, for people to edit.
std::string list_text(const std::vector<OrderedJson>& items, bool by_key) {
  std::string text = "[";
  for (std::size_t i = 0; i < items.size(); ++i) {
    text += i == 0 ? "\n" : ",\n";
    if (!by_key) {
      text += "  " + line(items[i]);
      continue;
    }
    std::string members;
    for (const auto& [key, value] : items[i].items())
      members += std::string(members.empty() ? "" : ",") + "\n   \"" + key + "\": " + line(value);
    text += "  {" + members + "\n  }";
  }
  return text + (items.empty() ? "]" : "\n ]");
}

// Reading -------------------------------------------------------------------------------------------------------------

double end_of(const Json& value, const std::string& where, double open) {
  if (value.is_null()) return open;
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    refuse(where, JsonObject::shown(value), "a finite number, or null where it is open");
  return value.get<double>();
}

Interval interval_of(const Json& value, const std::string& where) {
  if (!value.is_array() || value.size() != 2) refuse(where, JsonObject::shown(value), "[low, high]");
  const Interval i{end_of(value[0], where + "[0]", -kInfinity), end_of(value[1], where + "[1]", kInfinity)};
  if (i.low > i.high) refuse(where, JsonObject::shown(value), "[low, high] with the lower end first");
  return i;
}

template <std::size_t N>
std::array<Interval, N> intervals_of(const Json& value, const std::string& where) {
  if (!value.is_array() || value.size() != N)
    refuse(where, JsonObject::shown(value), std::to_string(N) + " pairs [low, high]");
  std::array<Interval, N> out;
  for (std::size_t i = 0; i < N; ++i) out[i] = interval_of(value[i], where + "[" + std::to_string(i) + "]");
  return out;
}

/// A member of limits that a type has or has not.
bool member(const JsonObject& o, const std::string& key, bool expected, JointType type) {
  if (!o.has(key)) return false;
  if (!expected)
    throw InputError(o.where(key) + ": a " + std::string(to_string(type)) + " joint has no such limit; remove it");
  return true;
}

JointLimits read_limits(const JsonObject& joint, JointType type) {
  JointLimits limits;
  if (joint.at("limits").is_null()) return limits;
  const JsonObject o(joint.at("limits"), joint.where("limits"));
  if (member(o, "rotation", has_rotation(type), type))
    limits.rotation = interval_of(o.at("rotation"), o.where("rotation"));
  if (member(o, "translation", has_translation(type), type)) {
    if (type == JointType::kPlanar)
      limits.translation = intervals_of<2>(o.at("translation"), o.where("translation"));
    else
      limits.translation[0] = interval_of(o.at("translation"), o.where("translation"));
  }
  const bool ball = type == JointType::kBall;
  if (member(o, "cone", ball, type)) limits.cone = end_of(o.at("cone"), o.where("cone"), kInfinity);
  if (limits.cone < 0.0) refuse(o.where("cone"), shown(limits.cone), "an angle >= 0");
  if (member(o, "euler", ball, type)) limits.euler = intervals_of<3>(o.at("euler"), o.where("euler"));
  o.finish();
  return limits;
}

JointType read_type(const JsonObject& o) {
  const std::string seen = o.text("type");
  if (const auto type = joint_type_of(seen)) return *type;
  refuse(o.where("type"), in_quotes(seen),
         "one of \"ball\", \"revolute\", \"cylindrical\", \"prismatic\", \"planar\", \"fixed\"");
}

/// Axes made orthonormal again: files carry numbers that people typed.
Mat3 read_axes(const JsonObject& o) {
  constexpr double kTyped = 1e-3;
  const auto n = o.numbers("frame", 9);
  Mat3 m;
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) m(r, c) = n[static_cast<std::size_t>(3 * r + c)];
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
void read_frame(const JsonObject& o, JointSpec& joint) {
  constexpr double kSame = 1e-9;
  joint.frame.origin = o.vec3("origin");
  if (o.has("frame")) joint.frame.axes = read_axes(o);
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

double read_confidence(const JsonObject& o) {
  const double c = o.number("confidence", 1.0);
  if (!(c >= 0.0 && c <= 1.0)) refuse(o.where("confidence"), shown(c), "a number from 0 to 1");
  return c;
}

void read_kind(const JsonObject& o, JointSpec& joint) {
  joint.type = read_type(o);
  read_frame(o, joint);
  joint.pitch = o.number("pitch", 0.0);
  if (joint.pitch != 0.0 && joint.type != JointType::kCylindrical)
    throw InputError(o.where("pitch") + ": a " + std::string(to_string(joint.type)) + " joint has no pitch; remove it");
}

AlternativeRecord read_alternative(const Json& value, const std::string& where) {
  const JsonObject o(value, where);
  AlternativeRecord a;
  read_kind(o, a.joint);
  a.confidence = read_confidence(o);
  a.reason = o.text("reason", "");
  o.finish();
  return a;
}

JointRecord read_joint(const Json& value, const std::string& where, Index components) {
  const JsonObject o(value, where);
  JointRecord j;
  j.a = static_cast<Index>(o.integer("a", 0, components - 1));
  j.b = static_cast<Index>(o.integer("b", 0, components - 1));
  if (j.a == j.b) refuse(o.where("b"), std::to_string(j.b), "another component than \"a\"");
  read_kind(o, j.joint);
  j.limits_known = o.has("limits");
  if (j.limits_known) j.joint.limits = read_limits(o, j.joint.type);
  j.confidence = read_confidence(o);
  if (o.has("alternatives"))
    o.for_each("alternatives",
               [&](const Json& v, const std::string& w) { j.alternatives.push_back(read_alternative(v, w)); });
  if (o.has("reasons"))
    o.for_each("reasons", [&](const Json& v, const std::string& w) {
      if (!v.is_string()) refuse(w, JsonObject::shown(v), "text");
      j.reasons.push_back(v.get<std::string>());
    });
  o.finish();
  return j;
}

FaceRange read_faces(const Json& value, const std::string& where) {
  const bool pair =
      value.is_array() && value.size() == 2 && value[0].is_number_integer() && value[1].is_number_integer();
  if (!pair) refuse(where, JsonObject::shown(value), "[first, count]");
  const auto first = value[0].get<std::int64_t>(), count = value[1].get<std::int64_t>();
  if (first < 0 || count < 1 || first > kMaxIndex || count > kMaxIndex - first)
    refuse(where, JsonObject::shown(value), "[first >= 0, count >= 1]");
  return {static_cast<Index>(first), static_cast<Index>(count)};
}

ComponentRecord read_component(const Json& value, const std::string& where) {
  const JsonObject o(value, where);
  ComponentRecord c{.name = o.text("name"), .faces = {}};
  if (c.name.empty()) refuse(o.where("name"), "\"\"", "a name");
  o.for_each("faces", [&](const Json& v, const std::string& w) { c.faces.push_back(read_faces(v, w)); });
  if (c.faces.empty()) refuse(o.where("faces"), "[]", "at least one range [first, count]");
  std::sort(c.faces.begin(), c.faces.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  o.finish();
  return c;
}

void require_distinct(const std::vector<ComponentRecord>& components, const std::string& name) {
  std::set<std::string> names;
  struct Owned {
    FaceRange range;
    const std::string* owner;
  };
  std::vector<Owned> all;
  for (const ComponentRecord& c : components) {
    if (!names.insert(c.name).second)
      throw InputError(name + " components: the name " + in_quotes(c.name) + " stands twice");
    for (const FaceRange& f : c.faces) all.push_back({f, &c.name});
  }
  std::sort(all.begin(), all.end(), [](const Owned& a, const Owned& b) { return a.range.first < b.range.first; });
  for (std::size_t i = 1; i < all.size(); ++i)
    if (all[i].range.first < all[i - 1].range.first + all[i - 1].range.count)
      throw InputError(name + " components: face " + std::to_string(all[i].range.first) + " belongs to " +
                       in_quotes(*all[i - 1].owner) + " and to " + in_quotes(*all[i].owner));
}

// Keeping -------------------------------------------------------------------------------------------------------------

std::pair<Index, Index> pair_of(Index a, Index b) { return std::minmax({a, b}); }

/// Component of `kept` that holds all faces of `c`; −1 if none holds any.
Index owner_of(const Component& c, const std::map<Index, std::pair<Index, Index>>& by_first,
               const std::string& message) {
  Index owner = -2;
  for (const FaceRange& range : c.faces)
    for (Index face = range.first; face < range.first + range.count;) {
      // The range of the file that holds this face, or where the next one begins.
      auto next = by_first.upper_bound(face);
      Index found = -1, end = next == by_first.end() ? kMaxIndex : next->first;
      if (next != by_first.begin()) {
        const auto& [last, component] = std::prev(next)->second;
        if (face < last) found = component, end = last;
      }
      if (owner != -2 && found != owner) throw InputError(message);
      owner = found;
      face = std::min(end, range.first + range.count);
    }
  return std::max(owner, Index{-1});
}

}  // namespace

JointsFile joints_file(const Assembly& assembly, const std::vector<DetectedJoint>& joints) {
  JointsFile file;
  for (const Component& c : assembly.components) file.components.push_back({c.name, c.faces});
  for (const DetectedJoint& j : joints) {
    JointRecord record{.a = j.a, .b = j.b, .joint = j.joint, .confidence = j.confidence, .reasons = j.reasons};
    for (const JointHypothesis& h : j.alternatives) record.alternatives.push_back({h.joint, h.confidence, h.reason});
    file.joints.push_back(std::move(record));
  }
  return file;
}

std::string joints_text(const JointsFile& file) {
  std::vector<OrderedJson> components, joints;
  for (const ComponentRecord& c : file.components) components.push_back(component_json(c));
  for (std::size_t j = 0; j < file.joints.size(); ++j) {
    try {
      file.joints[j].joint.validate();
    } catch (const InvalidArgument& e) {
      throw InvalidArgument("joints_text: joint " + std::to_string(j) + ": " + e.what());
    }
    joints.push_back(joint_json(file.joints[j]));
  }
  return "{\"components\": " + list_text(components, false) + ",\n \"joints\": " + list_text(joints, true) + "}\n";
}

JointsFile parse_joints(std::string_view text, const std::string& name) {
  const Json document = internal::parse_json(text, name);
  const JsonObject o(document, name);
  JointsFile file;
  o.for_each("components",
             [&](const Json& v, const std::string& w) { file.components.push_back(read_component(v, w)); });
  require_distinct(file.components, name);
  std::map<std::pair<Index, Index>, std::string> pairs;
  o.for_each("joints", [&](const Json& v, const std::string& w) {
    file.joints.push_back(read_joint(v, w, static_cast<Index>(file.components.size())));
    const auto [entry, fresh] = pairs.try_emplace(pair_of(file.joints.back().a, file.joints.back().b), w);
    if (!fresh)
      throw InputError(w + ": joins the same two components as " + entry->second + ", expected one joint per pair");
  });
  o.finish();
  return file;
}

JointsFile read_joints(const std::filesystem::path& path) {
  return parse_joints(read_file(path, std::size_t{256} << 20), "\"" + path.string() + "\"");
}

ComponentOptions kept_components(const Assembly& found, const JointsFile& kept, const std::string& name) {
  std::map<Index, std::pair<Index, Index>> by_first;  // first face → one past the last, component of the file
  for (std::size_t k = 0; k < kept.components.size(); ++k)
    for (const FaceRange& f : kept.components[k].faces) by_first[f.first] = {f.first + f.count, static_cast<Index>(k)};
  std::vector<std::vector<std::string>> parts(kept.components.size());
  for (const Component& c : found.components) {
    const Index owner = owner_of(c, by_first,
                                 name + ": splits the component " + in_quotes(c.name) +
                                     " of the model between parts; parts can be merged, not split");
    if (owner >= 0) parts[static_cast<std::size_t>(owner)].push_back(c.name);
  }
  ComponentOptions options;
  for (std::size_t k = 0; k < parts.size(); ++k) {
    if (parts[k].empty())
      throw InputError(name + ": the model has no faces of the component " + in_quotes(kept.components[k].name) +
                       "; is it another model's file?");
    if (parts[k].size() > 1) options.merge.push_back(parts[k]);
    if (parts[k].front() != kept.components[k].name)
      options.rename.emplace_back(parts[k].front(), kept.components[k].name);
  }
  return options;
}

std::vector<bool> keep_joints(const Assembly& assembly, const JointsFile& kept, const std::string& name,
                              std::vector<DetectedJoint>& joints) {
  std::vector<Index> here;  // component of the assembly, per component of the file
  for (const ComponentRecord& c : kept.components) {
    const auto same = [&](const Component& other) { return other.name == c.name; };
    const auto found = std::find_if(assembly.components.begin(), assembly.components.end(), same);
    if (found == assembly.components.end())
      throw InputError(name + ": the model has no component " + in_quotes(c.name));
    here.push_back(static_cast<Index>(found - assembly.components.begin()));
  }
  const std::set<Index> listed(here.begin(), here.end());
  std::map<std::pair<Index, Index>, DetectedJoint> found;
  for (DetectedJoint& j : joints) found.emplace(pair_of(j.a, j.b), std::move(j));
  std::map<std::pair<Index, Index>, std::pair<DetectedJoint, bool>> out;
  for (const JointRecord& record : kept.joints) {
    const Index a = here[static_cast<std::size_t>(record.a)], b = here[static_cast<std::size_t>(record.b)];
    const auto detected = found.find(pair_of(a, b));
    DetectedJoint j = detected != found.end() ? detected->second : DetectedJoint{};
    j.reasons.push_back(detected == found.end() ? "Added by the file that was kept."
                        : j.joint.type == record.joint.type
                            ? "As the file that was kept has it."
                            : "The file that was kept says " + std::string(to_string(record.joint.type)) +
                                  "; found was " + std::string(to_string(j.joint.type)) + ".");
    if (detected == found.end()) j.confidence = record.confidence;
    j.a = a, j.b = b;
    j.joint = record.joint;
    out.insert_or_assign(pair_of(a, b), std::pair(std::move(j), record.limits_known));
  }
  for (auto& [pair, j] : found)
    if (!listed.contains(pair.first) || !listed.contains(pair.second))
      out.try_emplace(pair, std::pair(std::move(j), false));
  std::vector<bool> limits_kept;
  joints.clear();
  for (auto& [pair, entry] : out) {
    joints.push_back(std::move(entry.first));
    limits_kept.push_back(entry.second);
  }
  return limits_kept;
}

}  // namespace limber
