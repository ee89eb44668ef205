#include "assemblies.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "assembly_builder.h"
#include "grouped_parts.h"
#include "limber/core/error.h"

namespace limber::assemblies {
namespace {

const Recipe& recipe_of(const std::string& name) {
  for (const auto* recipes : {&tuning_recipes(), &held_out_recipes()})
    if (const auto found = recipes->find(name); found != recipes->end()) return found->second;
  throw InvalidArgument("assemblies::make: there is no assembly \"" + name + "\"");
}

double box_diagonal(const std::vector<Vec3>& points) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : points) box.extend(p);
  return box.diagonal().norm();
}

/// All shells of a part as one surface. @pre at least one shell
SurfaceMesh part_surface(const Builder::Part& part, const Variant& v) {
  SurfaceMesh out;
  for (const Shell& shell : part.shells) {
    const auto offset = static_cast<Index>(out.vertices.size());
    out.vertices.insert(out.vertices.end(), shell.vertices.begin(), shell.vertices.end());
    for (std::size_t i = 0; i < shell.triangles.size(); ++i) {
      if (v.open && shell.idle[i]) continue;
      const Triangle& t = shell.triangles[i];
      out.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
    }
  }
  return out;
}

/// Normal numbers by Box and Muller: the standard leaves its own distribution's algorithm open.
double normal_number(std::mt19937& random) {
  const double u = (random() + 1.0) / 4294967297.0, w = random() / 4294967296.0;
  return std::sqrt(-2.0 * std::log(u)) * std::cos(2.0 * kPi * w);
}

void vary(SurfaceMesh& part, const Variant& v, std::mt19937& random) {
  const double sigma = v.jitter * box_diagonal(part.vertices) / std::sqrt(3.0);
  for (Vec3& p : part.vertices)
    for (double& c : p) c += sigma * normal_number(random);
  if (v.shuffled)
    for (std::size_t i = part.triangles.size(); i > 1; --i)
      std::swap(part.triangles[i - 1], part.triangles[random() % i]);
  if (v.soup) {
    SurfaceMesh soup;
    for (const Triangle& t : part.triangles) {
      const auto first = static_cast<Index>(soup.vertices.size());
      for (const Index i : t) soup.vertices.push_back(part.vertices[static_cast<std::size_t>(i)]);
      soup.triangles.push_back({first, first + 1, first + 2});
    }
    part = std::move(soup);
  }
  for (Vec3& p : part.vertices) p = v.rotation * p * v.scale + v.translation;
}

}  // namespace

const std::vector<std::string>& tuning_names() {
  static const std::vector<std::string> names = {"lamp",          "chair",       "brush arm", "humanoid", "dog",
                                                 "scissors",      "piston",      "drawer",    "hitch",    "door",
                                                 "sliding plate", "welded pair", "snake",     "screw"};
  return names;
}

const std::vector<std::string>& held_out_names() {
  static const std::vector<std::string> names = {"telescope", "gimbal", "dovetail", "stack",  "drop link", "spindle",
                                                 "latch",     "gate",   "caster",   "cardan", "four-bar"};
  return names;
}

MadeAssembly make(const std::string& name, const Variant& variant) {
  const Recipe& recipe = recipe_of(name);
  Builder builder(variant);
  recipe.build(builder);

  MadeAssembly out;
  out.compound = recipe.compound;
  std::mt19937 random(variant.seed);
  if (variant.swapped) std::reverse(builder.parts.begin(), builder.parts.end());
  for (const auto& part : builder.parts) {
    SurfaceMesh surface = part_surface(part, variant);
    vary(surface, variant, random);
    append_group(surface, part.name, out.surface);
  }
  for (TrueJoint joint : builder.joints) {
    joint.origin = variant.rotation * joint.origin * variant.scale + variant.translation;
    joint.axis = variant.rotation * joint.axis;
    joint.pitch *= variant.scale;
    for (TrueRange& range : joint.ranges) {
      range.along = variant.rotation * range.along;
      if (range.freedom == TrueRange::Freedom::kTranslation)
        range.range = {variant.scale * range.range.low, variant.scale * range.range.high};
    }
    out.joints.push_back(joint);
  }
  out.diagonal = box_diagonal(out.surface.surface.vertices);
  return out;
}

}  // namespace limber::assemblies
