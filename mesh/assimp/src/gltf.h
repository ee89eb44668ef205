// What glTF files hold that Assimp reads otherwise than the format says.
#pragma once

#include <assimp/scene.h>

#include <filesystem>
#include <string>
#include <vector>

#include "limber/core/types.h"

namespace limber::internal {

/// Refuses what limber does not read, by its name: extensions that the file requires, and positions that are not
/// floats. Files that are no glTF pass. @param name of the file, quoted @throws InputError
void check_gltf(const std::filesystem::path& path, const std::string& name);

/// A mesh's vertices as glTF shows them: morph targets by their default weights, then either by the joints of its skin,
/// Σ w (joint · inverse bind), or, without one, by the node. A skinned mesh's own node counts for nothing (glTF 2.0,
/// 3.7.3.3). @param pose of the node in the scene
std::vector<Vec3> shown_vertices(const aiScene& scene, const aiMesh& mesh, const aiMatrix4x4t<double>& pose);

}  // namespace limber::internal
