#include "bake/region_materials.h"

#include <algorithm>

#include "limber/core/error.h"

namespace limber::internal {
namespace {

const Material* find_material(const MaterialTable& table, const Region& region) {
  for (const std::string& key : {region.name, std::to_string(region.tag), std::string("*")})
    if (const auto found = table.find(key); found != table.end()) return &found->second;
  return nullptr;
}

}  // namespace

std::vector<Material> materials_by_region(const TetMesh& mesh, const MaterialTable& table) {
  for (const auto& [name, material] : table) material.validate("material of \"" + name + "\"");
  std::vector<char> used(mesh.regions.size(), 0);
  for (const Index r : mesh.tet_region) used[r] = 1;
  std::vector<Material> materials(mesh.regions.size());
  for (std::size_t r = 0; r < mesh.regions.size(); ++r) {
    const Material* found = find_material(table, mesh.regions[r]);
    if (!found && used[r])
      throw InputError("materials: region \"" + mesh.regions[r].name + "\" (tag " +
                       std::to_string(mesh.regions[r].tag) +
                       ") of the mesh has no material; name it, or give \"*\" for the rest");
    if (found) materials[r] = *found;
  }
  return materials;
}

void warn_of_unknown_regions(const TetMesh& mesh, const MaterialTable& table, Warnings& warnings) {
  for (const auto& [name, unused] : table) {
    const auto is_named = [&name = name](const Region& r) { return r.name == name || std::to_string(r.tag) == name; };
    if (name != "*" && std::none_of(mesh.regions.begin(), mesh.regions.end(), is_named))
      warnings.push_back("materials: the mesh has no region \"" + name + "\"");
  }
}

}  // namespace limber::internal
