#include "assembly_baking.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "limber/articulation/contact_region.h"
#include "limber/articulation/detect_joints.h"
#include "limber/articulation/range_of_motion.h"
#include "limber/collision/rigid_model.h"
#include "limber/core/error.h"
#include "limber/mesh/closed_shells.h"
#include "limber/mesh/mend_surface.h"
#include "limber/mesh_assimp/read_surface_mesh.h"
#include "limber/scene/scene_model.h"
#include "precompute_input.h"

namespace limber::tools {
namespace {

using Json = nlohmann::ordered_json;

/// Parts of a part's diagonal: cells where none were asked for, and the patch that a joint of a file sits on.
constexpr double kCell = 1.0 / 20.0, kPatch = 0.15;

struct Joined {
  Assembly assembly;
  JointsFile joints;
  std::vector<double> patch_radii;  // in the file's unit; 0: not known
};

/// The file's groups, where it names two or more and none cuts through a shell; else what shares vertices.
Assembly take_apart(Program& program, const GroupedSurface& surface) {
  Assembly shells = find_components(surface);
  std::vector<Index> group_of(surface.surface.triangles.size());
  std::set<std::string> names;
  for (std::size_t g = 0; g < surface.groups.size(); ++g) {
    names.insert(surface.groups[g].name);
    std::fill_n(group_of.begin() + surface.groups[g].first, surface.groups[g].count, static_cast<Index>(g));
  }
  const auto name_of = [&](Index triangle) -> const std::string& {
    return surface.groups[static_cast<std::size_t>(group_of[static_cast<std::size_t>(triangle)])].name;
  };
  const auto whole = [&](const Component& shell) {
    return std::ranges::all_of(shell.triangles,
                               [&](Index t) { return name_of(t) == name_of(shell.triangles.front()); });
  };
  if (names.size() < 2 || names.contains("") || names.size() == shells.components.size() ||
      !std::ranges::all_of(shells.components, whole))
    return shells;
  program.print(
      fmt::format("components: the file's {} groups, drawn in {} shells\n", names.size(), shells.components.size()));
  return find_components(surface, {.rule = ComponentRule::kGroups});
}

Joined detect(Program& program, const GroupedSurface& surface, std::optional<ComponentRule> rule, Jobs& jobs) {
  Joined joined{.assembly = rule ? find_components(surface, {.rule = *rule}) : take_apart(program, surface),
                .joints = {},
                .patch_radii = {}};
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

/// A part that does not bend, from its surface alone; nothing where that, mended, bounds no solid.
std::optional<BakeResult> rigid_part(const std::string& name, SurfaceMesh surface, double density) {
  if (!surface_quality(surface).closed_manifold()) mend_surface(surface, weld_tolerance(surface));
  if (surface_quality(surface).closed_manifold())
    turn_shells_outward(surface);
  else if (!boundary_of(surface).empty() || !(enclosed_volume(surface) > 0.0))
    return std::nullopt;
  const MassProperties mass = mass_properties(TriangleMesh{surface.vertices, surface.triangles}, density);
  ModalModelData data;
  data.name = name;
  data.volume = mass.mass / density;
  data.mass = mass.mass;
  data.inertia = mass.inertia;
  data.origin_in_input = mass.center_of_mass;
  for (const Vec3& p : surface.vertices) data.render.rest.push_back((p - mass.center_of_mass).cast<float>());
  data.render.basis = ModalBasis(static_cast<Index>(surface.vertices.size()), 0);
  data.render.triangles = std::move(surface.triangles);
  BodyReport report;
  report.name = name;
  report.solid = {
      .mass = mass.mass, .volume = data.volume, .center_of_mass = mass.center_of_mass, .inertia = mass.inertia};
  report.freedom.rigid_modes = 6;
  report.modes.all = true;
  BakeResult result;
  result.asset.bodies.push_back(std::make_shared<const ModalModel>(std::move(data)));
  result.asset.frequency_errors.emplace_back();
  result.bodies.push_back(std::move(report));
  return result;
}

/// @param patches where its joints sit
BakeResult bake_part(Program& program, const Component& part, const AssemblyOptions& options, BakeOptions bake_options,
                     std::vector<AttachmentPatch> patches, Jobs& jobs) {
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
  if (rigid && bake_options.collision_triangles == 0)
    if (auto made = rigid_part(part.name, surface, of_part.density)) return std::move(*made);
  if (rigid)
    bake_options.analysis.modes = 1, bake_options.analysis.certify = false;
  else if (options.joint_compliance)
    bake_options.residual.patches = std::move(patches);
  program.progress().stage("\"" + part.name + "\"");
  BakeInput input{.name = part.name};
  try {
    input.mesh = tetrahedralise(surface, tets, program.warnings()).mesh;
    input.render = std::move(surface);
    BakeResult result = bake(input, bake_options, program.warnings(), jobs);
    if (result.asset.bodies.size() != 1)
      throw ComputationError("its tets are " + std::to_string(result.asset.bodies.size()) + " pieces, expected one");
    if (rigid) {
      make_rigid(result.asset, 0);
      result.bodies[0].modes.frequency_errors.clear();
    }
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

/// "a", "b" and "c"
std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " and " : ", ") + names[i];
  return text;
}

/// @param option that names it @throws Error if the file has no such component
template <class Error>
void check_name(const std::string& path, const Assembly& assembly, const std::string& option, const std::string& name) {
  std::vector<std::string> names;
  for (const Component& part : assembly.components) {
    if (part.name == name) return;
    names.push_back("\"" + part.name + "\"");
  }
  throw Error(option + ": \"" + path + "\" has no component \"" + name + "\", expected one of " + listed(names));
}

void warn_of_fallers(const JointsFile& joints, const std::vector<std::string>& ground, Warnings& warnings) {
  std::vector<std::string> names;
  for (const std::string& name : fallers(joints, ground)) names.push_back("\"" + name + "\"");
  if (names.empty()) return;
  warnings.push_back(
      (names.size() == 1 ? "component " + names[0] + " hangs" : "components " + listed(names) + " hang") +
      " on nothing that stands still and will fall; hold parts by --ground NAME, or give the joints that "
      "are missing by --joints");
}

/// Parts that run off what they slide on.
void warn_of_open_slides(const JointsFile& joints, Warnings& warnings) {
  std::vector<std::string> names;
  for (const JointRecord& joint : joints.joints) {
    const bool slides = joint.joint.type == JointType::kPrismatic ||
                        (joint.joint.type == JointType::kCylindrical && joint.joint.pitch == 0.0);
    const Interval& way = joint.joint.limits.translation[0];
    if (!slides || !joint.limits_known || way.bounded()) continue;
    const auto name = [&](Index i) { return "\"" + joints.components[static_cast<std::size_t>(i)].name + "\""; };
    names.push_back(name(joint.b) + " on " + name(joint.a));
  }
  if (names.empty()) return;
  warnings.push_back(
      "nothing stops " + listed(names) + (names.size() == 1 ? ", which slides" : ", which slide") +
      " off at an end; limber-joints writes a joints file in which translation gets limits, for --joints");
}

/// Lengths of a joint times a factor.
JointSpec scaled(JointSpec joint, double factor) {
  joint.frame.origin *= factor;
  joint.pitch *= factor;
  for (Interval& i : joint.limits.translation) i.low *= factor, i.high *= factor;
  return joint;
}

/// How far around its origin a joint holds its parts, m.
double patch_radius(const Joined& joined, std::size_t joint, double scale) {
  const double known = joined.patch_radii[joint];
  if (known > 0.0) return scale * known;
  const JointRecord& record = joined.joints.joints[joint];
  const auto diagonal = [&](Index c) { return joined.assembly.components[static_cast<std::size_t>(c)].diagonal; };
  return scale * kPatch * std::min(diagonal(record.a), diagonal(record.b));
}

/// Joints between the parts, m; then what holds those that stand still, by all of their surfaces.
void add_joints(const Joined& joined, const AssemblyOptions& options, Asset& asset) {
  for (std::size_t i = 0; i < joined.joints.joints.size(); ++i) {
    const JointRecord& joint = joined.joints.joints[i];
    asset.joints.push_back({.a = joint.a,
                            .b = joint.b,
                            .spec = scaled(joint.joint, options.scale),
                            .patch_radius = patch_radius(joined, i, options.scale)});
  }
  for (const std::string& name : grounded(joined.joints, options)) {
    const Index part = component_named(joined.assembly, name);
    const ModalModel& body = *asset.bodies[static_cast<std::size_t>(part)];
    asset.joints.push_back({.b = part,
                            .spec = {.type = JointType::kFixed, .frame = {.origin = body.data().origin_in_input}},
                            .patch_radius = 2.0 * body.collision_extent().radius});
  }
}

/// Parts that touch as drawn and have no joint would be pushed apart where they are only near.
void add_apart(const Assembly& assembly, Jobs& jobs, Asset& asset) {
  for (const ContactRegion& region : find_contact_regions(assembly, {}, jobs)) {
    const bool joined = std::ranges::any_of(asset.joints, [&](const AssetJoint& joint) {
      return std::minmax(joint.a, joint.b) == std::minmax(region.a, region.b);
    });
    if (!joined) asset.apart.push_back({std::min(region.a, region.b), std::max(region.a, region.b)});
  }
}

std::vector<AttachmentPatch> patches_on(Index part, const Joined& joined, double scale) {
  std::vector<AttachmentPatch> patches;
  for (std::size_t i = 0; i < joined.joints.joints.size(); ++i) {
    const JointRecord& joint = joined.joints.joints[i];
    if (joint.a == part || joint.b == part)
      patches.push_back({scale * joint.joint.frame.origin, patch_radius(joined, i, scale)});
  }
  return patches;
}

}  // namespace

BakedAssembly bake_assembly(Program& program, const std::string& path, const AssemblyOptions& options,
                            const BakeOptions& bake_options, Jobs& jobs) {
  FileUnit unit;
  const GroupedSurface surface = read_any_grouped_surface(path, program.warnings(), &unit);
  tell_unit(program, unit);
  Joined joined =
      options.joints_file.empty()
          ? detect(program, surface, options.components, jobs)
          : take(program, surface, options.components.value_or(ComponentRule::kConnectivity), options.joints_file);
  std::size_t dropped = surface.surface.triangles.size();
  for (const Component& part : joined.assembly.components) dropped -= part.triangles.size();
  if (dropped > 0)
    program.warnings().push_back(
        fmt::format("\"{}\": {} triangles have two corners at one place and have been dropped", path, dropped));
  for (const std::string& name : options.rigid)
    if (name != "*") check_name<InvalidArgument>(path, joined.assembly, "--rigid", name);
  for (const std::string& name : options.ground) check_name<InvalidArgument>(path, joined.assembly, "--ground", name);
  for (const auto& [name, material] : bake_options.materials)
    if (name != "*") check_name<InputError>(path, joined.assembly, "--materials", name);
  joined.joints.components.clear();  // in the assembly's order
  for (const Component& part : joined.assembly.components)
    joined.joints.components.push_back({.name = part.name, .faces = part.faces});
  BakedAssembly baked{.asset = {}, .bodies = {}, .joints = joined.joints};
  for (std::size_t i = 0; i < joined.assembly.components.size(); ++i) {
    BakeResult result = bake_part(program, joined.assembly.components[i], options, bake_options,
                                  patches_on(static_cast<Index>(i), joined, options.scale), jobs);
    baked.asset.bodies.push_back(std::move(result.asset.bodies[0]));
    baked.asset.frequency_errors.push_back(std::move(result.asset.frequency_errors[0]));
    baked.asset.sounds.push_back(result.asset.sounds.empty() ? nullptr : std::move(result.asset.sounds[0]));
    baked.bodies.push_back(std::move(result.bodies[0]));
  }
  add_joints(joined, options, baked.asset);
  add_apart(joined.assembly, jobs, baked.asset);
  if (!options.free) warn_of_fallers(baked.joints, grounded(baked.joints, options), program.warnings());
  if (options.joints_file.empty()) warn_of_open_slides(baked.joints, program.warnings());
  return baked;
}

std::string machine_scene(const std::string& name, const std::string& asset) {
  const Json scene = {{"step", 1.0 / 60.0},
                      {"duration", 60},
                      {"assets", {{"machine", asset}}},
                      {"machines", Json::array({{{"name", name}, {"asset", "machine"}}})}};
  return scene.dump(1) + "\n";
}

}  // namespace limber::tools
