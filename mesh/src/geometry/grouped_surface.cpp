#include "limber/mesh/grouped_surface.h"

#include <utility>

#include "limber/mesh/unused_vertices.h"

namespace limber {

void validate(GroupedSurface& surface, const std::string& name, Warnings& warnings) {
  const auto names_one_twice = [](const Triangle& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; };
  const auto& triangles = surface.surface.triangles;
  std::vector<Index> kept_before(triangles.size() + 1, 0), face_of;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const bool kept = !names_one_twice(triangles[i]);
    kept_before[i + 1] = kept_before[i] + (kept ? 1 : 0);
    if (kept) face_of.push_back(surface.face_of[i]);
  }
  validate(surface.surface, name, warnings);

  surface.face_of = std::move(face_of);
  std::vector<SurfaceGroup> groups;
  for (SurfaceGroup& group : surface.groups) {
    const Index first = kept_before[static_cast<std::size_t>(group.first)];
    const Index end = group.first + group.count;
    const Index last = kept_before[static_cast<std::size_t>(end)];
    group.first = first, group.count = last - first;
    if (group.count > 0) groups.push_back(std::move(group));
  }
  surface.groups = std::move(groups);
}

SurfaceMesh take_group(GroupedSurface& surface, std::string_view name) {
  SurfaceMesh taken{.vertices = surface.surface.vertices, .triangles = {}};
  GroupedSurface rest{
      .surface = {.vertices = std::move(surface.surface.vertices), .triangles = {}}, .face_of = {}, .groups = {}};
  for (SurfaceGroup& group : surface.groups) {
    const bool is_taken = group.name == name || group.material == name;
    const auto first = static_cast<std::size_t>(group.first), end = first + static_cast<std::size_t>(group.count);
    for (std::size_t t = first; t < end; ++t) {
      (is_taken ? taken : rest.surface).triangles.push_back(surface.surface.triangles[t]);
      if (!is_taken) rest.face_of.push_back(surface.face_of[t]);
    }
    if (is_taken) continue;
    group.first = static_cast<Index>(rest.surface.triangles.size()) - group.count;
    rest.groups.push_back(std::move(group));
  }
  surface = std::move(rest);
  weld(taken);
  Warnings unread;  // of vertices that the others use
  drop_unused_vertices(taken, "", unread);
  return taken;
}

}  // namespace limber
