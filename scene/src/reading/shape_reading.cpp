#include "reading/shape_reading.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/mesh/closed_shells.h"
#include "limber/mesh/read_mesh.h"
#include "reading/scene_reading.h"

namespace limber::internal {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMaxHeights = 100'000'000;

HalfSpace read_half_space(const JsonObject& o) {
  HalfSpace s;
  if (o.has("normal")) s.normal = direction(o, "normal");
  s.offset = o.number("offset", 0.0);
  return s;
}

Capsule read_capsule(const JsonObject& o) {
  return {.radius = positive(o, "radius"), .half_length = non_negative(o, "half_length", Capsule{}.half_length)};
}

Box read_box(const JsonObject& o) {
  Box box{o.vec3("half_extents")};
  if (!(box.half_extents.minCoeff() > 0.0))
    refuse(o.where("half_extents"), JsonObject::shown(o.at("half_extents")), "three numbers > 0");
  return box;
}

ConvexHull read_hull(const JsonObject& o) {
  ConvexHull hull;
  o.for_each("points", [&](const Json& v, const std::string& where) { hull.points.push_back(vector_of(v, where)); });
  return hull;
}

/// Rows of heights, the first at y = 0, each along x.
HeightField read_height_field(const JsonObject& o) {
  HeightField field{.columns = 0, .rows = 0, .heights = {}};
  const auto spacing = o.numbers("spacing", 2);
  if (!(spacing[0] > 0.0 && spacing[1] > 0.0))
    refuse(o.where("spacing"), JsonObject::shown(o.at("spacing")), "two numbers > 0");
  field.spacing_x = spacing[0], field.spacing_y = spacing[1];
  o.for_each("heights", [&](const Json& row, const std::string& where) {
    if (!row.is_array()) refuse(where, JsonObject::shown(row), "a row of heights [ … ]");
    if (field.rows++ == 0) field.columns = static_cast<Index>(std::min(row.size(), kMaxHeights));
    if (row.size() != static_cast<std::size_t>(field.columns))
      refuse(where, "a row of " + std::to_string(row.size()) + " heights",
             std::to_string(field.columns) + ", as in the first row");
    for (std::size_t i = 0; i < row.size(); ++i) {
      if (!row[i].is_number() || !std::isfinite(row[i].get<float>()))
        refuse(where + "[" + std::to_string(i) + "]", JsonObject::shown(row[i]), "a finite number");
      field.heights.push_back(row[i].get<float>());
    }
  });
  return field;
}

ShapeFile read_file_name(const JsonObject& o, const std::filesystem::path& folder, bool hull) {
  const std::string file = o.text("file");
  if (file.empty()) refuse(o.where("file"), "\"\"", "a file name");
  return {.path = folder / file, .scale = positive(o, "scale", 1.0), .hull = hull};
}

SceneShape checked(Shape shape, const std::string& where) {
  check_input(where, [&] { validate(shape); });
  return std::make_shared<const Shape>(std::move(shape));
}

SceneShape read_kind(const std::string& kind, const JsonObject& o, const std::filesystem::path& folder) {
  if (kind == "half_space") return checked(read_half_space(o), o.where());
  if (kind == "sphere") return checked(Sphere{positive(o, "radius")}, o.where());
  if (kind == "capsule") return checked(read_capsule(o), o.where());
  if (kind == "box") return checked(read_box(o), o.where());
  if (kind == "height_field") return checked(read_height_field(o), o.where());
  if (kind == "mesh") return read_file_name(o, folder, false);
  return o.has("file") ? SceneShape(read_file_name(o, folder, true)) : checked(read_hull(o), o.where());
}

Shape shape_of(const ShapeFile& file, Warnings& warnings) {
  SurfaceMesh surface = read_surface_mesh(file.path, warnings);
  for (Vec3& p : surface.vertices) p *= file.scale;
  if (file.hull) return ConvexHull{std::move(surface.vertices)};
  if (const Index turned = turn_shells_outward(surface); turned > 0)
    warnings.push_back("\"" + file.path.string() + "\": " + std::to_string(turned) +
                       " closed shells were inside out for where they lie and have been turned");
  return TriangleMesh{std::move(surface.vertices), std::move(surface.triangles)};
}

}  // namespace

SceneShape read_shape(const JsonObject& parent, const std::filesystem::path& folder, Wearer wearer) {
  const std::vector<std::string> kinds = {"half_space", "sphere", "capsule", "box", "hull", "mesh", "height_field"};
  const JsonObject o(parent.at("shape"), parent.where("shape"));
  std::vector<std::string> seen;
  for (const std::string& kind : kinds)
    if (o.has(kind)) seen.push_back(kind);
  if (seen.empty()) o.finish();  // names the nearest kind
  if (seen.size() != 1)
    refuse(o.where(), JsonObject::shown(parent.at("shape")),
           "exactly one of \"half_space\", \"sphere\", \"capsule\", \"box\", \"hull\", \"mesh\" and \"height_field\"");
  if (wearer == Wearer::kBody && seen[0] == "half_space")
    refuse(o.where(), "a half-space", "a shape that ends: only what never moves (\"statics\") may have none");
  if (wearer == Wearer::kSensor && (seen[0] == "half_space" || seen[0] == "mesh" || seen[0] == "height_field"))
    refuse(o.where(), in_quotes(seen[0]), "a convex shape: \"sphere\", \"capsule\", \"box\" or \"hull\"");
  const JsonObject inside(o.at(seen[0]), o.where(seen[0]));
  SceneShape shape = read_kind(seen[0], inside, folder);
  inside.finish();
  o.finish();
  return shape;
}

void warn_of_facing(const Shape& shape, const RigidTransform& pose, const Vec3& gravity, const std::string& where,
                    Warnings& warnings) {
  const auto* mesh = std::get_if<TriangleMesh>(&shape);
  if (mesh == nullptr) return;
  Vec3 normals = Vec3::Zero();  // times areas; their sum over a closed surface is 0
  double areas = 0.0;
  for (const Triangle& t : mesh->triangles) {
    const auto corner = [&](std::size_t i) -> const Vec3& { return mesh->vertices[static_cast<std::size_t>(t[i])]; };
    const Vec3 normal = 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0));
    normals += normal;
    areas += normal.norm();
  }
  constexpr double kRounding = 1e-9;
  if ((pose.q * normals).dot(gravity) > kRounding * areas * gravity.norm())
    warnings.push_back(where +
                       ".shape: the mesh is open, and more of it looks along gravity than against it: what falls on it "
                       "from above passes through; if that is not meant, turn its triangles");
}

std::shared_ptr<const Shape> ShapeLoader::load(const SceneShape& shape, const std::string& where, Warnings& warnings) {
  if (const auto* told = std::get_if<std::shared_ptr<const Shape>>(&shape)) return *told;
  const auto& file = std::get<ShapeFile>(shape);
  const auto known = std::find_if(read_.begin(), read_.end(), [&](const auto& entry) { return entry.first == file; });
  if (known != read_.end()) return known->second;
  auto made = std::make_shared<const Shape>(shape_of(file, warnings));
  check_input(where + ".shape: \"" + file.path.string() + "\"", [&] { validate(*made); });
  read_.emplace_back(file, made);
  return made;
}

}  // namespace limber::internal
