#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "limber/core/error.h"
#include "limber/internal/material_json.h"
#include "limber/internal/strict_json.h"
#include "limber/mesh/read_mesh.h"
#include "limber/precompute/material_regions.h"

namespace limber {
namespace {

using internal::JsonObject;
using Json = nlohmann::json;
namespace fs = std::filesystem;

/// Reads the array form.
class RegionList {
 public:
  RegionList(const fs::path& path, const MaterialsFileOptions& options, Warnings& warnings)
      : path_(path), options_(options), warnings_(warnings) {}

  MaterialsFile read(const Json& list) {
    for (std::size_t i = 0; i < list.size(); ++i) add(list[i], i);
    return std::move(file_);
  }

 private:
  void add(const Json& value, std::size_t place) {
    const JsonObject numbered(value, "\"" + path_.string() + "\" [" + std::to_string(place) + "]");
    const std::string name = numbered.text("name");
    const JsonObject object(value, "\"" + path_.string() + "\" region " + internal::in_quotes(name));
    object.text("name");
    std::optional<RegionShape> shape = shape_of(object);
    std::variant<Material, MaterialField> material = material_of(object);
    object.finish();
    if (!shape && std::holds_alternative<Material>(material)) {
      if (!file_.table.emplace(name, std::get<Material>(material)).second)
        throw InputError(object.where() + ": stands twice without a shape");
      return;
    }
    MaterialRegion region{
        .name = name, .shape = shape ? std::move(*shape) : Everywhere{}, .material = std::move(material)};
    try {
      region.validate();
    } catch (const InvalidArgument& e) {
      throw InputError("\"" + path_.string() + "\" " + e.what());
    }
    file_.regions.push_back(std::move(region));
  }

  std::optional<RegionShape> shape_of(const JsonObject& object) {
    std::vector<std::string> given;
    for (const char* key : {"faces", "shells", "box", "ball", "half_space"})
      if (object.has(key)) given.emplace_back(key);
    if (given.size() > 1)
      throw InputError(object.where() + ": has \"" + given[0] + "\" and \"" + given[1] + "\", expected one shape");
    if (given.empty()) return std::nullopt;
    if (given[0] == "faces") {
      NearFaces near{.name = object.text("faces")};
      if (object.has("depth")) near.depth = object.number("depth");
      return near;
    }
    if (given[0] == "shells") return InsideShells{read_shells(object)};
    const JsonObject shape(object.at(given[0]), object.where(given[0]));
    RegionShape read;
    if (given[0] == "box")
      read = InsideBox{.low = shape.vec3("low"), .high = shape.vec3("high")};
    else if (given[0] == "ball")
      read = InsideBall{.center = shape.vec3("center"), .radius = shape.number("radius")};
    else
      read = InsideHalfSpace{.point = shape.vec3("point"), .normal = shape.vec3("normal")};
    shape.finish();
    return read;
  }

  /// Of a file, or of a group of the body's own.
  SurfaceMesh read_shells(const JsonObject& object) {
    if (object.at("shells").is_object()) {
      const JsonObject own(object.at("shells"), object.where("shells"));
      const std::string group = own.text("group");
      own.finish();
      if (!options_.take_group) throw InputError(own.where() + ": the input is no surface with groups");
      return options_.take_group(group);
    }
    const fs::path path = path_.parent_path() / object.text("shells");
    file_.files.push_back(path);
    if (options_.read_surface) return options_.read_surface(path);
    SurfaceMesh surface = read_surface_mesh(path, warnings_);
    for (Vec3& v : surface.vertices) v *= options_.scale;
    return surface;
  }

  std::variant<Material, MaterialField> material_of(const JsonObject& object) {
    std::optional<Material> one;
    if (object.has("material")) one = internal::read_material(object.at("material"), object.where("material"));
    if (!object.has("voxels")) {
      if (!one) throw InputError(object.where() + ": has no \"material\" and no \"voxels\"");
      return *one;
    }
    MaterialField field;
    file_.files.push_back(path_.parent_path() / object.text("voxels"));
    field.grid = read_voxel_grid(file_.files.back());
    field.grid.origin *= options_.scale, field.grid.step *= options_.scale;
    if (one) field.rest = *one;
    name_fields(field.grid);
    for (const char* wanted : {"youngs_modulus", "poisson_ratio", "density"})
      if (!one && !field.grid.find(wanted))
        throw InputError(object.where() + ": its voxels have no field \"" + wanted +
                         "\", and no \"material\" tells it");
    return field;
  }

  /// The first axis of an NRRD file holds E, ν and ρ.
  static void name_fields(VoxelGrid& grid) {
    const std::array<const char*, 3> names{"youngs_modulus", "poisson_ratio", "density"};
    if (grid.fields.size() != names.size()) return;
    for (std::size_t i = 0; i < names.size(); ++i)
      if (grid.fields[i].name == std::to_string(i)) grid.fields[i].name = names[i];
  }

  const fs::path& path_;
  const MaterialsFileOptions& options_;
  Warnings& warnings_;
  MaterialsFile file_;
};

}  // namespace

MaterialsFile read_materials_file(const fs::path& path, const MaterialsFileOptions& options, Warnings& warnings) {
  if (!(options.scale > 0.0 && std::isfinite(options.scale)))
    throw InvalidArgument("MaterialsFileOptions::scale is " + std::to_string(options.scale) + ", expected above 0");
  const Json document = internal::read_json(path);
  if (!document.is_array()) return {.table = read_materials(path), .regions = {}, .files = {}};
  if (document.empty())
    throw InputError("\"" + path.string() + "\": names no region, expected at least one, or \"*\" for all");
  return RegionList(path, options, warnings).read(document);
}

}  // namespace limber
