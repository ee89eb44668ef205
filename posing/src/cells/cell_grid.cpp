#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <tuple>

#include "cells/box_triangle.h"
#include "limber/core/error.h"
#include "limber/mesh/winding_number.h"
#include "limber/posing/cells.h"

namespace limber {
namespace {

using GridIndex = std::array<Index, 3>;

constexpr double kThinnest = 1e-3;  // of the diagonal: boxes of flat parts
constexpr std::int64_t kMostBoxes = 10'000'000;
constexpr double kDefaultCells = 10.0;  // along the diagonal
constexpr double kRoundOff = 1e-9;      // boxes that differ by less are equal

enum class Place : std::uint8_t { kUnknown, kSurface, kInside, kOutside };

Vec3 corner(const SurfaceMesh& surface, const Triangle& t, std::size_t k) {
  return surface.vertices[static_cast<std::size_t>(t[k])];
}

/// Of the surface's area; the same axes whatever the eigensolver's signs.
Mat3 principal_axes(const SurfaceMesh& surface) {
  const Vec3 origin = corner(surface, surface.triangles.front(), 0);
  double area = 0.0;
  Vec3 first = Vec3::Zero();
  Mat3 second = Mat3::Zero();
  for (const Triangle& t : surface.triangles) {
    const Vec3 a = corner(surface, t, 0) - origin, b = corner(surface, t, 1) - origin,
               c = corner(surface, t, 2) - origin, sum = a + b + c;
    const double w = (b - a).cross(c - a).norm();
    area += w;
    first += w / 3.0 * sum;
    second += w / 12.0 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
  }
  if (!(area > 0.0)) return Mat3::Identity();
  const Mat3 covariance = second / area - first * first.transpose() / (area * area);
  Mat3 axes = Eigen::SelfAdjointEigenSolver<Mat3>(covariance).eigenvectors();
  for (int k = 0; k < 3; ++k) {
    int largest = 0;
    axes.col(k).cwiseAbs().maxCoeff(&largest);
    if (axes(largest, k) < 0.0) axes.col(k) *= -1.0;
  }
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

SurfaceBox box_along(const SurfaceMesh& surface, const Mat3& axes) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Triangle& t : surface.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 p = axes.transpose() * corner(surface, t, k);
      low = low.cwiseMin(p), high = high.cwiseMax(p);
    }
  return {axes, axes * (0.5 * (low + high)), (0.5 * (high - low)).cwiseMax(kThinnest * (high - low).norm())};
}

/// Boxes of the finest size over a surface's box, each with its place.
struct FineGrid {
  GridIndex count{};
  Vec3 low = Vec3::Zero(), edge = Vec3::Zero();  // in the axes of the grid
  std::vector<Place> place{};

  std::size_t number(const GridIndex& i) const {
    return static_cast<std::size_t>(i[0]) +
           static_cast<std::size_t>(count[0]) *
               (static_cast<std::size_t>(i[1]) + static_cast<std::size_t>(count[1]) * static_cast<std::size_t>(i[2]));
  }
  Vec3 centre(const GridIndex& i) const { return low + edge.cwiseProduct(Vec3(i[0] + 0.5, i[1] + 0.5, i[2] + 0.5)); }
  template <class Visit>
  void for_each(const GridIndex& from, const GridIndex& to, Visit&& visit) const {  // `to` included
    for (Index z = from[2]; z <= to[2]; ++z)
      for (Index y = from[1]; y <= to[1]; ++y)
        for (Index x = from[0]; x <= to[0]; ++x) visit(GridIndex{x, y, z});
  }
  GridIndex last() const { return {count[0] - 1, count[1] - 1, count[2] - 1}; }
};

FineGrid empty_grid(const SurfaceBox& box, double size, Index multiple) {
  FineGrid grid;
  double boxes = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double wanted = std::max(1.0, std::ceil(2.0 * box.half[k] / size * (1.0 - kRoundOff)));
    boxes *= wanted + multiple;
    if (boxes > static_cast<double>(kMostBoxes))
      throw InvalidArgument("make_cells: cell_size " + std::to_string(size) +
                            " gives more than 10 million boxes, expected a larger one");
    const Index n = static_cast<Index>(wanted);
    grid.count[static_cast<std::size_t>(k)] = n > 1 ? (n + multiple - 1) / multiple * multiple : n;
    grid.edge[k] = 2.0 * box.half[k] / grid.count[static_cast<std::size_t>(k)];
    grid.low[k] = -box.half[k];
  }
  grid.place.assign(grid.number(grid.last()) + 1, Place::kUnknown);
  return grid;
}

