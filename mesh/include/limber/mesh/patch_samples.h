/// @file limber/mesh/patch_samples.h
/// Where a patch of a surface is sampled for means over its area: the middles of edges, which integrate products of two
/// functions that are linear on each triangle exactly. A traction that is linear too is then shared as finite elements
/// share it (consistent nodal loads), so that what bends across a patch finds no softness of its own there.
#pragma once

#include <array>
#include <span>
#include <utility>
#include <vector>

#include "limber/core/types.h"

namespace limber {

struct PatchSample {
  Index triangle = 0;
  std::array<double, 3> at{};  ///< barycentric
  double weight = 0.0;         ///< share of the whole; they sum to 1
};

/// Of the triangles that have all corners in the patch; where those have no area, its vertices alike.
/// @param inside by vertex. @param place where a vertex is, m
template <class Place>
std::vector<PatchSample> patch_samples(std::span<const Triangle> triangles, const std::vector<bool>& inside,
                                       const Place& place) {
  std::vector<PatchSample> samples, vertices;
  std::vector<bool> left = inside;  // of the vertices
  double area = 0.0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const auto corner = [&](std::size_t c) { return static_cast<std::size_t>(triangles[t][c]); };
    for (std::size_t c = 0; c < 3; ++c) {
      if (!left[corner(c)]) continue;
      left[corner(c)] = false;
      vertices.push_back({.triangle = static_cast<Index>(t), .weight = 1.0});
      vertices.back().at[c] = 1.0;
    }
    if (!inside[corner(0)] || !inside[corner(1)] || !inside[corner(2)]) continue;
    const Vec3 a = place(corner(0)), b = place(corner(1)), c = place(corner(2));
    const double of_triangle = 0.5 * (b - a).cross(c - a).norm();
    area += of_triangle;
    for (const std::array<double, 3>& at : {std::array{0.5, 0.5, 0.0}, {0.0, 0.5, 0.5}, {0.5, 0.0, 0.5}})
      samples.push_back({static_cast<Index>(t), at, of_triangle / 3.0});
  }
  const double all = area > 0.0 ? area : static_cast<double>(vertices.size());
  std::vector<PatchSample>& chosen = area > 0.0 ? samples : vertices;
  for (PatchSample& sample : chosen) sample.weight /= all;
  return std::move(chosen);
}

}  // namespace limber
