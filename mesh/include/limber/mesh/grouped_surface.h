/// @file limber/mesh/grouped_surface.h
/// A surface with the names that its file gives to parts of it. Programs that take a file apart read it.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "limber/mesh/surface_mesh.h"

namespace limber {

/// Triangles that follow one another under the same names.
struct SurfaceGroup {
  std::string name;            ///< object or group (OBJ `o`, `g`; glTF node); empty where the file gives none
  std::string material;        ///< material; empty where the file gives none
  Index first = 0, count = 0;  ///< triangles
};

/// A surface as its file draws it: vertices are shared where the file shares them, and nowhere else.
struct GroupedSurface {
  SurfaceMesh surface;
  std::vector<Index> face_of;        ///< per triangle, the face of the file it is cut from; ascending
  std::vector<SurfaceGroup> groups;  ///< in order; together every triangle once
};

/// Reads a surface with its groups. Unlike read_surface_mesh() it welds nothing, so that parts that touch stay apart;
/// an STL file comes as triangles that share no vertex. Formats without names give one group without a name.
/// @throws InputError as read_surface_mesh() does
GroupedSurface read_grouped_surface(const std::filesystem::path& path, Warnings& warnings);

/// Takes the triangles of all groups of a name, or else material, out of a surface. Its vertices stay.
/// @return them with vertices of their own, welded (see weld()); empty if no group has the name
SurfaceMesh take_group(GroupedSurface& surface, std::string_view name);

/// As validate() of a SurfaceMesh; faces and groups follow the triangles that are dropped.
void validate(GroupedSurface& surface, const std::string& name, Warnings& warnings);

}  // namespace limber