/// Marks what a triangle passes through. @param corners in the axes of the grid
void mark(FineGrid& grid, const std::array<Vec3, 3>& corners) {
  GridIndex from{}, to{};
  for (int k = 0; k < 3; ++k) {
    const auto [low, high] = std::minmax({corners[0][k], corners[1][k], corners[2][k]});
    const auto n = static_cast<double>(grid.count[static_cast<std::size_t>(k)] - 1);
    const auto box_of = [&](double x) { return std::clamp(std::floor((x - grid.low[k]) / grid.edge[k]), 0.0, n); };
    from[static_cast<std::size_t>(k)] = static_cast<Index>(box_of(low));
    to[static_cast<std::size_t>(k)] = static_cast<Index>(box_of(high));
  }
  grid.for_each(from, to, [&](const GridIndex& i) {
    Place& place = grid.place[grid.number(i)];
    if (place != Place::kSurface && internal::box_meets_triangle(grid.centre(i), 0.5 * grid.edge, corners))
      place = Place::kSurface;
  });
}

/// Boxes that no surface parts from each other lie on the same side of it: asks once for each such region.
void fill(FineGrid& grid, const SurfaceMesh& surface, const SurfaceBox& box) {
  std::vector<GridIndex> region;
  grid.for_each({0, 0, 0}, grid.last(), [&](const GridIndex& seed) {
    if (grid.place[grid.number(seed)] != Place::kUnknown) return;
    const Vec3 p = box.centre + box.axes * grid.centre(seed);
    const Place side = std::abs(winding_number(surface, p)) > 0.5 ? Place::kInside : Place::kOutside;
    region.assign(1, seed);
    grid.place[grid.number(seed)] = side;
    while (!region.empty()) {
      const GridIndex at = region.back();
      region.pop_back();
      for (std::size_t k = 0; k < 3; ++k)
        for (const Index step : {-1, 1}) {
          GridIndex next = at;
          next[k] += step;
          if (next[k] < 0 || next[k] >= grid.count[k] || grid.place[grid.number(next)] != Place::kUnknown) continue;
          grid.place[grid.number(next)] = side;
          region.push_back(next);
        }
    }
  });
}

/// The cell that each fine box belongs to (−1: none), and the cells in fine units.
struct Blocks {
  std::vector<Index> of_box{};
  std::vector<std::pair<GridIndex, Index>> blocks{};  // lowest box, edge in boxes
};

/// Merges boxes inside by eights as long as all eight are whole and of one size.
Blocks merge(const FineGrid& grid, int levels) {
  Blocks out;
  out.of_box.assign(grid.place.size(), -1);
  std::vector<std::uint8_t> level(grid.place.size(), 0);  // of the block whose lowest box this is
  const auto is_whole = [&](const GridIndex& low, int l) {
    return grid.place[grid.number(low)] == Place::kInside && level[grid.number(low)] == l;
  };
  for (int l = 0; l < levels; ++l) {
    const Index edge = Index{1} << l;
    grid.for_each({0, 0, 0}, grid.last(), [&](const GridIndex& low) {
      for (std::size_t k = 0; k < 3; ++k)
        if (low[k] % (2 * edge) != 0 || low[k] + 2 * edge > grid.count[k]) return;
      for (int child = 0; child < 8; ++child)
        if (!is_whole(
                {low[0] + (child & 1 ? edge : 0), low[1] + (child & 2 ? edge : 0), low[2] + (child & 4 ? edge : 0)}, l))
          return;
      level[grid.number(low)] = static_cast<std::uint8_t>(l + 1);
    });
  }
  grid.for_each({0, 0, 0}, grid.last(), [&](const GridIndex& low) {
    const Place place = grid.place[grid.number(low)];
    if (place == Place::kOutside || out.of_box[grid.number(low)] >= 0) return;
    const Index edge = Index{1} << level[grid.number(low)];
    const auto cell = static_cast<Index>(out.blocks.size());
    out.blocks.emplace_back(low, edge);
    grid.for_each(low, {low[0] + edge - 1, low[1] + edge - 1, low[2] + edge - 1},
                  [&](const GridIndex& i) { out.of_box[grid.number(i)] = cell; });
  });
  return out;
}

