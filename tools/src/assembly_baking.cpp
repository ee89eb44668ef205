#include "assembly_baking.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/core/error.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "limber/scene/scene_model.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

/// Of a part's diagonal: cells where none were asked for, and the patch that a joint of a file sits on.
constexpr double kCell = 1.0 / 20.0, kPatch = 0.15;

struct Joined {
  Assembly assembly;
  JointsFile joints;
  std::vector<double> patch_radii;  // in the file's unit; 0: not known
};

Joined detect(Program& program, const GroupedSurface& surface, ComponentRule rule, Jobs& jobs) {
  Joined joined{.assembly = find_components(surface, {.rule = rule}), .joints = {}, .patch_radii = {}};
  program.progress().stage("joints");
  std::vector<DetectedJoint> found = detect_joints(joined.assembly, {}, jobs);
  const std::vector<RangeOfMotion> ranges = ranges_of_motion(joined.assembly, found, {}, jobs);
  for (std::size_t i = 0; i < found.size(); ++i) {
    found[i].joint = ranges[i].joint;
    joined.patch_radii.push_back(found[i].influence.half_extents.norm());
  }
  joined.joints = joints_file(joined.assembly, found);
  return joined;
}

/// Components and joints as the file has them.
Joined take(Program& program, const GroupedSurface& surface, ComponentRule rule, const std::string& path) {
  program.add_input(path);
  Joined joined{.assembly = find_components(surface, {.rule = rule}), .joints = read_joints(path), .patch_radii = {}};
  ComponentOptions kept = kept_components(joined.assembly, joined.joints, "\"" + path + "\"");
  kept.rule = rule;
  joined.assembly = find_components(surface, kept);
  for (JointRecord& joint : joined.joints.joints) {
    for (Index* component : {&joint.a, &joint.b})
      *component =
          component_named(joined.assembly, joined.joints.components[static_cast<std::size_t>(*component)].name);
    if (!joint.limits_known)
      program.warnings().push_back("a joint of \"" + path +
                                   "\" has no limits: it goes on for ever; limber-joints --keep finds them");
    joined.patch_radii.push_back(0.0);
  }
  return joined;
}

bool is_rigid(const AssemblyOptions& options, const std::string& name) {
  return std::ranges::any_of(options.rigid, [&](const std::string& r) { return r == "*" || r == name; });
}

BakeResult bake_part(Program& program, const Component& part, const AssemblyOptions& options, BakeOptions bake_options,
                     Jobs& jobs) {
  const auto material = bake_options.materials.find(part.name);
  const auto rest = bake_options.materials.find("*");
  if (material == bake_options.materials.end() && rest == bake_options.materials.end())
    throw InputError("component \"" + part.name + "\" has no material; name it, or give \"*\" one");
  const Material of_part = material != bake_options.materials.end() ? material->second : rest->second;
  bake_options.materials = {{"*", of_part}};
  SurfaceMesh surface = bounding_surface(part);
  for (Vec3& p : surface.vertices) p *= options.scale;
  TetrahedralisationOptions tets = options.tets;
  if (tets.cell_size == 0.0) tets.cell_size = kCell * options.scale * part.diagonal;
  const bool rigid = is_rigid(options, part.name);
  if (rigid) bake_options.analysis.modes = 1, bake_options.analysis.certify = false;
  program.progress().stage("\"" + part.name + "\"");
  BakeInput input{.name = part.name};
  try {
    input.mesh = tetrahedralise(surface, tets, program.warnings()).mesh;
    input.render = std::move(surface);
    BakeResult result = bake(input, bake_options, program.warnings(), jobs);
    if (result.asset.bodies.size() != 1)
      throw ComputationError("its tets are " + std::to_string(result.asset.bodies.size()) + " pieces, expected one");
    if (rigid) result.asset.bodies[0] = reduce_model(*result.asset.bodies[0], {});
    return result;
  } catch (const ComputationError& e) {
    throw ComputationError("component \"" + part.name + "\": " + e.what());
  }
}

std::vector<std::string> grounded(const JointsFile& joints, const AssemblyOptions& options) {
  if (options.free) return {};
  return options.ground.empty() ? std::vector{joints.components.front().name} : options.ground;
}

