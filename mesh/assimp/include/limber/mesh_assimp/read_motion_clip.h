/// @file limber/mesh_assimp/read_motion_clip.h
/// Motion clips: BVH, by the Assimp library.
#pragma once

#include <filesystem>

#include "limber/mesh/motion_clip.h"

namespace limber {

/// The skeleton of a file and its first animation. Rotations and places as the file has them: no unit or axis is
/// converted. @throws InputError in one line: no animation, a file that is cut off, numbers that are not finite
MotionClip read_motion_clip(const std::filesystem::path& path);

}  // namespace limber