std::vector<CellFace> faces_of(const FineGrid& grid, const Blocks& blocks, const CellGrid& cells,
                               const SurfaceBox& box) {
  std::map<std::tuple<int, Index, Index>, std::pair<GridIndex, GridIndex>>
      shared;  // first and last fine box on a's side
  for (int axis = 0; axis < 3; ++axis)
    grid.for_each({0, 0, 0}, grid.last(), [&](const GridIndex& i) {
      GridIndex next = i;
      if (++next[static_cast<std::size_t>(axis)] >= grid.count[static_cast<std::size_t>(axis)]) return;
      const Index a = blocks.of_box[grid.number(i)], b = blocks.of_box[grid.number(next)];
      if (a < 0 || b < 0 || a == b) return;
      const auto [entry, fresh] = shared.try_emplace({axis, a, b}, i, i);
      if (!fresh) entry->second.second = i;  // visited in ascending order: the far corner comes last
    });
  std::vector<CellFace> out;
  for (const auto& [key, range] : shared) {
    const auto [axis, a, b] = key;
    const Vec3 first = grid.centre(range.first), last = grid.centre(range.second);
    Vec3 middle = 0.5 * (first + last);
    middle[axis] = first[axis] + 0.5 * grid.edge[axis];
    CellFace face{.a = a, .b = b, .axis = axis, .centre = box.centre + box.axes * middle};
    for (int k = 0; k < 2; ++k) {
      const int along = (axis + 1 + k) % 3;
      face.half[static_cast<std::size_t>(k)] = 0.5 * (last[along] - first[along] + grid.edge[along]);
    }
    face.distance =
        cells.cells[static_cast<std::size_t>(a)].half[axis] + cells.cells[static_cast<std::size_t>(b)].half[axis];
    out.push_back(face);
  }
  return out;
}

}  // namespace

void PartOptions::validate() const {
  const auto require = [](bool holds, const std::string& field, double value, const std::string& expected) {
    if (!holds)
      throw InvalidArgument("PartOptions." + field + ": is " + std::to_string(value) + ", expected " + expected);
  };
  require(std::isfinite(cell_size) && cell_size >= 0.0, "cell_size", cell_size, "a finite number >= 0");
  require(octree_levels >= 1 && octree_levels <= 6, "octree_levels", octree_levels, "1 to 6");
  require(std::isfinite(stiffness) && stiffness > 0.0, "stiffness", stiffness, "a finite number > 0");
}

SurfaceBox oriented_box(const SurfaceMesh& surface) {
  if (surface.triangles.empty()) throw InvalidArgument("oriented_box: the surface has no triangle");
  const SurfaceBox upright = box_along(surface, Mat3::Identity()), turned = box_along(surface, principal_axes(surface));
  return turned.half.prod() < (1.0 - kRoundOff) * upright.half.prod() ? turned : upright;
}

CellGrid make_cells(const SurfaceMesh& surface, const PartOptions& options) {
  options.validate();
  const SurfaceBox box = oriented_box(surface);
  CellGrid out{.axes = box.axes, .cells = {}, .faces = {}};
  if (options.cells == Subdivision::kRigid) {
    out.cells.push_back({box.centre, box.half});
    return out;
  }
  const int levels = options.cells == Subdivision::kOctree ? options.octree_levels : 0;
  const double size = options.cell_size > 0.0 ? options.cell_size : 2.0 * box.half.norm() / kDefaultCells;
  FineGrid grid = empty_grid(box, size, Index{1} << levels);
  for (const Triangle& t : surface.triangles) {
    std::array<Vec3, 3> corners;
    for (std::size_t k = 0; k < 3; ++k)
      corners[k] = box.axes.transpose() * (surface.vertices[static_cast<std::size_t>(t[k])] - box.centre);
    mark(grid, corners);
  }
  fill(grid, surface, box);
  const Blocks blocks = merge(grid, levels);
  for (const auto& [low, edge] : blocks.blocks) {
    const Vec3 half = 0.5 * edge * grid.edge;
    out.cells.push_back({box.centre + box.axes * (grid.centre(low) - 0.5 * grid.edge + half), half});
  }
  out.faces = faces_of(grid, blocks, out, box);
  return out;
}

}  // namespace limber