/// Components that no chain of joints ties to one that stands still.
std::vector<std::string> fallers(const JointsFile& joints, const std::vector<std::string>& ground) {
  std::vector<bool> stands;
  for (const auto& part : joints.components) stands.push_back(std::ranges::find(ground, part.name) != ground.end());
  for (bool more = true; more;) {
    more = false;
    for (const JointRecord& joint : joints.joints) {
      const auto a = static_cast<std::size_t>(joint.a), b = static_cast<std::size_t>(joint.b);
      if (stands[a] == stands[b]) continue;
      stands[a] = stands[b] = more = true;
    }
  }
  std::vector<std::string> names;
  for (std::size_t i = 0; i < stands.size(); ++i)
    if (!stands[i]) names.push_back(joints.components[i].name);
  return names;
}

void scale_all(Json& numbers, double factor) {
  if (numbers.is_number()) numbers = factor * numbers.get<double>();
  if (numbers.is_array())
    for (Json& inside : numbers) scale_all(inside, factor);
}

/// Of a joint as files tell it.
void scale_lengths(Json& joint, double factor) {
  scale_all(joint["origin"], factor);
  if (joint.contains("pitch")) scale_all(joint["pitch"], factor);
  if (joint.contains("limits") && joint["limits"].contains("translation"))
    scale_all(joint["limits"]["translation"], factor);
}

}  // namespace

BakedAssembly bake_assembly(Program& program, const std::string& path, const AssemblyOptions& options,
                            const BakeOptions& bake_options, Jobs& jobs) {
  const GroupedSurface surface = read_any_grouped_surface(path, program.warnings());
  const Joined joined = options.joints_file.empty() ? detect(program, surface, options.components, jobs)
                                                    : take(program, surface, options.components, options.joints_file);
  for (const std::string& name : options.rigid)
    if (name != "*") component_named(joined.assembly, name);
  for (const std::string& name : options.ground) component_named(joined.assembly, name);
  BakedAssembly baked{.asset = {}, .bodies = {}, .joints = joined.joints, .patch_radii = {}};
  baked.joints.components.clear();  // in the assembly's order
  for (const Component& part : joined.assembly.components)
    baked.joints.components.push_back({.name = part.name, .faces = part.faces});
  for (const Component& part : joined.assembly.components) {
    BakeResult result = bake_part(program, part, options, bake_options, jobs);
    baked.asset.bodies.push_back(std::move(result.asset.bodies[0]));
    baked.bodies.push_back(std::move(result.bodies[0]));
  }
  const auto diagonal = [&](Index c) { return joined.assembly.components[static_cast<std::size_t>(c)].diagonal; };
  for (std::size_t i = 0; i < joined.joints.joints.size(); ++i) {
    const JointRecord& joint = joined.joints.joints[i];
    const double known = joined.patch_radii[i];
    baked.patch_radii.push_back(options.scale *
                                (known > 0.0 ? known : kPatch * std::min(diagonal(joint.a), diagonal(joint.b))));
  }
  if (!options.free)
    for (const std::string& name : fallers(baked.joints, grounded(baked.joints, options)))
      program.warnings().push_back("component \"" + name +
                                   "\" hangs on nothing that stands still and falls; --ground holds more of them");
  return baked;
}

std::string assembly_scene(const BakedAssembly& baked, const AssemblyOptions& options, const std::string& asset) {
  Json scene = {{"step", 1.0 / 60.0}, {"duration", 60}, {"assets", {{"machine", asset}}}};
  scene["joints"] = Json::array();
  const std::vector<std::string> ground = grounded(baked.joints, options);
  for (const auto& body : baked.asset.bodies) {
    const Vec3& p = body->data().origin_in_input;
    const Json place = {p.x(), p.y(), p.z()};
    scene["bodies"].push_back(
        {{"name", body->name()}, {"asset", "machine"}, {"part", body->name()}, {"position", place}});
    if (std::ranges::find(ground, body->name()) == ground.end()) continue;
    // By all of its surface.
    scene["joints"].push_back({{"b", body->name()},
                               {"type", "fixed"},
                               {"origin", place},
                               {"axis", nullptr},
                               {"patch_radius", 2.0 * body->collision_extent().radius}});
  }
  const Json told = Json::parse(joints_text(baked.joints));
  for (std::size_t i = 0; i < told["joints"].size(); ++i) {
    Json joint = told["joints"][i];
    for (const char* key : {"confidence", "alternatives", "reasons"}) joint.erase(key);
    for (const char* part : {"a", "b"}) joint[part] = told["components"][joint[part].get<std::size_t>()]["name"];
    scale_lengths(joint, options.scale);
    joint["patch_radius"] = baked.patch_radii[i];
    scene["joints"].push_back(joint);
  }
  return scene.dump(1) + "\n";
}

}  // namespace limber::tools
