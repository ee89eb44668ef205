#include "limber/mesh/voxel_grid.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "limber/core/error.h"

namespace limber {
namespace {

constexpr double kRoundOff = 1e-9;  // of a step: so far outside still counts as on the grid's rim
constexpr double kFlat = 1e-12;     // of the product of the steps' lengths

}  // namespace

const VoxelGrid::Field* VoxelGrid::find(std::string_view name) const {
  const auto found = std::find_if(fields.begin(), fields.end(), [&](const Field& f) { return f.name == name; });
  return found == fields.end() ? nullptr : &*found;
}

std::optional<double> VoxelGrid::value_at(const Field& field, const Vec3& p) const {
  const Vec3 at = step.inverse() * (p - origin);  // in steps
  const double rim = (of_cells ? 0.5 : 0.0) + kRoundOff;
  std::array<Index, 3> low{}, high{};
  Vec3 share = Vec3::Zero();
  for (int a = 0; a < 3; ++a) {
    const double last = counts[a] - 1;
    if (!(at[a] >= -rim && at[a] <= last + rim)) return std::nullopt;
    const double inside = std::clamp(of_cells ? std::round(at[a]) : at[a], 0.0, last);
    low[a] = static_cast<Index>(inside);
    high[a] = std::min<Index>(low[a] + 1, counts[a] - 1);
    share[a] = inside - low[a];
  }
  const auto sample = [&](Index i, Index j, Index k) {
    const auto rows = static_cast<std::size_t>(counts[1]), columns = static_cast<std::size_t>(counts[0]);
    return field.values[(static_cast<std::size_t>(k) * rows + static_cast<std::size_t>(j)) * columns +
                        static_cast<std::size_t>(i)];
  };
  double value = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    std::array<Index, 3> at_corner{};
    double weight = 1.0;
    for (int a = 0; a < 3; ++a) {
      const bool up = (corner >> a) % 2 == 1;
      at_corner[a] = up ? high[a] : low[a];
      weight *= up ? share[a] : 1.0 - share[a];
    }
    if (weight > 0.0) value += weight * sample(at_corner[0], at_corner[1], at_corner[2]);
  }
  return value;
}

void validate(const VoxelGrid& grid, const std::string& name) {
  for (const Index count : grid.counts)
    if (count < 1)
      throw InputError(name + ": the grid has " + std::to_string(count) + " samples along an axis, expected 1 or more");
  if (!grid.origin.allFinite() || !grid.step.allFinite())
    throw InputError(name + ": the grid's origin or steps are not finite");
  if (std::abs(grid.step.determinant()) <= kFlat * grid.step.colwise().norm().prod())
    throw InputError(name + ": the grid's steps lie in one plane, expected three directions");
  if (grid.fields.empty()) throw InputError(name + ": the grid has no field of one number per sample");
  for (const VoxelGrid::Field& field : grid.fields) {
    if (field.values.size() != grid.samples())
      throw InputError(name + ": field \"" + field.name + "\" has " + std::to_string(field.values.size()) +
                       " values, expected " + std::to_string(grid.samples()));
    for (const double value : field.values)
      if (!std::isfinite(value))
        throw InputError(name + ": field \"" + field.name + "\" has a value that is not finite");
  }
}

}  // namespace limber
