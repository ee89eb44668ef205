/// @file limber/posing/cells.h
/// The cells that a part of a model is divided into for posing [X09 4.1].
///
/// A rigid part is one cell, its oriented box. A deformable part is a grid of boxes along the axes of its oriented box,
/// those that hold none of it dropped: equal boxes, or an octree that is fine at the surface and coarse inside. Cells
/// are neighbours across the faces that they share; each face carries the strain energy between its two cells.
#pragma once

#include <span>
#include <vector>

#include "limber/core/types.h"
#include "limber/mesh/surface_mesh.h"

namespace limber {

enum class Subdivision {
  kRigid,    ///< one transformation for all of the part
  kUniform,  ///< boxes of one size
  kOctree,   ///< boxes of one size at the surface, merged by eights inside
};

/// How a part of a model behaves when it is posed.
struct PartOptions {
  Subdivision cells = Subdivision::kRigid;
  /// Largest edge of a cell at the surface, in the model's unit; 0: a tenth of the part's diagonal. ≥ 0
  double cell_size = 0.0;
  int octree_levels = 2;   ///< kOctree: cells inside are up to 2^levels times as large; 1 … 6
  double stiffness = 1.0;  ///< of its material, in proportion to the other parts'; > 0
  void validate() const;   ///< @throws InvalidArgument naming the field and its value

  friend bool operator==(const PartOptions&, const PartOptions&) = default;
};

struct Cell {
  Vec3 centre = Vec3::Zero();
  Vec3 half = Vec3::Zero();  ///< half edges along the grid's axes, > 0
};

/// A rectangle that two cells share.
struct CellFace {
  Index a = 0, b = 0;            ///< cells; b lies on the side to which `axis` points
  int axis = 0;                  ///< of the grid: the rectangle's normal
  Vec3 centre = Vec3::Zero();    ///< of the rectangle
  std::array<double, 2> half{};  ///< half edges along the axes after `axis`, in turn
  double distance = 0.0;         ///< of the cells' centres along the normal
};

struct CellGrid {
  Mat3 axes = Mat3::Identity();  ///< columns; orthonormal, right-handed
  std::vector<Cell> cells;
  std::vector<CellFace> faces;  ///< ascending by (axis, a, b); empty for a rigid part
};

struct SurfaceBox {
  Mat3 axes = Mat3::Identity();
  Vec3 centre = Vec3::Zero();
  Vec3 half = Vec3::Zero();  ///< ≥ 1e-3 of the diagonal, also of a flat surface
};
/// The smaller of the boxes along the principal axes of the surface's area and along the model's own axes (which a part
/// that is drawn straight has, also where its principal axes are not unique).
/// @throws InvalidArgument if there is no triangle
SurfaceBox oriented_box(const SurfaceMesh& surface);

/// Divides a surface. A cell stays if a triangle passes through it or the surface goes round it. Time grows with the
/// boxes of the whole grid and the triangles.
/// @throws InvalidArgument if there is no triangle, or if the grid would have more than 10 million boxes
CellGrid make_cells(const SurfaceMesh& surface, const PartOptions& options);

}  // namespace limber
