#include "asset_machine.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "asset_format.h"
#include "limber/core/error.h"
#include "limber/internal/joint_spec_json.h"

namespace limber::internal {
namespace {

using nlohmann::json;
using OrderedJson = nlohmann::ordered_json;

OrderedJson joint_block(const AssetJoint& joint) {
  OrderedJson out = {{"a", joint.a == AssetJoint::kWorld ? OrderedJson() : OrderedJson(joint.a)}, {"b", joint.b}};
  write_joint_kind(joint.spec, out);
  out["limits"] = joint_limits_json(joint.spec);
  out["patch_radius"] = joint.patch_radius;
  out["collide"] = joint.collide;
  out["coordinates"] = OrderedJson::array();
  for (const JointActuation& a : joint.coordinates) out["coordinates"].push_back(joint_actuation_json(a));
  return out;
}

AssetJoint read_joint(const json& value, const std::string& where, Index bodies) {
  const JsonObject o(value, where);
  AssetJoint joint;
  joint.a = o.at("a").is_null() ? AssetJoint::kWorld : static_cast<Index>(o.integer("a", 0, bodies - 1));
  joint.b = static_cast<Index>(o.integer("b", 0, bodies - 1));
  if (joint.a == joint.b) refuse(o.where("b"), std::to_string(joint.b), "another body than \"a\"");
  joint.spec = read_joint_kind(o);
  joint.spec.limits = read_joint_limits(o, joint.spec.type);
  joint.patch_radius = o.number("patch_radius");
  if (joint.patch_radius < 0.0) refuse(o.where("patch_radius"), JsonObject::shown(joint.patch_radius), "a length >= 0");
  joint.collide = o.boolean("collide", false);
  joint.coordinates = read_joint_coordinates(o, joint.spec.type);
  o.finish();
  try {
    joint.spec.validate();
  } catch (const InvalidArgument& e) {
    throw InputError(where + ": " + e.what());
  }
  return joint;
}

std::array<Index, 2> read_pair(const json& value, const std::string& where, Index bodies) {
  const auto number = [&](const json& x) {
    return x.is_number_integer() && x.get<std::int64_t>() >= 0 && x.get<std::int64_t>() < bodies;
  };
  if (!value.is_array() || value.size() != 2 || !number(value[0]) || !number(value[1]) || value[0] == value[1])
    refuse(where, JsonObject::shown(value), "two bodies of the asset, by their numbers");
  return {value[0].get<Index>(), value[1].get<Index>()};
}

}  // namespace

json machine_block(const Asset& asset) {
  json block = {{"version", asset_format::kMachineVersion}, {"joints", json::array()}, {"apart", asset.apart}};
  for (const AssetJoint& joint : asset.joints) block["joints"].push_back(json(joint_block(joint)));
  return block;
}

void read_machine(const json& value, const std::string& where, Index bodies, Asset& asset) {
  const JsonObject block(value, where);
  const std::int64_t version = block.integer("version", 1, std::numeric_limits<Index>::max());
  if (version != asset_format::kMachineVersion)
    throw InputError(block.where("version") + ": is " + std::to_string(version) + ", this limber reads version " +
                     std::to_string(asset_format::kMachineVersion));
  block.for_each("joints",
                 [&](const json& v, const std::string& w) { asset.joints.push_back(read_joint(v, w, bodies)); });
  block.for_each("apart", [&](const json& v, const std::string& w) { asset.apart.push_back(read_pair(v, w, bodies)); });
  block.finish();
  if (asset.joints.empty() && asset.apart.empty())
    refuse(where, JsonObject::shown(value), "joints or pairs, or no such block");
}

}  // namespace limber::internal
