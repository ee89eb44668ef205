/// @file limber/precompute/material_regions.h
/// Materials inside a body: parts of it by shapes, by the nearest faces of its surface, or as fields on a grid.
///
/// A tet takes the last of a list of regions that holds its centroid. Boundaries of regions run along faces of tets, up
/// to a cell off where the mesh does not follow them (TetrahedralisationOptions::inner_surfaces). The report of a bake
/// has volume and mass of each region.
#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "limber/mesh/surface_mesh.h"
#include "limber/mesh/voxel_grid.h"
#include "limber/model/material.h"

namespace limber {

// Where a region lies. Lengths in metres, mesh coordinates.

struct Everywhere {};

/// Where the nearest face of the body's surface is in a group, or has a material, of this name.
struct NearFaces {
  std::string name;
  double depth = std::numeric_limits<double>::infinity();  ///< of the region below the faces, m; > 0
};

/// Inside closed shells: where they wind around a point (winding_number()), whichever way their triangles run.
struct InsideShells {
  SurfaceMesh surface;
};

struct InsideBox {
  Vec3 low = Vec3::Zero(), high = Vec3::Zero();
};

struct InsideBall {
  Vec3 center = Vec3::Zero();
  double radius = 0.0;
};

/// (x − point) · normal ≤ 0
struct InsideHalfSpace {
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();  ///< out of the region; any length above 0
};

using RegionShape = std::variant<Everywhere, NearFaces, InsideShells, InsideBox, InsideBall, InsideHalfSpace>;

/// A material that varies: fields "youngs_modulus" (Pa), "poisson_ratio" and "density" (kg/m³) on a grid, sampled at
/// centroids of tets.
struct MaterialField {
  VoxelGrid grid;
  Material rest{};  ///< for fields that the grid lacks
  /// At a point that the grid covers, else none.
  std::optional<Material> at(const Vec3& p) const;
};

struct MaterialRegion {
  std::string name;
  RegionShape shape;
  std::variant<Material, MaterialField> material;
  void validate() const;  ///< @throws InvalidArgument naming region and field
};

/// What a file of materials says: by names of regions, and by shapes, of which later ones count over earlier ones and
/// all over names.
struct MaterialsFile {
  MaterialTable table;
  std::vector<MaterialRegion> regions;
  std::vector<std::filesystem::path> files;  ///< others that were read
};

/// How other files that a file of materials names are read.
struct MaterialsFileOptions {
  /// A surface, in mesh coordinates; none: read_surface_mesh(), times `scale`.
  std::function<SurfaceMesh(const std::filesystem::path&)> read_surface{};
  /// Closed shells that are a group of the body's own file and bound a region in place of the body; none: they are
  /// refused.
  std::function<SurfaceMesh(const std::string& group)> take_group{};
  double scale = 1.0;  ///< metres per unit of a grid's file; > 0
};

/// Reads both forms, the object of read_materials() and the array of regions (docs/formats/materials.md). Names of
/// files are relative to the folder of `path`. @throws InputError
MaterialsFile read_materials_file(const std::filesystem::path& path, const MaterialsFileOptions& options,
                                  Warnings& warnings);

}  // namespace limber
