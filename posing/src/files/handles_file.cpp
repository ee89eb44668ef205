#include "limber/posing/handles_file.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "files/part_division.h"
#include "limber/core/error.h"
#include "limber/core/file.h"

namespace limber {
namespace {

using internal::in_quotes;
using internal::JsonObject;
using internal::refuse;
using Json = nlohmann::json;

Vec3 read_point(const Json& value, const std::string& where) {
  const bool three = value.is_array() && value.size() == 3 &&
                     std::all_of(value.begin(), value.end(), [](const Json& x) { return x.is_number(); });
  const Vec3 p = three ? Vec3(value[0].get<double>(), value[1].get<double>(), value[2].get<double>()) : Vec3::Zero();
  if (!three || !p.allFinite()) refuse(where, JsonObject::shown(value), "three finite numbers");
  return p;
}

Subdivision read_subdivision(const JsonObject& o) {
  const std::string text = o.text("cells");
  if (text == "rigid") return Subdivision::kRigid;
  if (text == "uniform") return Subdivision::kUniform;
  if (text == "octree") return Subdivision::kOctree;
  refuse(o.where("cells"), in_quotes(text), "\"rigid\", \"uniform\" or \"octree\"");
}

PartOptions read_part(const Json& value, const std::string& where) {
  const JsonObject o(value, where);
  PartOptions out;
  out.cells = read_subdivision(o);
  out.cell_size = o.number("cell_size", out.cell_size);
  out.octree_levels = static_cast<int>(o.integer("octree_levels", 1, 6, out.octree_levels));
  out.stiffness = o.number("stiffness", out.stiffness);
  o.finish();
  try {
    out.validate();
  } catch (const InvalidArgument& e) {
    throw InputError(where + ": " + e.what());
  }
  return out;
}

HandlesFile::Handle read_handle(const std::string& name, const Json& value, const std::string& where) {
  const JsonObject o(value, where);
  HandlesFile::Handle out{.name = name, .part = o.text("part"), .point = o.vec3("point")};
  o.finish();
  return out;
}

/// @param index of the frame. @param rate frames per second where the file gives no time
HandlesFile::Frame read_frame(const Json& value, const std::string& where, const HandlesFile& file, double rate) {
  const JsonObject o(value, where);
  HandlesFile::Frame out;
  out.time = o.number("time", static_cast<double>(file.frames.size()) / rate);
  const double before = file.frames.empty() ? -1.0 : file.frames.back().time;
  if (out.time < 0.0 || out.time <= before)
    refuse(o.where("time"), std::to_string(out.time), "a time of 0 or later, after the frame before");
  const JsonObject targets(o.at("targets"), o.where("targets"));
  targets.for_each_member([&](const std::string& name, const Json& target) {
    std::vector<std::string> names;
    for (const auto& h : file.handles) names.push_back(h.name);
    const auto found = std::find(names.begin(), names.end(), name);
    if (found == names.end())
      throw InputError(targets.where() + ": there is no handle " + in_quotes(name) + "; the nearest is " +
                       in_quotes(internal::nearest_word(name, names)));
    out.targets.emplace_back(static_cast<std::size_t>(found - names.begin()), read_point(target, targets.where(name)));
  });
  o.finish();
  return out;
}

}  // namespace

PartDivision internal::read_division(const JsonObject& file) {
  PartDivision out;
  if (file.has("pinned"))
    file.for_each("pinned", [&](const Json& value, const std::string& where) {
      if (!value.is_string()) refuse(where, JsonObject::shown(value), "a part's name");
      out.pinned.push_back(value.get<std::string>());
    });
  if (file.has("parts"))
    JsonObject(file.at("parts"), file.where("parts")).for_each_member([&](const std::string& part, const Json& value) {
      out.parts.emplace_back(part, read_part(value, file.where("parts") + "." + part));
    });
  return out;
}

HandlesFile parse_handles(std::string_view text, const std::string& name) {
  const Json root = internal::parse_json(text, name);
  const JsonObject o(root, name);
  HandlesFile out;
  out.division = internal::read_division(o);
  JsonObject(o.at("handles"), o.where("handles")).for_each_member([&](const std::string& handle, const Json& value) {
    out.handles.push_back(read_handle(handle, value, o.where("handles") + "." + handle));
  });
  constexpr double kFramesPerSecond = 30.0;
  const double rate = o.number("frame_rate", kFramesPerSecond);
  if (!(rate > 0.0)) refuse(o.where("frame_rate"), std::to_string(rate), "a number > 0");
  o.for_each("frames", [&](const Json& value, const std::string& where) {
    out.frames.push_back(read_frame(value, where, out, rate));
  });
  if (out.frames.empty()) refuse(o.where("frames"), "[]", "at least one frame");
  o.finish();
  return out;
}

HandlesFile read_handles(const std::filesystem::path& path) {
  return parse_handles(read_file(path), "\"" + path.filename().string() + "\"");
}

std::vector<PoseHandle> apply_handles(const HandlesFile& file, const std::string& name, PosingSession& session) {
  const auto at = [&](const std::string& place, auto&& change) {
    try {
      return change();
    } catch (const InvalidArgument& e) {
      throw InputError(name + " " + place + ": " + e.what());
    }
  };
  const JointedModel& model = session.model();
  for (const auto& entry : file.division.parts)
    at("parts." + entry.first, [&] { session.set_part(model.part_named(entry.first), entry.second); });
  for (const std::string& part : file.division.pinned)
    at("pinned", [&] { session.set_pinned(model.part_named(part), true); });
  std::vector<PoseHandle> out;
  for (const HandlesFile::Handle& h : file.handles)
    out.push_back(at("handles." + h.name, [&] { return session.add_handle(model.part_named(h.part), h.point); }));
  return out;
}

}  // namespace limber
