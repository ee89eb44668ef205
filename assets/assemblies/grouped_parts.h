/// @file grouped_parts.h
/// Surfaces put together as a file with named groups would hold them.
#pragma once

#include <string>
#include <vector>

#include "limber/mesh/grouped_surface.h"

namespace limber {

/// Adds a part as a group of its own; a triangle is a face. @param part anything with vertices and triangles
template <class Part>
void append_group(const Part& part, const std::string& name, GroupedSurface& whole) {
  const auto offset = static_cast<Index>(whole.surface.vertices.size());
  whole.groups.push_back(
      {name, "", static_cast<Index>(whole.surface.triangles.size()), static_cast<Index>(part.triangles.size())});
  whole.surface.vertices.insert(whole.surface.vertices.end(), part.vertices.begin(), part.vertices.end());
  for (const Triangle& t : part.triangles) {
    whole.face_of.push_back(static_cast<Index>(whole.face_of.size()));
    whole.surface.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  }
}

}  // namespace limber
