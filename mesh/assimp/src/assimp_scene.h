// A file as Assimp reads it, with limber's errors.
#pragma once

#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#include <filesystem>
#include <string>

namespace limber::internal {

/// Characters that would break a line of text become blanks.
std::string one_line(std::string text);

/// The path in quotes, on one line.
std::string quoted_path(const std::filesystem::path& path);

/// @param importer owns the scene @param steps of aiPostProcessSteps @throws InputError with Assimp's reason
const aiScene& read_scene(Assimp::Importer& importer, const std::filesystem::path& path, unsigned steps);

}  // namespace limber::internal
