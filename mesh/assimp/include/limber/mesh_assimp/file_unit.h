/// @file limber/mesh_assimp/file_unit.h
/// The unit of length and the upward axis that a file of a surface states.
#pragma once

namespace limber {

/// A unit counts: coordinates have been multiplied by it. An axis is told and not applied: coordinates keep the file's
/// axes. docs/formats/meshes.md has both format by format.
struct FileUnit {
  double metres = 1.0;  ///< of one unit of the file; > 0
  bool stated = false;  ///< by the file, or by its format's default; else metres are assumed
  char up = 0;          ///< 'x', 'y', 'z', or 0 where neither file nor format states one
};

}  // namespace limber
