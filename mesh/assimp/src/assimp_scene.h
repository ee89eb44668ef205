// A file as Assimp reads it, with limber's errors.
#pragma once

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <filesystem>
#include <string>

#include "in_child.h"

namespace limber::internal {

/// Characters that would break a line of text become blanks.
std::string one_line(std::string text);

/// The path in quotes, on one line.
std::string quoted_path(const std::filesystem::path& path);

/// Whether the importer of the format with this extension has read the file.
bool was_read_as(const Assimp::Importer& importer, const char* extension);

/// 10 s and 1 GB, and more for files of more than some megabytes. @throws InputError as read_file() does
ChildLimits limits_for(const std::filesystem::path& path);

/// Call it in a child process alone: Assimp breaks down on some damaged files.
/// @param importer owns the scene @param steps of aiPostProcessSteps @throws InputError with Assimp's reason
const aiScene& read_scene(Assimp::Importer& importer, const std::filesystem::path& path, unsigned steps);

}  // namespace limber::internal
