/// @file limber/mesh/voxel_grid.h
/// Numbers on a regular grid, such as a scan gives them, and their files.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "limber/core/types.h"

namespace limber {

/// Samples at origin + step · (i, j, k), 0 ≤ i < counts[0], …; i runs fastest. Lengths in metres.
struct VoxelGrid {
  /// One quantity, a number per sample.
  struct Field {
    std::string name;
    std::vector<double> values;
  };
  std::array<Index, 3> counts{};  ///< samples along each axis; ≥ 1
  Vec3 origin = Vec3::Zero();     ///< of the first sample, m
  Mat3 step = Mat3::Identity();   ///< columns: from one sample to the next along each axis, m; regular
  bool of_cells = false;          ///< a sample is the value of the cell around it, else of the point that it lies at
  std::vector<Field> fields;

  std::size_t samples() const {
    return static_cast<std::size_t>(counts[0]) * static_cast<std::size_t>(counts[1]) *
           static_cast<std::size_t>(counts[2]);
  }
  const Field* find(std::string_view name) const;  ///< null if there is none of that name

  /// A field's value at a point: that of its cell, or between points by trilinear interpolation. None outside of the
  /// grid, beyond round-off: of cells, half a step from the outermost samples; of points, from these on.
  /// @pre the grid and the field are valid (see validate())
  std::optional<double> value_at(const Field& field, const Vec3& p) const;
};

/// @throws InputError if a count is below 1, steps lie in one plane, a number is not finite or a field has not as many
/// values as there are samples. @param name shown in messages
void validate(const VoxelGrid& grid, const std::string& name);

/// Reads VTK legacy STRUCTURED_POINTS (text, binary; each SCALARS of one component and each array of a FIELD is a
/// field, of points or of cells, not both) and NRRD with its data in the same file as `raw`, three axes (one field,
/// called by `content`) or four, of which the first holds fields "0", "1", …. docs/formats/materials.md tells more.
/// @throws InputError in one line
VoxelGrid read_voxel_grid(const std::filesystem::path& path);

}  // namespace limber
