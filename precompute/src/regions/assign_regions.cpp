#include "regions/assign_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <sstream>

#include "limber/core/error.h"
#include "limber/mesh/surface_locator.h"
#include "regions/region_shapes.h"

namespace limber::internal {
namespace {

std::vector<Vec3> centroids(const TetMesh& mesh) {
  std::vector<Vec3> at;
  at.reserve(mesh.tets.size());
  for (const Tet& t : mesh.tets)
    at.push_back(0.25 * (mesh.nodes[t[0]] + mesh.nodes[t[1]] + mesh.nodes[t[2]] + mesh.nodes[t[3]]));
  return at;
}

bool is_name_of(const Region& region, const std::string& name) {
  return region.name == name || std::to_string(region.tag) == name;
}

bool has_name(const GroupedSurface& faces, const std::string& name) {
  return std::any_of(faces.groups.begin(), faces.groups.end(), [&](const SurfaceGroup& g) {
    return g.count > 0 && !name.empty() && (g.name == name || g.material == name);
  });
}

std::string told(const std::vector<Region>& regions) {
  std::string text;
  for (const Region& r : regions)
    text += (text.empty() ? "" : ", ") + (r.name.empty() ? std::to_string(r.tag) : "\"" + r.name + "\"");
  return text.empty() ? "none" : text;
}

/// Names of the table that are no region of the mesh but faces of its surface become regions below these.
/// @throws InputError of a name that is neither
std::vector<MaterialRegion> with_named_faces(const TetMesh& mesh, const MaterialTable& table,
                                             std::span<const MaterialRegion> shapes,
                                             const std::optional<GroupedSurface>& faces) {
  std::vector<MaterialRegion> all;
  for (const auto& [name, material] : table) {
    const auto is_meant = [&name = name](const Region& r) { return is_name_of(r, name); };
    if (name == "*" || std::any_of(mesh.regions.begin(), mesh.regions.end(), is_meant)) continue;
    if (!faces || !has_name(*faces, name))
      throw InputError("materials: the mesh has no region \"" + name + "\"" +
                       (faces ? ", and its surface no faces of that name" : "") +
                       "; its regions: " + told(mesh.regions));
    all.push_back({.name = name, .shape = NearFaces{.name = name}, .material = material});
  }
  all.insert(all.end(), shapes.begin(), shapes.end());
  return all;
}

std::string coordinates(const Vec3& p) {
  std::ostringstream text;
  text.precision(4);
  text << "(" << p.x() << ", " << p.y() << ", " << p.z() << ")";
  return text.str();
}

/// Regions of a mesh as materials are handed out.
class Regions {
 public:
  Regions(const TetMesh& mesh, std::span<const Vec3> centroids) : mesh_(mesh), centroids_(centroids) {}

  Index of_table(const MaterialTable& table, std::size_t tet) {
    const Region& own = mesh_.regions[mesh_.tet_region[tet]];
    for (const std::string& key : {own.name, std::to_string(own.tag), std::string("*")})
      if (const auto found = table.find(key); found != table.end())
        return number(own, static_cast<int>(mesh_.tet_region[tet]), found->second);
    throw InputError("materials: region \"" + own.name + "\" (tag " + std::to_string(own.tag) +
                     ") of the mesh has no material; name it, or give \"*\" for the rest");
  }

  /// @param order of the region among the shapes
  Index of_shape(const MaterialRegion& region, std::size_t order, std::size_t tet) {
    const Region own{.name = region.name, .tag = 0};
    const int key = -1 - static_cast<int>(order);
    if (const auto* one = std::get_if<Material>(&region.material)) return number(own, key, *one);
    const std::optional<Material> material = std::get<MaterialField>(region.material).at(centroids_[tet]);
    if (!material)
      throw InputError("materials: the voxels of region \"" + region.name + "\" do not cover it: the tetrahedron at " +
                       coordinates(centroids_[tet]) + " m lies outside of the grid");
    check(*material,
          "materials: the voxels of region \"" + region.name + "\" at " + coordinates(centroids_[tet]) + " m");
    return number(own, key, *material);
  }

  std::vector<Region> regions;
  std::vector<Material> materials;

 private:
  /// A field's numbers come from a file.
  static void check(const Material& material, const std::string& where) {
    try {
      material.validate(where);
    } catch (const InvalidArgument& e) {
      throw InputError(e.what());
    }
  }

  /// @param key of the mesh's region, or below 0 of a shape
  Index number(const Region& region, int key, const Material& m) {
    const auto [place, fresh] =
        known_.try_emplace({key, {m.youngs_modulus, m.poisson_ratio, m.density}}, static_cast<Index>(regions.size()));
    if (fresh) regions.push_back(region), materials.push_back(m);
    return place->second;
  }

  const TetMesh& mesh_;
  std::span<const Vec3> centroids_;
  std::map<std::pair<int, std::array<double, 3>>, Index> known_;
};

/// Which of the shapes holds each tet: the last, −1 if none.
std::vector<int> last_holders(std::span<const Vec3> points, std::span<const MaterialRegion> shapes,
                              const std::optional<GroupedSurface>& faces) {
  const bool by_faces = std::any_of(shapes.begin(), shapes.end(),
                                    [](const auto& r) { return std::holds_alternative<NearFaces>(r.shape); });
  std::optional<NearestFaces> nearest;
  if (by_faces) nearest.emplace(faces);
  std::vector<ShapeTest> tests;
  for (const MaterialRegion& r : shapes) tests.emplace_back(r, faces);
  std::vector<int> holders;
  for (const Vec3& p : points) {
    const std::optional<NearFace> face = nearest ? std::optional(nearest->at(p)) : std::nullopt;
    int i = static_cast<int>(shapes.size()) - 1;
    while (i >= 0 && !tests[static_cast<std::size_t>(i)].holds(p, face)) --i;
    holders.push_back(i);
  }
  return holders;
}

void check_none_is_empty(std::span<const MaterialRegion> shapes, std::span<const int> holders) {
  for (std::size_t i = 0; i < shapes.size(); ++i)
    if (std::find(holders.begin(), holders.end(), static_cast<int>(i)) == holders.end())
      throw InputError("materials: region \"" + shapes[i].name +
                       "\" is empty: it holds the centroid of no tetrahedron that a later region does not take");
}

}  // namespace

std::vector<Material> assign_regions(TetMesh& mesh, const MaterialTable& table, std::span<const MaterialRegion> shapes,
                                     const std::optional<GroupedSurface>& faces) {
  for (const auto& [name, material] : table) material.validate("material of \"" + name + "\"");
  for (const MaterialRegion& r : shapes) r.validate();
  const std::vector<MaterialRegion> all = with_named_faces(mesh, table, shapes, faces);
  const std::vector<Vec3> points = centroids(mesh);
  const std::vector<int> holders = last_holders(points, all, faces);
  check_none_is_empty(all, holders);
  Regions regions(mesh, points);
  std::vector<Index> of_tet;
  for (std::size_t t = 0; t < mesh.tets.size(); ++t)
    of_tet.push_back(holders[t] < 0 ? regions.of_table(table, t)
                                    : regions.of_shape(all[static_cast<std::size_t>(holders[t])],
                                                       static_cast<std::size_t>(holders[t]), t));
  mesh.tet_region = std::move(of_tet);
  mesh.regions = std::move(regions.regions);
  return std::move(regions.materials);
}

}  // namespace limber::internal
