// A polygon soup with everything that keeps triangles from bounding a solid, around a solid of known volume.
#pragma once

#include <numbers>

#include "shapes.h"

namespace limber::shapes {

/// Two crossing spheres (radii 1 and 0.6, centres 1.2 apart) with holes (every 40th triangle is missing), flipped faces
/// (every 7th), duplicates (every 11th) and inner fins (every 60th triangle has a third one on an edge of it).
inline SurfaceMesh soup() {
  SurfaceMesh clean;
  append(sphere({0, 0, 0}, 1.0, 4), clean);
  append(sphere({1.2, 0, 0}, 0.6, 3), clean);
  SurfaceMesh s;
  s.vertices = clean.vertices;
  const auto middle = static_cast<Index>(s.vertices.size());
  s.vertices.emplace_back(0, 0, 0);
  for (std::size_t i = 0; i < clean.triangles.size(); ++i) {
    const auto [a, b, c] = clean.triangles[i];
    if (i % 40 == 0) continue;
    s.triangles.push_back(i % 7 == 0 ? Triangle{a, c, b} : Triangle{a, b, c});
    if (i % 11 == 0) s.triangles.push_back({a, b, c});
    if (i % 60 == 1) s.triangles.push_back({a, b, middle});
  }
  return s;
}

/// Of the union of the two balls, m³: their volumes less the lens they share (two spherical caps).
inline double soup_volume() {
  const auto cap = [](double radius, double height) {
    return std::numbers::pi * height * height * (3.0 * radius - height) / 3.0;
  };
  const auto ball = [](double radius) { return 4.0 / 3.0 * std::numbers::pi * radius * radius * radius; };
  const double r = 1.0, s = 0.6, d = 1.2;
  const double to_plane = (d * d + r * r - s * s) / (2.0 * d);  // from the first centre to the circle they share
  return ball(r) + ball(s) - cap(r, r - to_plane) - cap(s, s - (d - to_plane));
}

}  // namespace limber::shapes
