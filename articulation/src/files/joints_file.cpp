#include "limber/articulation/joints_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "limber/core/error.h"
#include "limber/core/file.h"
#include "limber/internal/joint_spec_json.h"

namespace limber {
namespace {

using internal::in_quotes;
using internal::JsonObject;
using internal::refuse;
using Json = nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

constexpr Index kMaxIndex = std::numeric_limits<Index>::max();

std::string shown(double x) { return JsonObject::shown(Json(x)); }

// Writing -------------------------------------------------------------------------------------------------------------

OrderedJson alternative_json(const AlternativeRecord& a) {
  OrderedJson out;
  internal::write_joint_kind(a.joint, out);
  out["confidence"] = a.confidence;
  out["reason"] = a.reason;
  return out;
}

OrderedJson joint_json(const JointRecord& j) {
  OrderedJson out{{"a", j.a}, {"b", j.b}};
  internal::write_joint_kind(j.joint, out);
  if (j.limits_known) out["limits"] = internal::joint_limits_json(j.joint);
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

double read_confidence(const JsonObject& o) {
  const double c = o.number("confidence", 1.0);
  if (!(c >= 0.0 && c <= 1.0)) refuse(o.where("confidence"), shown(c), "a number from 0 to 1");
  return c;
}

AlternativeRecord read_alternative(const Json& value, const std::string& where) {
  const JsonObject o(value, where);
  AlternativeRecord a;
  a.joint = internal::read_joint_kind(o);
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
  j.joint = internal::read_joint_kind(o);
  j.limits_known = o.has("limits");
  if (j.limits_known) j.joint.limits = internal::read_joint_limits(o, j.joint.type);
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
    for (const JointHypothesis& h : j.other_hypotheses)
      record.alternatives.push_back({h.joint, h.confidence, h.reason});
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
